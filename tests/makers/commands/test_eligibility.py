from __future__ import annotations

from pathlib import Path

import pytest

from pytest_libero_max.cli import main

PAGE = Path(__file__).parents[3] / "reports" / "construction.md"
AUDIT = ["8236", "6632", "3391", "8297"]
"""Tasks of LIBERO-Plus that can host the events that move something, in the authors' audit."""


def test_what_can_host_which_event_is_counted_as_the_page_says(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["dev", "eligibility"]) == 0
    lines = {line[:30].strip(): line[30:].split() for line in capsys.readouterr().out.splitlines()}
    assert len(lines) == 1 + 7 + 3 + 10 + 1
    assert lines["Background Textures"] == ["1076"] * 5 + ["888", "707", "296", "883"]
    assert lines["no difficulty, in no track"][0] == "121"
    found = lines["all of plus, with these"]
    assert found[0] == "10030"
    assert [own for own, theirs in zip(found[5:], AUDIT, strict=True) if own != theirs] == ["3352"]
    page = PAGE.read_text()
    for number in (*AUDIT, "3352"):
        assert f"{int(number):,}" in page
    assert lines["all of pro"][5:] == ["330", "269", "120", "331"]
    assert "(330 against 329)" in page
    assert "(331 against 330)" in page
