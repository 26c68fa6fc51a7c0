"""``libero-max lab claim``: whether a published difference of two success rates is more than chance."""

from __future__ import annotations

import argparse
import csv
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.cli.arguments import Commands, option
from pytest_libero_max.cli.terminal import say
from pytest_libero_max.errors import OptionError, counted
from pytest_libero_max.stats.ratios import Ratio

if TYPE_CHECKING:
    from pytest_libero_max.stats.intervals import Interval

_COUNT = re.compile(r"(\d+)/(\d+)")
_SHARE = re.compile(r"(\d+(?:\.\d+)?)%(?:/(\d+))?")
_LEVEL, _POWER = 0.05, 0.8
_COLUMNS = ("claim", "first", "second", "n", "only_first", "only_second")
_REQUIRED = ("first", "second")


def add_command(commands: Commands) -> None:
    """Add ``claim`` to the parser."""
    claim = commands.add_parser(
        "claim",
        help="Judge published differences of two success rates: interval, p-value, episodes that they need",
        description="RESULT is 78/100, or 78%/100, or 78% with --n=100. A percentage that no number of "
        "successes gives is refused. Two policies are taken to have played independent episodes (Fisher's "
        "exact test and the melded exact interval). Where both played the same cases, and it is known in how "
        "many only one of them succeeded, --only-first and --only-second make it a paired comparison (exact "
        "McNemar test), which needs fewer. Episodes of one task resemble each other, which neither test "
        "knows: for tasks beside those played, a difference is less certain than printed. With --csv the "
        "p-values of a table are adjusted for their number (Holm).",
    )
    claim.add_argument(
        "results", nargs="*", metavar="RESULT", help="Two results; a word `vs` between them is ignored"
    )
    option(claim, "--n N", "Number of episodes of a percentage without one", type=int)
    option(claim, "--only-first N", "Cases in which only the first succeeded", type=int)
    option(claim, "--only-second N", "Cases in which only the second succeeded", type=int)
    option(
        claim,
        "--csv FILE",
        "Judge the rows of a table with the columns first and second, and optionally claim (a name), n, "
        "only_first and only_second",
        type=Path,
    )
    option(claim, "--output FILE", "Also write the verdicts here, as CSV", type=Path)
    claim.set_defaults(run=_claim)


@dataclass(frozen=True)
class Claim:
    """A claim that the first of two policies succeeds more often, or less often, than the second.

    Attributes:
        name: Its name; empty for none.
        discordant: Cases in which only the first, and in which only the second succeeded; None where they are
            not known.
    """

    name: str
    first: Ratio
    second: Ratio
    discordant: tuple[int, int] | None


@dataclass(frozen=True)
class Verdict:
    """What is known of a claim.

    Attributes:
        change: Success of the first less that of the second.
        interval: Its exact 95% interval.
        log10_p: Decimal logarithm of the p-value.
        from_n: Episodes each (or pairs) from which these rates would be significant; None above a million.
        powered_n: About how many show such a difference with a probability of 80%; None likewise.
    """

    claim: Claim
    change: float
    interval: Interval
    log10_p: float
    from_n: int | None
    powered_n: int | None


def _claim(options: argparse.Namespace) -> None:
    from pytest_libero_max.stats.significance import holm

    if options.csv and (options.results or options.n or options.only_first or options.only_second):
        raise OptionError(
            "--csv has its results in the table. Leave out RESULT, --n, --only-first, --only-second."
        )
    claims = _from_table(options.csv) if options.csv else [_from_words(options)]
    verdicts = [judge(claim) for claim in claims]
    adjusted = [p or 0.0 for p in holm([verdict.log10_p for verdict in verdicts])]
    many = len(verdicts) > 1
    lines = [line for pair in zip(verdicts, adjusted, strict=True) for line in _lines(*pair, many=many)]
    if many:
        shown = sum(10**p < _LEVEL for p in adjusted)
        lines.append(
            f"Shown: {shown} of {counted(len(verdicts), 'difference')}, at 5% for all of them together "
            "(Holm)."
        )
    say(lines)
    if options.output:
        _write(options.output, verdicts, adjusted)


