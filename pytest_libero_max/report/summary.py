"""The terminal summary: a report as one compact section of plain lines."""

from __future__ import annotations

import math
from collections.abc import Sequence
from textwrap import wrap

from pytest_libero_max.benchmark.documents import Json


def summary_lines(report: Json, paths: Sequence[str] = ()) -> list[str]:
    """Render a report for the terminal.

    Args:
        report: What :func:`~pytest_libero_max.report.build.build_report` returned.
        paths: Files written, named at the end.

    Returns:
        Lines without line ends, at most 100 columns apart from names and paths longer than that.
    """
    pairs, overall = report["pairs"], report["overall"]
    lines = [] if pairs["complete"] else [incomplete_text(pairs)]
    lines.append(_header(report))
    lines += substrate_lines(report["substrate"])
    lines.append("")
    if pairs["played"] == 0:
        return [*lines, "No pair was played; there is nothing to report.", *_written(paths)]
    if not pairs["complete"]:
        lines.append(f"Over the {pairs['played']} played pairs only:")
    outcomes, change = overall["outcomes"], overall["paired_change"]
    lines += [
        f"{'Base success':<32}{rate_text(overall['base_success'])}",
        f"{'Dynamic success':<32}{rate_text(overall['dynamic_success'])}",
        f"{'Paired change':<32}{change_text(change)}   McNemar {p_text(overall['mcnemar'])}",
        f"{'Outcomes (Base, Dynamic)':<32}(1,1) {outcomes['preserved_success']}   "
        f"(0,1) {outcomes['change_associated_success']}   (1,0) {outcomes['regression']}   "
        f"(0,0) {outcomes['persistent_failure']}",
        f"{'Base successes lost':<32}{rate_text(overall['conditional_regression'])}   "
        f"retained {percent(overall['retained']['value'])}",
        f"{'Event fired / query after it':<32}{count_text(overall['trigger_coverage'])} / "
        f"{count_text(overall['response_coverage'])}   {_stale_text(overall['stale_actions'])}",
        *_noise_lines(report["noise_floor"]),
        "",
        _row("event", "pairs", "Base ", "Dynamic", "change", "95% interval", "lost"),
    ]
    lines += [_event_line(name, block) for name, block in report["by"]["event"].items()]
    if any(block["floor"] for block in report["by"]["event"].values()):
        lines.append("* Base success is too low to fall: a small change is no sign of robustness there.")
    return [*lines, *_caveat_lines(report["caveats"]), *_written(paths)]


def noise_text(noise: Json) -> str:
    """What playing Base twice showed."""
    return f"{rate_text(noise['flips'])} ended otherwise, {count_text(noise['identical'])} bit for bit alike"


def _caveat_lines(caveats: Sequence[Json]) -> list[str]:
    if not caveats:
        return []
    counts = ", ".join(f"{caveat['name'].replace('_', ' ')} {caveat['pairs']}" for caveat in caveats)
    return wrap(f"Pairs that are not what their names promise (see report.md): {counts}.", 100)


def _noise_lines(noise: Json | None) -> list[str]:
    return [] if noise is None else [f"{'Noise floor: Base played twice':<32}{noise_text(noise)}"]


def substrate_lines(substrate: Json) -> list[str]:
    """The warning that belongs wherever scores of a stand-in substrate are printed."""
    if substrate["scores_comparable_with_published"] is not False:
        return []
    return [f"Scores on the {substrate['name']} substrate are not comparable with published ones."]


def incomplete_text(pairs: Json) -> str:
    """The sentence a run with a missing or invalid pair begins with."""
    return (
        f"INCOMPLETE: {pairs['played']} of {pairs['planned']} planned pairs played, "
        f"{pairs['invalid']} invalid, {pairs['missing']} missing. No score."
    )


def _header(report: Json) -> str:
    pairs = report["pairs"]
    return f"{title_text(report)}: {pairs['played']} of {pairs['planned']} planned pairs played"


def title_text(report: Json) -> str:
    """What was measured: policy with H and Q, substrate, case set."""
    return f"{_policy(report)} on {report['substrate']['name']}, {report['provenance']['case_set']['name']}"


def _policy(report: Json) -> str:
    spec = report["policy"]
    if spec is None:
        return str(report["provenance"]["policy"]["reference"])
    privileged = ", privileged" if spec["privileged"] else ""
    return f"{spec['name']} (H={spec['horizon']} Q={spec['query_interval']}{privileged})"


def _event_line(name: str, block: Json) -> str:
    change, partial = block["paired_change"], block["played"] < block["planned"]
    return _row(
        name,
        f"{block['played']} of {block['planned']}" if partial else str(block["played"]),
        percent(block["base_success"]["value"]) + ("*" if block["floor"] else " "),
        percent(block["dynamic_success"]["value"]),
        points(change["value"]),
        interval_text(change, signed=True),
        count_text(block["conditional_regression"]),
    )


def _row(event: str, pairs: str, base: str, dynamic: str, change: str, interval: str, lost: str) -> str:
    return f"{event:<22} {pairs:>12} {base:>7} {dynamic:>8} {change:>8} {interval:>16} {lost:>9}"


def rate_text(rate: Json) -> str:
    """A rate with its interval and counts, for example ``75.0% [57.9, 86.7]  24/32``."""
    if rate["value"] is None:
        return f"n/a  {count_text(rate)}"
    return f"{percent(rate['value'])} {interval_text(rate)}  {count_text(rate)}"


def change_text(change: Json) -> str:
    """A paired change with its interval, for example ``-12.5 pp [-25.0, -3.1]``."""
    return f"{points(change['value'])} pp {interval_text(change, signed=True)}"


def interval_text(value: Json, signed: bool = False) -> str:
    """An interval in percent; says so where resampling could not vary."""
    if value["lower"] is None:
        return "n/a"
    if value.get("degenerate"):
        return "(all alike)"
    sign = "+" if signed else ""
    return f"[{100 * value['lower']:{sign}.1f}, {100 * value['upper']:{sign}.1f}]"


def percent(value: float | None) -> str:
    """A rate as a percentage with one decimal."""
    return "n/a" if value is None else f"{100 * value:.1f}%"


def points(value: float | None) -> str:
    """A difference of rates in percentage points, with its sign."""
    return "n/a" if value is None else f"{100 * value:+.1f}"


def count_text(ratio: Json) -> str:
    """A count over its denominator, for example ``3/8``."""
    return f"{ratio['count']}/{ratio['of']}"


def p_text(test: Json) -> str:
    """A p-value; below 0.001 from its logarithm, so that it is never printed as 0."""
    log10_p = test["log10_p_value"]
    return "n/a (no discordant pair)" if log10_p is None else f"p = {p_number(log10_p)}"


def p_number(log10_p: float) -> str:
    """A p-value from its decimal logarithm."""
    if log10_p >= -3:
        return f"{10**log10_p:.3f}"
    exponent = math.floor(log10_p)
    return f"{10 ** (log10_p - exponent):.1f}e{exponent}"


def _stale_text(stale: Json) -> str:
    if stale["pairs"] == 0:
        return "stale actions n/a"
    return f"stale actions mean {stale['mean']:.2f}, median {stale['median']:g}"


def _written(paths: Sequence[str]) -> list[str]:
    return [f"Written: {', '.join(paths)}"] if paths else []
