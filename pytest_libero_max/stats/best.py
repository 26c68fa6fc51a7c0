"""The best of several conditions on the same cases, with intervals that account for the choice."""

from __future__ import annotations

from collections.abc import Mapping

from msgspec.structs import asdict, astuple

from pytest_libero_max.errors import ReportError
from pytest_libero_max.stats.blocks import BestSetting, SettingDifference
from pytest_libero_max.stats.comparison import contrasts
from pytest_libero_max.stats.intervals import CONFIDENCE, clopper_pearson
from pytest_libero_max.stats.measured import ends, number, ratio_of
from pytest_libero_max.stats.outcome_table import BoolArray
from pytest_libero_max.stats.ratios import Ratio


def best_of(successes: Mapping[str, BoolArray]) -> BestSetting:
    """Find the best of m conditions.

    The highest of several rates is too high on average, and an interval for it alone misses its true rate too
    often. So the interval of its rate is at the level 1 - 0.05 / m: all m such intervals hold together with
    95%, whichever is looked at (Bonferroni). Its differences from the others are held together with those of
    all m (m - 1) / 2 pairs, for the same reason. References: J. C. Hsu (1996), Multiple Comparisons, ch. 4;
    Y. Benjamini, D. Yekutieli (2005), JASA 100:71-81.

    Args:
        successes: (n,) bool by condition, the same case at the same place in each; n and m at least 1.

    Raises:
        ReportError: There is no condition or no case.
    """
    rates = {name: Ratio(int(column.sum()), len(column)) for name, column in successes.items()}
    if not rates or not all(rate.of for rate in rates.values()):
        raise ReportError("The best of no conditions, or of no cases, does not exist.")
    name = max(rates, key=lambda condition: rates[condition].count)
    interval = clopper_pearson(rates[name], 1 - (1 - CONFIDENCE) / len(rates))
    assert interval is not None
    differences = {}
    for contrast in contrasts(successes):
        if name not in (contrast.first, contrast.second):
            continue
        low, high = astuple(contrast.difference.simultaneous)
        assert low is not None
        assert high is not None
        turned = contrast.second != name
        rival = contrast.second if turned else contrast.first
        differences[rival] = SettingDifference(
            value=number((rates[name].count - rates[rival].count) / rates[name].of),
            lower=number(-high if turned else low),
            upper=number(-low if turned else high),
        )
    lower, upper = ends(interval)
    return BestSetting(
        setting=name,
        **asdict(ratio_of(rates[name])),
        lower=lower,
        upper=upper,
        not_worse=[rival for rival, away in differences.items() if (away.lower or 0.0) <= 0],
        differences=differences,
    )
