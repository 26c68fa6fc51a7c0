from __future__ import annotations

import pytest

from pytest_libero_max.errors import ReportError
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.sections import with_sections
from tests.report.made_up import PROVENANCE, plain, plan

REPORT = build_report([], [], plan(), PROVENANCE)


def test_sections_are_added() -> None:
    amended = {**plain(REPORT), "sections": {"Mine": {"a": 1, "b": "text", "c": None, "d": True}}}
    assert plain(with_sections(REPORT, amended)) == amended
    assert plain(REPORT)["sections"] == {}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"overall": {"played": 3}}, "changed overall"),
        ({"overall": {"played": {1, 2}}}, "changed overall"),
        ({"extra": 1}, "changed extra"),
        ({"sections": []}, r"\['sections'\]=\[\], but must be a dict"),
        ({"sections": {"": {}}}, "must be a title"),
        ({"sections": {"Mine": {"a": [1]}}}, "must be a name with a text"),
        ({"sections": {"Mine": {"a": float("nan")}}}, "must be a name with a text"),
        ({"sections": {"Mine": {1: "a"}}}, "must be a name with a text"),
    ],
)
def test_nothing_else_may_change(change: dict[str, object], message: str) -> None:
    with pytest.raises(ReportError, match=message):
        with_sections(REPORT, {**plain(REPORT), **change})


def test_nothing_may_be_taken_out() -> None:
    with pytest.raises(ReportError, match="changed base_failures, by, category_by_event, causes, caveats"):
        with_sections(REPORT, {"sections": {}})
