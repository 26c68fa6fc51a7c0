"""Pairs that need a note, above all those that are not what their names promise, found in their records.

Mostly because published code does something else than it says, and here the same. Nothing here changes a
number.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass

from pytest_libero_max.benchmark.suites import VARIED
from pytest_libero_max.events.schedules import BASE, BASE_AGAIN
from pytest_libero_max.pairing.record import PROGRAM
from pytest_libero_max.pairing.scene_fingerprints import START
from pytest_libero_max.pairing.stage import WAITED
from pytest_libero_max.report.formats import counted
from pytest_libero_max.report.report_document import Caveat
from pytest_libero_max.runs.outcomes import Played
from pytest_libero_max.worlds.rendering.context import renderers
from pytest_libero_max.worlds.versions import is_later_line

_TOKENS = re.compile(
    r" (?:view(?: \d+){5} initstate \d+(?: noise \d+)?|(?:table|tb|light|add)(?: \d+)+"
    r"|(?:moved )?level\d+ sample\d+)$"
)
"""The end of a LIBERO-Plus name that is read out as a prompt."""

_INSERTIONS = ("distractor_burst", "obstacle_insertion")


@dataclass(frozen=True)
class Rule:
    """A caveat and the pairs that it concerns."""

    name: str
    concerns: Callable[[Played], bool]
    text: str


def _semantics(record: Played) -> str | None:
    """Name of the way in which the event was played; None without an event, or where there is but one way."""
    return record.fingerprints.get("semantics") if record.triggered else None


def _varied(source: str, category: str) -> Callable[[Played], bool]:
    """Return a test for pairs on a genuine scene that LIBERO-Plus or LIBERO-PRO varied itself."""

    def concerns(record: Played) -> bool:
        same = (record.source, record.source_category) == (source, category)
        return same and _genuine(record) and not _own_variation(record)

    return concerns


def _own_variation(record: Played) -> bool:
    """Return True for a pair on a genuine scene with a variation of this package."""
    return record.source in VARIED and record.fingerprints.get("source_variations") == "own"


def _genuine(record: Played) -> bool:
    return "semantics" in record.fingerprints


def _event(semantics: str, *names: str) -> Callable[[Played], bool]:
    return lambda record: _semantics(record) == semantics and record.event in names


RULES = (
    Rule(
        "program",
        lambda record: PROGRAM in record.fingerprints,
        "The arms are those of a program, whose name ends the id. Dynamic gets what the "
        "program says; the event of the case, by which tables group it, may be no part of "
        "that. All numbers compare Base and Dynamic; further arms are counted apart.",
    ),
    Rule(
        "later_mujoco",
        lambda record: is_later_line(record.fingerprints.get("mujoco", "")),
        "Played with MuJoCo 3.4 or later, where boxes touch in another way than in 3.3. "
        "The frozen cases were certified with 3.3, and the published runs were played with "
        "it. Single pairs end otherwise: compare runs of one version only.",
    ),
    Rule(
        "not_repeatable",
        lambda record: not record.policy.get("repeatable", True),
        "The policy draws its own noise and takes no seed, so a pair may end otherwise "
        "when it is played again: the measured change holds this chance besides the effect "
        "of the event. --libero-max-noise=sham:SHARE measures on a share of the pairs how "
        "often an outcome flips by chance.",
    ),
    Rule(
        "interrupted_server",
        lambda record: WAITED in record.timings,
        "The policy server was interrupted and asked again while the episode stood still. "
        "A server without memory and with seeded noise gives the same answer as without "
        "the interruption.",
    ),
    Rule(
        "contaminated_prompt",
        lambda record: record.source == "plus" and _TOKENS.search(record.instruction) is not None,
        "The prompt contains the name of the variation, as in '... plate view 0 0 100 0 0 "
        "initstate 4', because the authors make it from the task's name. --libero-max- "
        "substrate=libero:instruction=clean gives the task's own words.",
    ),
    Rule(
        "tumbled_insertions",
        _event("published", *_INSERTIONS),
        "Events as published: the inserted object waited inside the floor, was pushed out "
        "of it, and comes back in the pose into which it had tumbled: rotated, or lying. "
        "Corrected events insert it upright.",
    ),
    Rule(
        "one_noise_stream",
        _event("published", "sensor_noise_onset"),
        "Events as published: one random stream, counted in steps since the event, gives "
        "the noise and the rectangle of both cameras. Corrected events give each camera a "
        "stream of its own.",
    ),
    Rule(
        "shifted_observations",
        lambda record: _semantics(record) == "published",
        "Events as published: the authors' runner reads observations four times before the "
        "first step and once after the event. Each reading makes all later observations "
        "one substep (2 ms) older. A moved object keeps its part of the solver's last "
        "forces. Corrected events read once before the first step, and no more.",
    ),
    Rule(
        "corrected_events",
        lambda record: _semantics(record) == "corrected",
        "Corrected events: inserted objects stand upright, each camera has its own noise, "
        "and observations keep their age. Published numbers belong to the events as "
        "published, which --libero-max-substrate plays without semantics=corrected.",
    ),
    Rule(
        "own_variations",
        _own_variation,
        "The source variation is made by this package, at reset, on LIBERO's scene: it has "
        "the category of LIBERO-Plus or LIBERO-PRO, but is not theirs. Their published "
        "numbers are of other scenes.",
    ),
    Rule(
        "erased_robot_pose",
        _varied("plus", "Robot Initial States"),
        "LIBERO-Plus sets the robot's pose first and the frozen initial state after it, "
        "which erases the pose: the arm starts where it always does, and the controller "
        "slowly turns it towards the pose that was meant.",
    ),
    Rule(
        "reseeded_noise",
        _varied("plus", "Sensor Noise"),
        "LIBERO-Plus draws its noise without a seed. Here scene and step are the seed, so "
        "that both rollouts of a pair see the same noise. The noise is on the agent's view "
        "alone, and not in the first observation.",
    ),
    Rule(
        "inert_shape",
        _varied("pro", "object_shape"),
        "LIBERO-PRO scales the meshes of a model that is already compiled, which changes "
        "neither images nor contacts: these pairs play the unmodified task.",
    ),
    Rule(
        "tint_for_texture",
        _varied("pro", "object_texture"),
        "LIBERO-PRO's new texture is only a tint: the old texture stays in the renderer's memory under it.",
    ),
    Rule(
        "small_occluder",
        _varied("pro", "view_occlusion"),
        "LIBERO-PRO's occluder has its original size: scaling the meshes of a compiled model has no effect.",
    ),
)


UNEQUAL_BASES = (
    "Base was another rollout than its repetition, or than the Base of an earlier pair "
    "with the same state, seed and instruction, although the policy says that it answers "
    "alike. It remembers something from episode to episode, so that results depend on what "
    "was played before."
)

OTHER_RENDERERS = (
    "Their images were drawn by another renderer, or another version of it, than those of "
    "most pairs (gl_renderer and gl_version in the records). Pixels may differ, and one "
    "pixel is enough for a policy that sees to end a pair otherwise. Play all pairs with "
    "one renderer."
)


def caveats_of(records: Iterable[Played]) -> list[Caveat]:
    """Return the caveats that concern a pair, with how many they concern; :data:`RULES` last, in order."""
    pairs = list(records)
    counts = [("unequal_bases", _unequal_bases(pairs), UNEQUAL_BASES)]
    counts += [("other_renderers", _drawn_otherwise(pairs), OTHER_RENDERERS)]
    counts += [(rule.name, sum(map(rule.concerns, pairs)), rule.text) for rule in RULES]
    return [
        Caveat(name=name, pairs=count, played=len(pairs), text=text) for name, count, text in counts if count
    ]


def _unequal_bases(records: Iterable[Played]) -> int:
    """Count the pairs whose Base differs from its repetition, or from that of a pair that begins alike.

    What an event brings in is taken out of the scene before Base begins: pairs with such events are left out.
    """
    bases: dict[tuple[Hashable, ...], str] = {}
    unequal = 0
    for record in records:
        if not record.policy.get("repeatable", True):
            continue
        repeated = record.proofs.get(BASE_AGAIN)
        if repeated not in (None, record.proofs[BASE]):
            unequal += 1
        elif START in record.fingerprints and {PROGRAM, record.event}.isdisjoint(
            (*record.fingerprints, *_INSERTIONS)
        ):
            played = frozenset(record.fingerprints.items())
            key = (played, record.policy_seed, record.instruction, record.max_steps)
            proof = record.proofs[BASE]
            unequal += bases.setdefault(key, proof) != proof
    return unequal


def _drawn_otherwise(records: Iterable[Played]) -> int:
    """Count the pairs with another renderer than most; not those whose renderer is not recorded."""
    drawn = renderers(record.fingerprints for record in records)
    return drawn.total() - max(drawn.values(), default=0)


def caveat_text(caveat: Caveat) -> str:
    """Return a caveat as one paragraph, the number of pairs first."""
    return f"{caveat.pairs} of {counted(caveat.played, 'pair')}: {caveat.text}"
