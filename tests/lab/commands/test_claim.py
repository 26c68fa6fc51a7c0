from __future__ import annotations

import csv
from pathlib import Path

import pytest

from pytest_libero_max.cli import main
from pytest_libero_max.report.published import published_policies

REPORTS = Path(__file__).parents[3] / "reports"


def said(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    status = main(["lab", "claim", *words])
    out, err = capsys.readouterr()
    assert status == (1 if err else 0)
    return out or err


def test_a_difference_is_judged_with_what_it_needs(capsys: pytest.CaptureFixture[str]) -> None:
    out = said(capsys, "78/100", "vs", "74/100")
    assert "78/100 (78.0%) vs 74/100 (74.0%): +4.0 pp [-8.8, +16.7], p = 0.620 (Fisher)" in out
    assert "Not shown" in out
    assert said(capsys, "78%", "74%", "--n=100") == out == said(capsys, "78%/100", "vs.", "74.0%/100")
    assert "Shown: " in said(capsys, "90/100", "70/100")
    assert "results are equal" in said(capsys, "7/10", "7/10")


def test_counts_of_the_same_cases_make_it_paired(capsys: pytest.CaptureFixture[str]) -> None:
    paired = said(capsys, "78/100", "70/100", "--only-first=8", "--only-second=0")
    assert "p = 0.008 (McNemar, 8 and 0 alone)" in paired
    assert "Shown: " in paired
    assert "Not shown. " in said(capsys, "78/100", "70/100")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["78/100"], "a claim is about two results"),
        (["78", "74"], "a result is written 78/100"),
        (["78%", "74%"], "without its number of episodes"),
        (["101/100", "74/100"], "from 0 to the number of episodes"),
        (["0/0", "0/0"], "at least 1"),
        (
            ["97.1%", "96%", "--n=500"],
            "no number of successes of 500 episodes gives this percentage: 486/500",
        ),
        (["8/10", "7/10", "--only-first=1"], "needs both"),
        (["8/10", "7/10", "--only-first=3", "--only-second=1"], "so the counts differ by 1"),
        (["5/6", "5/6", "--only-first=4", "--only-second=4"], "more than the 6 cases"),
        (["8/10", "7/10", "--csv=table.csv"], "Leave out RESULT"),
    ],
)
def test_what_cannot_be_is_refused(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert message in said(capsys, *words)


def test_a_table_is_judged_as_one_family(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table, verdicts = tmp_path / "claims.csv", tmp_path / "verdicts.csv"
    table.write_text(
        "claim,first,second,n\nA over B,30/100,17/100,\nA over C,30%,29%,100\nA over D,30%,10%,100\n"
    )
    out = said(capsys, f"--csv={table}", f"--output={verdicts}")
    rows = {row["claim"]: row for row in csv.DictReader(verdicts.read_text().splitlines())}
    assert rows["A over D"]["shown"] == "yes"
    assert rows["A over C"]["shown"] == "no"
    assert float(rows["A over B"]["p"]) < 0.05 < float(rows["A over B"]["p_holm"])
    assert "1 of 3 differences" in out
    table.write_text("claim,first,second\nA,30/100,x\n")
    assert "claims.csv, line 2: RESULT='x'" in said(capsys, f"--csv={table}")
    table.write_text("policy,success\nA,3\n")
    assert "first and second" in said(capsys, f"--csv={table}")


def test_the_claims_of_the_paper_are_judged_from_its_counts(capsys: pytest.CaptureFixture[str]) -> None:
    paper = {policy.key: policy.outcomes for policy in published_policies()}
    rows = {row["claim"]: row for row in csv.DictReader((REPORTS / "claims.csv").read_text().splitlines())}
    best = rows["MolmoAct2 over pi_0.5 in Dynamic"]
    assert best["first"] == f"{paper['molmoact2'].dynamic.count}/8000"
    assert best["second"] == f"{paper['pi05'].dynamic.count}/8000"
    second = rows["DM0.5 over pi_0.5 in Base"]
    assert second["first"] == f"{paper['dm05'].base.count}/8000"
    assert second["second"] == f"{paper['pi05'].base.count}/8000"
    loses = rows["pi_0.5 loses in Dynamic"]
    assert (int(loses["only_first"]), int(loses["only_second"])) == (
        paper["pi05"].regression,
        paper["pi05"].change_associated_success,
    )
    out = said(capsys, f"--csv={REPORTS / 'claims.csv'}")
    assert (
        f"```\n$ libero-max lab claim --csv reports/claims.csv\n{out}```\n"
        in (REPORTS / "claims.md").read_text()
    )


def test_a_file_that_cannot_be_written_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "nowhere" / "claim.csv"
    assert main(["lab", "claim", "78/100", "74/100", f"--output={file}"]) == 1
    assert repr(str(file)) in capsys.readouterr().err
