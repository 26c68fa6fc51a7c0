"""Limits of the numbers of every report, as statements."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from pytest_libero_max.benchmark.tracks import GENUINE, PAPER_LITE, track_names, unexamined_cases
from pytest_libero_max.errors import counted
from pytest_libero_max.report.published import authors_cases

CAVEATS_TITLE = "Notes on pairs"
"""Heading of the caveats of several runs."""

LIMITS_TITLE = "What these numbers do not show"
"""Heading of the statements."""

STATEMENTS: Mapping[str, str] = {
    "interval": "An interval shows how precisely these cases measure this policy. It does not cover "
    "how much the policy would differ if it were trained again.",
    "generalisation": "The interval of a paired change is for these tasks, played again with other "
    "initial states and seeds. The interval by task is for other tasks of the same kind; it needs 30 "
    "tasks, 15 of them with a changed pair.",
    "policies": "Policies differ in size, training data and serving at once. A difference between "
    "policies, or between families of policies, does not show which architecture or "
    "design is more robust.",
    "behaviour": "Success at the end of an episode and queries after the event are observable "
    "behaviour. They show sensitivity to the event, not whether the policy detected it or "
    "planned anew.",
    "simulation": "The benchmark covers simulated manipulation within LIBERO's visual, contact and task "
    "abstractions.",
    "one_event": "A case of the benchmark's tracks has one event, which lasts, and which comes before "
    "the grasp. Transfer to physical robots, to later stages of a task, and to repeated "
    "or reversible changes is not established.",
    "abrupt": "Some events are abrupt in the simulator. How natural they are, and whether they can "
    "be realised physically, needs an assessment of its own.",
    "studies": "The paper's control studies are narrow: three policies for the camera, one policy "
    "and one event for restored sensing.",
    "safety": "Completing a task does not imply a safe deployment. Forces and what was pushed or dropped are "
    "read by --libero-max-probe=safety alone, and in simulation.",
}
"""Sentences by a stable key. They hold for every run: a part of a track, any substrate, no played pair."""

_OF_INTERVALS = ("interval", "generalisation")

OWN_CASES = (
    "These are not the authors' cases, but others that the paper's rules choose from what is installed. "
    f"Published numbers are of theirs: --libero-max-track={PAPER_LITE} plays 800 of them, and "
    "--libero-max-manifest=libero_max_8000.json all."
)

_PAPER_CASES = f"track {GENUINE}/{PAPER_LITE}"

_DRAWN_LIKE_MAX = (f"track {GENUINE}/max", f"track {GENUINE}/lite")


def own_cases_text(case_set: str, suites: Sequence[str]) -> str | None:
    """Return the note that cases of a genuine track are not the authors'; None for theirs and others.

    Args:
        suites: The suite of each case; ``max`` and ``lite`` have other numbers of them than the authors' Max.
    """
    if not case_set.startswith(f"track {GENUINE}/") or case_set == _PAPER_CASES:
        return None
    if case_set not in _DRAWN_LIKE_MAX or not suites:
        return OWN_CASES
    theirs = authors_cases()
    counts = ", ".join(
        f"{suite} {suites.count(suite):,} and {theirs[suite]:,}" for suite in theirs if suite in suites
    )
    return f"{OWN_CASES} By suite, these {len(suites):,} and their {sum(theirs.values()):,}: {counts}."


def statements_of(case_set: str, cases: Collection[str], *, with_intervals: bool = True) -> dict[str, str]:
    """Return the sentences of a report, with what is known about the screening of its cases."""
    left_out = () if with_intervals else _OF_INTERVALS
    sentences = {key: text for key, text in STATEMENTS.items() if key not in left_out}
    return sentences | {"screening": _screening(case_set, cases)}


def _screening(case_set: str, cases: Collection[str]) -> str:
    people = "An audit of their feasibility by people is not complete."
    if case_set == _PAPER_CASES:
        return f"The authors screened these cases by program; this package did not screen them. {people}"
    kind, _, name = case_set.partition(" ")
    if kind != "track" or name.rpartition("/")[2] not in track_names():
        return "Nothing is known here about how the cases of this manifest were screened for feasibility."
    done = "screened by program for support, workspace, visibility and collisions"
    left_out = unexamined_cases(name) & set(cases)
    if not left_out:
        return f"The cases of the tracks were {done}. {people}"
    return (
        f"{len(cases) - len(left_out)} of {counted(len(cases), 'case')} were {done}. The other "
        f"{len(left_out)} need models that are in no package, and were not examined. {people}"
    )