def judge(claim: Claim) -> Verdict:
    """Judge one claim; results without an episode are refused before."""
    from pytest_libero_max.stats.paired_difference import paired_difference
    from pytest_libero_max.stats.power import pairs_needed
    from pytest_libero_max.stats.significance import mcnemar
    from pytest_libero_max.stats.two_proportions import (
        compare_proportions,
        episodes_for_power,
        episodes_to_show,
        pairs_to_show,
    )

    first, second = claim.first, claim.second
    if claim.discordant is None:
        found = compare_proportions(first, second)
        assert found.value is not None
        assert found.interval is not None
        assert found.log10_p is not None
        rates = first.count / first.of, second.count / second.of
        needed = episodes_to_show(*rates), episodes_for_power(*rates, _POWER)
        return Verdict(claim, found.value, found.interval, found.log10_p, *needed)
    gains, losses = claim.discordant
    interval = paired_difference(losses, gains, first.of)
    assert interval is not None
    powered = None if gains == losses else pairs_needed(losses / first.of, gains / first.of, _POWER)
    return Verdict(
        claim,
        (gains - losses) / first.of,
        interval,
        mcnemar(losses, gains),
        pairs_to_show(losses, gains, first.of),
        powered,
    )


def _lines(verdict: Verdict, adjusted: float, many: bool) -> Iterator[str]:
    from pytest_libero_max.report.formats import interval_text, p_number, percent, points

    claim = verdict.claim
    results = " vs ".join(
        f"{ratio.count}/{ratio.of} ({percent(ratio.value)})" for ratio in (claim.first, claim.second)
    )
    test = "Fisher" if claim.discordant is None else "McNemar, {} and {} alone".format(*claim.discordant)
    family = f", adjusted p = {p_number(adjusted)}" if many else ""
    if claim.name:
        yield claim.name
    yield (
        f"{results}: {points(verdict.change)} pp {interval_text(verdict.interval, signed=True)}, "
        f"p = {p_number(verdict.log10_p)} ({test}){family}"
    )
    yield _meaning(verdict, 10**adjusted < _LEVEL)
    if many:
        yield ""


def _meaning(verdict: Verdict, shown: bool) -> str:
    what = "episodes each" if verdict.claim.discordant is None else "pairs"
    if shown:
        return "Shown: without a true difference, fewer than one of twenty comparisons would differ so much."
    if verdict.change == 0:
        return "Not shown: the results are equal."
    if verdict.from_n is None:
        return f"Not shown, and not with a million {what} either."
    powered = "more than a million are" if verdict.powered_n is None else f"about {verdict.powered_n:,} are"
    if 10**verdict.log10_p < _LEVEL:
        return (
            f"Not shown among so many comparisons; {powered} needed to show it alone in four of five tries."
        )
    return (
        f"Not shown. These rates would be significant from about {verdict.from_n:,} {what} on; {powered} "
        "needed to show such a difference in four of five tries."
    )


def _from_words(options: argparse.Namespace) -> Claim:
    words = [word for word in options.results if word.lower() not in ("vs", "vs.")]
    if len(words) != 2:
        raise OptionError.seen(
            "RESULT", " ".join(words), ", but a claim is about two results, for example 78/100 vs 74/100."
        )
    return _read("", words, options.n, (options.only_first, options.only_second))


def _from_table(path: Path) -> list[Claim]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise OptionError(f"Cannot read --csv {str(path)!r}: {error}.") from error
    found = set(rows[0]) if rows else set()
    if not found.issuperset(_REQUIRED) or not found.issubset(_COLUMNS):
        raise OptionError(
            f"{path}: columns {sorted(map(str, found))}, but a table has first and second, and may have "
            f"{', '.join(name for name in _COLUMNS if name not in _REQUIRED)}, and at least one row."
        )
    claims = []
    for number, row in enumerate(rows, start=2):
        try:
            counts = {name: _whole(name, row) for name in ("n", "only_first", "only_second")}
            claims.append(
                _read(
                    row.get("claim") or f"row {number}",
                    [row[name] or "" for name in _REQUIRED],
                    counts["n"],
                    (counts["only_first"], counts["only_second"]),
                )
            )
        except OptionError as error:
            raise OptionError(f"{path}, line {number}: {error}") from error
    return claims


