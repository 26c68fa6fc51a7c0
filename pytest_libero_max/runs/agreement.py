"""Checks that pairs belong to their run, and were all played with the same."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.structs import shown
from pytest_libero_max.errors import OtherRunError, ReportError
from pytest_libero_max.pairing.case_rules import require_of_case
from pytest_libero_max.pairing.record import FILES, PROGRAM, RESET_FILES, PairError, PairRecord
from pytest_libero_max.pairing.scene_fingerprints import SCENE, START
from pytest_libero_max.policies.files_read import CHANGED, WRITTEN
from pytest_libero_max.runs.plan import OUTSIDE, PlannedPair, Run
from pytest_libero_max.runs.protocol import declared, played_settings
from pytest_libero_max.runs.setting import ALWAYS
from pytest_libero_max.worlds.rendering.context import RENDERING

_IDENTITY = tuple(name for name in PlannedPair.__struct_fields__ if name in PairRecord.__struct_fields__)
"""Fields that a record has in common with the pair as it was planned."""

MACHINE = (*RENDERING, "blas")
"""Fingerprints in which pairs of one measurement may differ: the renderer, and the kind of processor."""

_PROCESSOR = "blas"
OF_CASE = (SCENE, START, PROGRAM)
"""Fingerprints in which the pairs of one run may differ, because they belong to the case."""

OF_MACHINE = (*MACHINE, "assets")
"""Fingerprints that say nothing of what was played; ``assets`` of published studies is a digest of code."""


class Agreement:
    """Checks that the pairs of a run are pairs of it: as planned, and all played with the same.

    Args:
        cases: The cases of its manifest by id, where that is at hand: records are compared with them.
    """

    def __init__(self, run: Run, cases: Mapping[str, Case] | None = None) -> None:
        self._cases = cases or {}
        self._planned = {pair.case_id: pair for pair in run.planned}
        self._measured: dict[str, str] = {}
        self._same_play = SamePlay()
        self._header = _Header.of(run.provenance)
        self._of_arms: dict[str, tuple[Json | None, str]] = {}

    def add(self, pair: PairRecord | PairError, where: str) -> None:
        """Take in the next pair.

        Raises:
            OtherRunError: It was played with another policy, other versions or another substrate.
            ReportError: It was not planned, or not as it says it is, or has been measured before.
        """
        planned = self._planned.get(pair.case_id)
        if planned is None:
            raise ReportError(
                f"case_id={shown(pair.case_id)} was played but not planned; a report keeps the planned "
                "denominator. Use the manifest of the run."
            )
        names = _IDENTITY if isinstance(pair, PairRecord) else ("item_id", "case_digest")
        for name in names:
            if getattr(pair, name) != getattr(planned, name):
                raise ReportError(
                    f"{name}={shown(getattr(pair, name))} of case_id={pair.case_id!r}, but planned was "
                    f"{shown(getattr(planned, name))}: another case was played. Play it again."
                )
        if pair.case_id in self._measured:
            raise ReportError(
                f"case_id={pair.case_id!r} was measured before ({self._measured[pair.case_id]}); a case "
                "counts once. Keep one of the records."
            )
        if isinstance(pair, PairRecord):
            if not self._measured:
                self._header.require(pair)
            if (case := self._cases.get(pair.case_id)) is not None:
                require_of_case(pair, case)
            self._same_play.add(pair)
            self._require_same_arms(pair)
            self._measured[pair.case_id] = where

    def _require_same_arms(self, pair: PairRecord) -> None:
        """Compare the policies that arms name with those of the pairs before."""
        for name, arm in pair.arms.items():
            if arm.shares is not None:  # nothing happened, so that no policy went on
                continue
            known, item_id = self._of_arms.setdefault(name, (arm.policy, pair.item_id))
            if known != arm.policy:
                raise OtherRunError(
                    f"Arm {name!r} of {pair.item_id!r} was played by the policy {shown(arm.policy)}, that of "
                    f"{item_id!r} by {shown(known)}. Compare runs instead of mixing them."
                )


class SamePlay:
    """Checks that pairs were played by one policy with the same instruments, and each scene as it was before.

    The digest of a scene is compared with that of the pairs of the same scene alone. Two kinds of processors
    may round what MuJoCo compiles differently, so only pairs of one kind are compared. The state in which a
    pair starts belongs to its case and is compared nowhere in a run.
    """

    def __init__(self) -> None:
        self._first: PairRecord | None = None
        self._files: dict[tuple[str, str], tuple[Json, str]] = {}
        self._scenes: dict[tuple[str, str | None], tuple[str, str]] = {}
        self._budgets: dict[str, tuple[int, str]] = {}

    def add(self, pair: PairRecord) -> None:
        """Take in the next pair.

        Raises:
            OtherRunError: It was played otherwise than those before; names every difference.
        """
        first = self._first or pair
        if first.policy != pair.policy or first.fingerprints != pair.fingerprints:
            different = [
                *policy_differences(first.policy, pair.policy),
                *differences("fingerprints", first.fingerprints, pair.fingerprints, (*MACHINE, *OF_CASE)),
            ]
            if different:
                raise OtherRunError(
                    f"{first.item_id!r} and {pair.item_id!r} were played with different things: "
                    f"{'; '.join(different)}. All pairs of a run are played by one policy with the same "
                    "instruments. Compare runs instead of mixing them."
                    + (f" {_OF_FILES}" if any(text.startswith(_FILE) for text in different) else "")
                )
        self._require_same_files(pair)
        self._require_same_scene(pair)
        self._require_same_budget(pair)
        self._first = first

    def _require_same_budget(self, pair: PairRecord) -> None:
        known, item_id = self._budgets.setdefault(pair.suite, (pair.max_steps, pair.item_id))
        if known != pair.max_steps:
            raise OtherRunError(
                f"max_steps={pair.max_steps} of {pair.item_id!r}, but {known} of {item_id!r}: the episodes "
                f"of a suite ({pair.suite}) have one budget. Play the run again, or compare the runs."
            )

    def _require_same_files(self, pair: PairRecord) -> None:
        """Compare files with those of all pairs before, where names agree: ``reset`` may read others."""
        for part in (FILES, RESET_FILES):
            for name, identity in (pair.policy.get(part) or {}).items():
                if WRITTEN in identity:
                    continue
                known, item_id = self._files.setdefault((part, name), (identity, pair.item_id))
                if not _is_same_file(known, identity):
                    raise OtherRunError(
                        f"{item_id!r} and {pair.item_id!r} were played with different things: "
                        f"{_file_text(name, known, identity)}. {_OF_FILES}"
                    )

    def _require_same_scene(self, pair: PairRecord) -> None:
        name, _, digest = pair.fingerprints.get(SCENE, "").rpartition(" ")
        if not name:
            return
        known, item_id = self._scenes.setdefault(
            (name, pair.fingerprints.get(_PROCESSOR)), (digest, pair.item_id)
        )
        if known != digest:
            raise OtherRunError(
                f"Scene {name} of {pair.item_id!r} is another one than that of {item_id!r} "
                f"(digests {digest[:12]}, {known[:12]}): its model, goal or control was changed in between. "
                "Play the run again, or play in another output folder and compare the runs."
            )


_FILE = "the policy's file "
_OF_FILES = (
    "A policy is its code and the files that loading it reads; where other files are the same policy, let it "
    "declare PolicySpec(revision=...)."
)


def policy_differences(first: Json, other: Json) -> list[str]:
    """Return in what two policies differ; empty where they are one, whose pairs a run, a report may mix."""
    if first == other:
        return []
    return [*differences("policy", first, other, (FILES, RESET_FILES)), *file_differences(first, other)]


def file_differences(first: Json, other: Json) -> list[str]:
    """Return the files in which two policies differ, of those that loading read.

    Records of earlier versions, and of policies with a revision, name none: then nothing is known to differ.
    Files that may be the policy's own work are not compared: those that one of the two has written, and those
    that have changed since the run began, unless the other has the file from before.
    """
    return [
        _file_text(name, first[FILES].get(name), other[FILES].get(name))
        for name in differing_files(FILES, first, other)
    ]


def differing_files(part: str, first: Json, other: Json) -> list[str]:
    """Return the names of the files in which two policies differ, see :func:`file_differences`.

    Args:
        part: :data:`.FILES`, or :data:`.RESET_FILES`, of which only those that both have read are compared.
    """
    one, two = first.get(part), other.get(part)
    if one is None or two is None:
        return []
    names = {*one, *two} if part == FILES else {*one} & {*two}
    return [name for name in sorted(names) if not _is_same_file(one.get(name), two.get(name))]


def _is_same_file(one: Json | None, other: Json | None) -> bool:
    read = [identity for identity in (one, other) if identity is not None]
    if any(WRITTEN in identity for identity in read) or all(CHANGED in identity for identity in read):
        return True
    contents = [{key: identity[key] for key in identity if key != CHANGED} for identity in read]
    return len(contents) == 2 and contents[0] == contents[1]


def _file_text(name: str, one: Json | None, other: Json | None) -> str:
    return f"{_FILE}{name!r}: {identity_text(one)}, {identity_text(other)}"


def identity_text(identity: Json | None) -> str:
    """Return the identity of a file for messages: the beginning of its digest, and its size."""
    if identity is None:
        return "not read"
    parts = [
        f"{key} {str(value)[:12] if 'sha256' in key or key == 'blob' else value}"
        for key, value in sorted(identity.items())
    ]
    return " ".join(parts)


@dataclass(frozen=True)
class _Header:
    """What the records of a run have to say, by its first line."""

    wanted: Mapping[tuple[str, str], Any]
    """Contents by part of a record and field."""
    exact: frozenset[tuple[str, str]]
    """Those that have to be in a record where they are in the header, and nowhere else."""

    @classmethod
    def of(cls, provenance: Json) -> _Header:
        asked, known = provenance["policy"], declared("policy")
        hidden = {name for field in known if asked.get(field) is not None for name in known[field].hides}
        of_spec = [name for name, field in known.items() if field.as_played and name not in hidden]
        # A loop of others declares itself what is around its policy.
        always = [
            name for name in of_spec if known[name].usual is not ALWAYS and asked.get("code") != OUTSIDE
        ]
        by_option = [name for name, field in declared("protocol").items() if field.in_fingerprints]
        settings = played_settings(provenance["protocol"])
        exact = {name: settings.get(name) for name in (*by_option, *settings)}
        seen = {"adapter": asked.get("code"), "substrate": provenance["substrate"]["name"]}
        fingerprints = {**seen, **exact, **provenance["versions"]}
        return cls(
            {
                **{("policy", name): asked.get(name) for name in (*always, *of_spec)},
                **{("fingerprints", name): value for name, value in fingerprints.items()},
            },
            frozenset({("policy", name) for name in always} | {("fingerprints", name) for name in exact}),
        )

    def require(self, record: PairRecord) -> None:
        """Check that a record agrees."""
        for (part, name), wanted in self.wanted.items():
            as_played = declared("policy")[name].as_played if part == "policy" else None
            recorded = as_played(record.policy, wanted) if as_played else getattr(record, part).get(name)
            if recorded != wanted and ((part, name) in self.exact or None not in (recorded, wanted)):
                raise OtherRunError(
                    f"{record.item_id!r} was played with {part}.{name}={shown(recorded)}, but the first line "
                    f"of its run says {shown(wanted)}. Play it again."
                )


def differences(part: str, one: Json, other: Json, ignored: Sequence[str] = ()) -> list[str]:
    """Return the fields in which two objects differ, with both values; a missing field counts.

    Args:
        ignored: Fields that may differ, by name or as ``part.name``.
    """
    return [
        f"{part}.{name}: {shown(one.get(name))}, {shown(other.get(name))}"
        for name in sorted({*one, *other})
        if one.get(name) != other.get(name) and name not in ignored and f"{part}.{name}" not in ignored
    ]
