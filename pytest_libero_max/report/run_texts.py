"""Sentences about a run: its policy, its cases, and what is to be known of its pairs beside the numbers."""

from __future__ import annotations

from textwrap import wrap

from pytest_libero_max.report.caveats import caveat_text
from pytest_libero_max.report.connection import connection_texts
from pytest_libero_max.report.formats import count_text, counted, percent, points
from pytest_libero_max.report.measurable import warning_of
from pytest_libero_max.report.report_document import PairCounts, Report, Returned
from pytest_libero_max.report.sections import section_warnings
from pytest_libero_max.runs.protocol import protocol_words
from pytest_libero_max.stats.blocks import Substrate
from pytest_libero_max.substrates.registry import described_substrate

_NAMED = 3

GIVEN_RESPONSE_NOTE = (
    "The rollout itself decides whether a query follows the event. These results describe the pairs that "
    "have such a query; they do not replace the results over all pairs."
)


def clipping_text(report: Report) -> str | None:
    """Return the warning about actions outside [-1, 1]; None where there were none."""
    clipped = report.clipped_actions
    if clipped is None or clipped.pairs == 0:
        return None
    return (
        f"Actions outside [-1, 1] in {clipped.pairs} of {counted(report.pairs.played, 'pair')}, up to "
        f"{clipped.largest_share:.1%} of the components of a rollout: they were clipped. Check the units and "
        "the normalisation of the adapter's actions."
    )


def alarm_texts(report: Report) -> list[str]:
    """Return what has to be known before any number: lacking pairs, and what the others cannot show."""
    pairs = report.pairs
    incomplete = None
    if not pairs.complete:
        incomplete = f"{incomplete_text(pairs)} All rates are over the played pairs."
    alarms = [incomplete, unsupported_text(pairs), warning_of(report.overall), *section_warnings(report)]
    return [text for text in alarms if text]


def note_texts(report: Report) -> list[str]:
    """Return the other notes of files on the pairs of a run."""
    pairs = report.pairs
    notes = [
        *stopped_texts(pairs),
        *connection_texts(report),
        missing_text(report),
        repaired_text(pairs),
        *map(caveat_text, report.caveats),
    ]
    return [text for text in notes if text]


def substrate_lines(substrate: Substrate) -> list[str]:
    """Return what belongs wherever scores are printed: of a stand-in substrate, or of other cases."""
    if substrate.scores_comparable_with_published is not False:
        return wrap(substrate.note or "", 100)
    return [f"Scores on {substrate.name} scenes are not comparable with published ones."]


def incomplete_text(pairs: PairCounts) -> str:
    """First sentence of a run that lacks a planned pair: incomplete, or stopped by the rule it declared."""
    stopped = pairs.stopped
    if stopped is not None and stopped.rule is not None:
        invalid = f", {pairs.invalid} invalid" if pairs.invalid else ""
        return (
            f"STOPPED by rule {stopped.rule} at pair {stopped.at} of {stopped.of}: {stopped.reason}. "
            f"{pairs.played} of {pairs.planned} planned pairs played{invalid}. No score."
        )
    shards = "".join(f", shard {shard} not among the merged runs" for shard in pairs.missing_shards)
    return (
        f"INCOMPLETE: {pairs.played} of {pairs.planned} planned pairs played, "
        f"{pairs.invalid} invalid, {pairs.missing} missing{shards}. No score."
        + ("" if stopped is None else f" Stopped: {stopped.reason}.")
    )


def stopped_texts(pairs: PairCounts) -> list[str]:
    """Return what the rule that stopped a run knows, and what it does to numbers; empty for other runs."""
    stopped = pairs.stopped
    if stopped is None or stopped.rule is None:
        return []
    return [
        *(watched.text for watched in stopped.watched),
        "Rates and changes have no 95% intervals and no p-value: these need a number of pairs that is fixed "
        "before the run.",
        *([] if stopped.bias is None else [stopped.bias]),
    ]


def title_text(report: Report) -> str:
    """Return :func:`policy_title` and :func:`cases_title` on one line."""
    return f"{policy_title(report)} on {cases_title(report)}"


def cases_title(report: Report) -> str:
    """Return substrate, case set, and what is unusual in the protocol on one line."""
    count = report.pairs.unsupported
    unsupported = f", {count} of them unsupported" if count else ""
    words = protocol_words(report.provenance["protocol"])
    words.pop("study", None)  # the report has a section on it
    substrate = described_substrate(report.provenance["substrate"])
    return ", ".join([str(substrate), f"{selection_text(report)}{unsupported}", *words.values()])


def unsupported_text(pairs: PairCounts) -> str | None:
    """Return a note on unsupported pairs; None where there are none."""
    if not pairs.unsupported:
        return None
    return (
        f"PARTIAL: the policy does not support {', '.join(pairs.unsupported_suites)}. Its "
        f"{counted(pairs.unsupported, 'pair')} there count neither as played nor as failed. Partial runs are "
        "not ranked with whole runs."
    )


def missing_text(report: Report) -> str | None:
    """Return the rates that count missing pairs as failures; None where there are none."""
    rates = report.missing_as_failures
    if rates is None:
        return None
    return (
        f"If {counted(rates.without_result, 'pair')} without a result counted as failures of both arms, as "
        f"in the paper: Base {percent(rates.base_success.value)} ({count_text(rates.base_success)}), Dynamic "
        f"{percent(rates.dynamic_success.value)} ({count_text(rates.dynamic_success)}), change "
        f"{points(rates.paired_change.value)} pp. Not a score."
    )


def repaired_text(pairs: PairCounts) -> str | None:
    """Return a note on pairs that were measured only when played again; None where there are none."""
    names = pairs.repaired_pairs
    if not names:
        return None
    more = f", and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    named = f"{', '.join(names[:_NAMED])}{more}"
    return f"Measured when played again after an error: {counted(len(names), 'pair')} ({named})."


def selection_text(report: Report) -> str:
    """Return the part of the case set: ``24 of 800 cases of track lite (selection: -k camera_shift)``."""
    if report.selection is not None:
        return report.selection.text
    name = report.provenance["case_set"]["name"]
    return f"{counted(report.pairs.planned, 'case')} of {name} (selection not recorded)"


def policy_title(report: Report) -> str:
    """Return the policy with its chunks, and what else is to be known of it, on one line."""
    spec = report.policy
    if spec is None:
        return str(report.provenance["policy"]["reference"])
    privileged = ", privileged" if spec["privileged"] else ""
    control = f", {spec['control']} control" if "control" in spec else ""
    wrappers = "".join(f", {words}" for words in spec.get("wrappers", ()))
    wrappers += "" if spec.get("repeatable", True) else ", not repeatable"
    returned = returned_text(report.returned, spec["horizon"])
    cadence = f"{counted(spec['horizon'], 'action')}{returned} per query, {spec['query_interval']} executed"
    return f"{spec['name']} ({cadence}{privileged}{control}{wrappers})"


def returned_text(returned: Returned | None, horizon: int) -> str:
    """Return a note on servers that return other numbers of actions than H; empty where they return H."""
    if returned is None or (returned.least, returned.most) == (horizon, horizon):
        return ""
    span = f"{returned.least}" if returned.least == returned.most else f"{returned.least} to {returned.most}"
    return f" of {span} returned"