def _whole(name: str, row: Mapping[str, str | None]) -> int | None:
    text = (row.get(name) or "").strip()
    if text and not text.isdecimal():
        raise OptionError.seen(name, text, ", but must be a whole number, or empty.")
    return int(text) if text else None


def _read(name: str, results: Sequence[str], n: int | None, only: tuple[int | None, int | None]) -> Claim:
    first, second = (_ratio(text.strip(), n) for text in results)
    gains, losses = only
    if gains is None and losses is None:
        return Claim(name, first, second, None)
    if gains is None or losses is None:
        raise OptionError("Only one of only-first and only-second is given; a paired comparison needs both.")
    if first.of != second.of or gains - losses != first.count - second.count or gains > first.count:
        raise OptionError(
            f"only-first={gains}, only-second={losses} of {first.count}/{first.of} and "
            f"{second.count}/{second.of}, but both results are of the same cases, so the counts differ by "
            f"{first.count - second.count}, and neither is more than its successes."
        )
    if gains + losses > first.of:
        raise OptionError(
            f"only-first={gains} and only-second={losses} are more than the {counted(first.of, 'case')}."
        )
    return Claim(name, first, second, (gains, losses))


def _ratio(text: str, n: int | None) -> Ratio:
    """Read ``78/100``, ``78%/100`` or, with ``n``, ``78%``."""
    if match := _COUNT.fullmatch(text):
        ratio = Ratio(int(match[1]), int(match[2]))
    elif match := _SHARE.fullmatch(text):
        of = int(match[2]) if match[2] else n
        if of is None:
            raise OptionError.seen(
                "RESULT", text, " without its number of episodes. Add --n, or write 78%/100."
            )
        ratio = Ratio(_count(Decimal(match[1]), of, text), of)
    else:
        raise OptionError.seen(
            "RESULT", text, ", but a result is written 78/100, or 78%/100, or 78% with --n."
        )
    if not 0 <= ratio.count <= ratio.of or ratio.of == 0:
        raise OptionError.seen(
            "RESULT", text, ", but successes are from 0 to the number of episodes, at least 1."
        )
    return ratio


def _count(percentage: Decimal, of: int, text: str) -> int:
    """Return the number of successes that rounds to a percentage, the nearest of several."""
    exact = percentage * of / 100
    half = Decimal(1).scaleb(int(percentage.as_tuple().exponent)) / 2 * of / 100
    count = int(exact.to_integral_value())
    if abs(count - exact) > half:
        raise OptionError.seen(
            "RESULT",
            text,
            f", but no number of successes of {counted(of, 'episode')} gives this percentage: {count}/{of} "
            f"is {100 * count / of:.2f}%. Give the number of all episodes that it is the mean of.",
        )
    return count


def _write(path: Path, verdicts: Sequence[Verdict], adjusted: Sequence[float]) -> None:
    head = ("claim", "first", "second", "difference", "lower", "upper", "p", "p_holm", "shown")
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow((*head, "significant_from_n", "n_for_80_percent_power"))
        for verdict, p in zip(verdicts, adjusted, strict=True):
            claim = verdict.claim
            results = (f"{ratio.count}/{ratio.of}" for ratio in (claim.first, claim.second))
            numbers = (verdict.change, verdict.interval.lower, verdict.interval.upper)
            writer.writerow(
                (
                    claim.name,
                    *results,
                    *(f"{number:.6f}" for number in numbers),
                    *(f"{10**log:.6g}" for log in (verdict.log10_p, p)),
                    "yes" if 10**p < _LEVEL else "no",
                    verdict.from_n or "",
                    verdict.powered_n or "",
                )
            )
