"""The part of a case set that a run plays, and the options that selected it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import reduce
from typing import Any

from msgspec import Struct

from pytest_libero_max.benchmark.documents import Json, canonical_digest
from pytest_libero_max.benchmark.structs import Count, Flag, Positive, Texts, checked, to_builtins
from pytest_libero_max.errors import ReportError, counted


class Shards(Struct, frozen=True, forbid_unknown_fields=True):
    """Parts of a divided case set that are here."""

    of: Positive
    present: tuple[Positive, ...]
    """The numbers of those that are here, from 1, sorted."""

    @property
    def missing(self) -> tuple[int, ...]:
        """The numbers of those that are not here."""
        return tuple(number for number in range(1, self.of + 1) if number not in self.present)


class Selection(Struct, frozen=True, forbid_unknown_fields=True):
    """The part of its case set that a run plays."""

    asked: Texts
    """User's selection, as the command line spells it, for example ``-k camera_shift``. Where runs of
    different selections were merged: one entry for each, in brackets."""
    chosen: Count
    """Number of cases that the run plays."""
    of: Count
    """Number of cases of the whole track or manifest."""
    digest: str
    """SHA-256 of the sorted ids of the chosen cases, hexadecimal."""
    shards: Shards | None
    """Shards that are here; None where the cases were not divided, or where all shards are here."""
    merged: Flag
    """True if this is several runs joined, so that a shard that is not here is missing."""

    @classmethod
    def choose(
        cls, case_ids: Iterable[str], of: int, asked: Sequence[str], shard: tuple[int, int] | None = None
    ) -> Selection:
        """Return the selection of some cases."""
        ids = sorted(case_ids)
        shards = None if shard is None or shard[1] == 1 else Shards(shard[1], (shard[0],))
        return cls(tuple(asked), len(ids), of, canonical_digest(ids), shards, merged=False)

    @property
    def whole(self) -> bool:
        """True if these are all cases of the track or manifest."""
        return self.chosen == self.of

    @property
    def missing_shards(self) -> tuple[int, ...]:
        """Shards that a merge lacks. The run of a single shard lacks none."""
        return self.shards.missing if self.shards is not None and self.merged else ()

    def require(self, case_ids: Iterable[str]) -> None:
        """Check that these are the chosen cases, or raise ReportError."""
        ids = sorted(case_ids)
        if len(ids) != self.chosen or canonical_digest(ids) != self.digest:
            raise ReportError(
                f"selection: {self.chosen} of {counted(self.of, 'case')} are chosen, but the run has "
                f"{counted(len(ids), 'planned pair')}: others, or another number. The line is damaged."
            )

    def text(self, case_set: str) -> str:
        """Return a text such as ``24 of 800 cases of track lite (selection: -k camera_shift)``."""
        if self.whole:
            return f"{case_set}, all {counted(self.of, 'case')}"
        asked = list(self.asked)
        if self.shards is not None:
            present = ", ".join(map(str, self.shards.present))
            plural = "s" if len(self.shards.present) > 1 else ""
            asked.append(f"shard{plural} {present} of {self.shards.of}")
        words = ", ".join(asked) or "by another plugin or a conftest.py"
        return f"{self.chosen} of {counted(self.of, 'case')} of {case_set} (selection: {words})"

    def to_dict(self) -> Json:
        return to_builtins(self)

    @classmethod
    def from_dict(cls, values: Any) -> Selection:
        """Read what :meth:`to_dict` wrote, or raise ReportError."""
        selection: Selection = checked(values, cls, "selection", ReportError)
        if selection.chosen > selection.of:
            raise ReportError.seen("selection", values, f", but of {counted(selection.of, 'case')}.")
        return selection


def merged_selection(selections: Sequence[Selection], case_ids: Iterable[str]) -> Selection:
    """Return the selection of several runs of one case set together, or raise ReportError."""
    first = selections[0]
    for other in selections:
        if other.of != first.of:
            raise ReportError(
                f"One run knows {counted(first.of, 'case')} of its track or manifest, another {other.of}: "
                "they are not pieces of one measurement. Compare them instead."
            )
    asked = sorted({other.asked for other in selections})
    if len(asked) > 1 and any(other.shards is not None for other in selections):
        raise ReportError(
            f"The runs are shards of different selections ({', '.join(map(_bracketed, asked))}), so what is "
            "missing is not known. Merge the shards of each selection first."
        )
    ids = sorted(set(case_ids))
    return Selection(
        asked=asked[0] if len(asked) == 1 else tuple(map(_bracketed, asked)),
        chosen=len(ids),
        of=first.of,
        digest=canonical_digest(ids),
        shards=reduce(_joined, (other.shards for other in selections)),
        merged=True,
    )


def _bracketed(options: Sequence[str]) -> str:
    return f"({', '.join(options) or 'all cases'})"


def _joined(one: Shards | None, other: Shards | None) -> Shards | None:
    """Return the shards of both; None where none is missing."""
    if one is None or other is None:
        return None
    if one.of != other.of:
        raise ReportError(
            f"One run is a shard of {one.of}, another of {other.of}: shards of different divisions cannot be "
            "joined. Give the shards of one division."
        )
    joined = Shards(one.of, tuple(sorted({*one.present, *other.present})))
    return joined if joined.missing else None
