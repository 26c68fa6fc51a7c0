"""Pairs that Base fails, that broke and that were gained: by cause and event, a part of them by name."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from textwrap import wrap
from typing import Literal, NamedTuple
from urllib.parse import quote

from pytest_libero_max.benchmark.documents import printable
from pytest_libero_max.events.registry import EVENTS
from pytest_libero_max.events.schedules import BASE
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.diagnosis import CAUSES, NOT_RECORDED, diagnose
from pytest_libero_max.report.document import Code, Link, Section, Table
from pytest_libero_max.report.formats import counted
from pytest_libero_max.report.report_document import BaseFailures, ChangedPair, Report
from pytest_libero_max.runs.replay_command import film_text, replay_of, traces_setting
from pytest_libero_max.stats.blocks import FLOOR_BASE_RATE

TITLE = "What broke"
GAINED_TITLE = "What was gained"

MOST_NAMED = 20
"""Number of pairs that a table names."""

_MOST_GROUPS, _MOST_OF_GROUPS = 6, 14
"""Number of groups that the terminal shows, and of pairs that it names of them: together twenty lines."""

NO_CAUSES = "These records hold no causes: an earlier version wrote them."

Outcome = Literal["regression", "change_associated_success"]

LETTERS: Mapping[Outcome, str] = {"regression": "R", "change_associated_success": "G"}
"""Letters of the outcomes, as progress shows them; ``B`` is a failure in Base."""


class Named(NamedTuple):
    """A pair to name."""

    item_id: str
    sentence: str


class Group(NamedTuple):
    """Pairs of one cause under one event."""

    cause: str
    event: str
    """The event; empty for failures in Base, which are of all events."""
    what: str
    """The event, with the programs that were played in its place; ``in Base``."""
    number: int
    named: Sequence[Named]
    """Those to name, the first ones."""


class Part(NamedTuple):
    """The pairs of an outcome."""

    outcome: str
    letter: str
    title: str
    """Heading: their number and that of all that could be."""
    note: str
    """What to do next; empty for nothing."""
    groups: Sequence[Group]

    @property
    def has_causes(self) -> bool:
        """True if the cause of a pair was recorded."""
        return any(group.cause for group in self.groups)

    @property
    def more(self) -> int:
        return sum(group.number - len(group.named) for group in self.groups)


def parts_of(
    report: Report, films: Collection[str] = (), most: int = MOST_NAMED, most_groups: int = MOST_NAMED
) -> list[Part]:
    """Return what Base fails at where it solves little, then the pairs that were lost and that were gained.

    Nothing is said of an outcome without pairs.

    Args:
        films: Item ids of the pairs with a film; of a cause of Base, one with a film is named.
    """
    parts = []
    if base := known_failures(report):
        groups = [_in_base(group, films, named=place < most_groups) for place, group in enumerate(base)]
        title = base_title(report)
        parts.append(Part("persistent_failure", "B", title, next_step(report), groups))
    for outcome, letter in LETTERS.items():
        if groups := groups_of(report.changed_pairs, outcome, most, most_groups):
            parts.append(Part(outcome, letter, title_of(report, outcome), "", groups))
    return parts


def _in_base(group: BaseFailures, films: Collection[str], *, named: bool) -> Group:
    item = next((item for item in group.item_ids if item in films), group.item_ids[0])
    sentence = group.sentence if item == group.item_ids[0] else ""
    cause = "" if group.cause == NOT_RECORDED else group.cause
    return Group(cause, "", "in Base", group.pairs, [Named(item, sentence)] if named else [])


def groups_of(
    pairs: Iterable[ChangedPair], outcome: Outcome, most: int = MOST_NAMED, most_groups: int = MOST_NAMED
) -> list[Group]:
    """Return the pairs of an outcome by cause and event, large groups first.

    Args:
        most: Number of pairs to name: one of each group, then a second one of each, and so on.
    """
    found: dict[tuple[str, str], list[ChangedPair]] = {}
    for pair in pairs:
        if pair.outcome == outcome:
            found.setdefault((pair.cause, pair.event), []).append(pair)
    order = sorted(
        found, key=lambda key: (-len(found[key]), _rank(key[0], CAUSES), _rank(key[1], EVENTS), key)
    )
    shown = order[:most_groups]
    turns = [(turn, place) for place, key in enumerate(shown) for turn in range(len(found[key]))]
    named = Counter(place for _, place in sorted(turns)[:most])
    groups = []
    for place, (cause, event) in enumerate(order):
        known, members = cause != NOT_RECORDED, found[cause, event]
        programs = ", ".join(sorted({pair.program for pair in members} - {""}))
        groups.append(
            Group(
                cause if known else "",
                event,
                f"{event} (program {programs})" if programs else event,
                len(members),
                [Named(pair.item_id, pair.sentence if known else "") for pair in members[: named[place]]],
            )
        )
    return groups


def named_of(pairs: Sequence[ChangedPair], most: int) -> list[str]:
    """Return the item ids of so many pairs of each outcome, one of each cause and event first."""
    return [
        pair.item_id
        for outcome in LETTERS
        for group in groups_of(pairs, outcome, most, most)
        for pair in group.named
    ]


def to_look_at(report: Report, most: int) -> list[str]:
    """Return the item ids of the pairs that a summary names: failures in Base, then the changed pairs."""
    failed = [group.item_ids[0] for group in known_failures(report)]
    return list(dict.fromkeys([*failed, *named_of(report.changed_pairs, most)]))


def _rank(name: str, names: Iterable[str]) -> int:
    known = [*names]
    return known.index(name) if name in known else len(known)


def count_of(report: Report, outcome: Outcome) -> int:
    """Return the number of pairs of an outcome."""
    return sum(pair.outcome == outcome for pair in report.changed_pairs)


def without_causes(report: Report) -> bool:
    """Return True if outcomes changed and no record says why."""
    causes = {pair.cause for pair in report.changed_pairs}
    return causes == {NOT_RECORDED}


def title_of(report: Report, outcome: Outcome) -> str:
    """Return the heading of the pairs of an outcome: their number and that of all that could be."""
    number = count_of(report, outcome)
    lost = report.overall.conditional_regression
    if outcome == "regression":
        return f"{TITLE}: {number} of {lost.of} Base successes lost"
    return f"{GAINED_TITLE}: {number} of {report.overall.played - lost.of} Base failures solved"


def broken_sections(report: Report, films: Mapping[str, str]) -> list[Section]:
    """Return the pairs as tables."""
    sections = []
    for part in parts_of(report, films):
        why = ["Cause (pairs)", "What happened"] if part.has_causes else ["Pairs like it"]
        head = ["", "Pair", "Event", *why, *(["Film"] if films else [])]
        rows = []
        for group in part.groups:
            cause = f"{group.cause} ({group.number})".strip()
            for pair in group.named:
                film = Link("film", quote(films[pair.item_id])) if pair.item_id in films else ""
                reason = [cause, pair.sentence] if part.has_causes else [str(group.number)]
                rows.append(
                    [part.letter, Code(pair.item_id), group.what, *reason, *([film] if films else [])]
                )
        texts = (
            [f"report.html and `changed_pairs` of report.json have {part.more} more."] if part.more else []
        )
        sections.append(Section(part.title, [Table("", head, rows)], texts, lead=part.note))
    if sections and without_causes(report):
        sections.append(Section(texts=[NO_CAUSES]))
    return sections


def broken_lines(
    report: Report, films: Mapping[str, str] | None = None, show: str | None = None
) -> list[str]:
    """Return the lines for the terminal: Base where it solves little, then outcomes that changed, if any."""
    films, lines = films or {}, []
    for part in parts_of(report, films, _MOST_OF_GROUPS, _MOST_GROUPS):
        lines += ["", part.title, *wrap(part.note, 100, break_on_hyphens=False)]
        for group in part.groups:
            if not group.named:
                continue
            sentence = group.named[0].sentence
            first = ": " if group.number == 1 else "; the first: "
            words = [group.cause, group.what if group.event or not group.cause else ""]
            what = ", ".join(filter(None, words))
            head = f"{group.number} x {what}{first + sentence if sentence else ''}"
            lines += wrap(head, 100, subsequent_indent="    ", break_on_hyphens=False)
            for pair in group.named:
                filmed = "  filmed" if pair.item_id in films else ""
                lines.append(f"{part.letter}   {printable(pair.item_id)}{filmed}")
        if part.more:
            by = "outcome and cause" if part.has_causes else "outcome"
            lines.append(f"The table of cases of report.html has {part.more} more, by {by}.")
    lines += [NO_CAUSES] if without_causes(report) else []
    if lines and films:
        home = Path(next(iter(films.values()))).parent
        lines.append(f"Films: {home}; libero-max view {home.parent} shows them beside their cases.")
    elif lines:
        lines.append(_to_see(report) if show is None else f"To see them: {show}, which films them first.")
    return lines


def _to_see(report: Report) -> str:
    """Return how to see the first pair that is named of a run that has kept nothing to show."""
    replay = replay_of(report.provenance)
    if not replay:
        return f"To see one: libero-max film RUN NAME, of a run with {traces_setting(report.provenance)}."
    return f"To see the first: {film_text(replay, to_look_at(report, 1)[0])}"


def broken_line(report: Report) -> str:
    """Return all of it in one line, for quiet runs."""
    lost, gained = (count_of(report, outcome) for outcome in LETTERS)
    causes = Counter(pair.cause for pair in report.changed_pairs if pair.outcome == "regression")
    known = {} if without_causes(report) else dict(causes.most_common())
    words = ", ".join(f"{cause} {number}" for cause, number in known.items())
    if not lost and not gained and known_failures(report):
        return next_step(report)
    return f"{TITLE}: {lost} lost{f' ({words})' if words else ''}, {gained} gained"


def colour_of(line: str) -> Literal["red", "green"] | None:
    """Return the colour of a line: red for what was lost or failed, green for what was gained."""
    if line.startswith(("R   ", "B   ", "gate FAIL", "gate open")):
        return "red"
    return "green" if line.startswith("G   ") else None


def coloured(lines: Sequence[str], colours: bool) -> str:
    """Return lines as one text, with ANSI colours where these are wanted."""
    codes = {"red": "31", "green": "32"}
    marked = [(printable(line), colour_of(line)) for line in lines]
    return "\n".join(
        f"\x1b[{codes[colour]}m{line}\x1b[0m" if colours and colour else line for line, colour in marked
    )


_MOST_OF_BASE = 20


class Advice(NamedTuple):
    """What failures of Base look like, what they most often mean, and which causes belong to it."""

    sight: str
    meaning: str
    """What it most often means, and what to look at."""
    causes: tuple[str, ...]


ADVICE = (
    Advice(
        "the hand does not come near the right object",
        "Images are turned the wrong way, or cameras exchanged: look at the film of what the policy saw",
        ("never_reached", "wrong_object", "blocked_by_obstacle", "stuck"),
    ),
    Advice(
        "the hand arrives and does not hold",
        "The gripper has the wrong sign or range; beside the object: actions are un-normalised wrongly, or "
        "the state has another form",
        (
            "never_closed",
            "closed_early",
            "grasp_missed",
            "grasp_slipped",
            "dropped",
            "toppled_target",
            "pushed_target",
            "part_not_moved",
        ),
    ),
    Advice(
        "the hand hardly moves, or stops moving",
        "Actions are in other units, or an old answer is returned: run `libero-max check` on the adapter",
        ("not_attempted", "froze", "timed_out"),
    ),
    Advice(
        "the hand takes the objects and does not finish",
        "Q, the form of the state or the size of the images differ from the model's own evaluation, or the "
        "model does not know these scenes",
        (
            "timed_out_holding",
            "placed_beside_goal",
            "placed_elsewhere",
            "moved_goal",
            "undone",
            "part_moved_too_little",
        ),
    ),
)
"""The table of `AGENTS.md`. A cause belongs to one row at most; the others say nothing about an adapter."""

_COMPARE = (
    "Look at a film of one. If the policy solves more in its own evaluation, compare the adapter with that: "
    "images, state, gripper, Q. Otherwise play more pairs."
)
"""Next step where Base solves less than half, and more than a wrong adapter does."""

_UNSEEN = "A model that has never seen these scenes may fail there with a right adapter."


def base_failures(records: Sequence[PairRecord]) -> list[BaseFailures]:
    """Return the failures of Base by cause, the most frequent first; none where Base solves half or more."""
    failed = [record for record in records if BASE in record.arms and not record.base_success]
    if 2 * len(failed) <= len(records):
        return []
    by_cause: dict[str, list[tuple[str, str]]] = {}
    for record in sorted(failed, key=lambda record: record.item_id):
        why = diagnose(record, BASE)
        assert why is not None
        by_cause.setdefault(why.cause, []).append((record.item_id, why.sentence))
    order = sorted(by_cause, key=lambda cause: (-len(by_cause[cause]), [*CAUSES].index(cause)))
    return [
        BaseFailures(
            cause=cause,
            pairs=len(by_cause[cause]),
            item_ids=[item for item, _ in by_cause[cause][:_MOST_OF_BASE]],
            sentence=by_cause[cause][0][1],
        )
        for cause in order
    ]


def known_failures(report: Report) -> list[BaseFailures]:
    """Return the failures of Base to show; none where no record says why."""
    causes = {group.cause for group in report.base_failures}
    return [] if causes <= {NOT_RECORDED} else report.base_failures


def base_title(report: Report) -> str:
    """Return the heading: the number of failures and of pairs."""
    return f"{TITLE} in Base: {_failed(report.base_failures)} of {counted(report.overall.played, 'pair')}"


def next_step(report: Report) -> str:
    """Return what low Base success means, and what to do first."""
    groups, played = report.base_failures, report.overall.played
    failed = _failed(groups)
    solved = played - failed
    # Below the floor a warning says that little or nothing can be lost.
    low = solved < FLOOR_BASE_RATE * played
    text = (
        "" if low else f"Base solves {solved} of {counted(played, 'pair')}, so events have little to break."
    )
    advice, number = _most(groups)
    sight = f"in {number} of {failed} failures {advice.sight}" if advice is not None else ""
    own = report.substrate.scores_comparable_with_published is False  # no model was trained on its scenes
    unseen = f" {_UNSEEN}" if own and not (report.policy or {}).get("privileged") else ""
    if not low:  # an adapter that is wrong solves less
        text = f"{text} {sight.capitalize()}." if sight else text
        return f"{text} {_COMPARE}{unseen}"
    if advice is None:
        return "Fix Base first: look at a film of it."
    return f"Fix Base first: {sight}. {advice.meaning}.{unseen}"


def _failed(groups: Iterable[BaseFailures]) -> int:
    return sum(group.pairs for group in groups)


def _most(groups: Sequence[BaseFailures]) -> tuple[Advice | None, int]:
    """Return the row of the table that most failures belong to, with their number."""
    numbers = [_failed(group for group in groups if group.cause in advice.causes) for advice in ADVICE]
    most = max(numbers)
    return (ADVICE[numbers.index(most)], most) if most else (None, 0)
