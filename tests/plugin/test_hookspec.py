"""The hooks that users can put into a conftest.py."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

Run = Callable[..., pytest.RunResult]
Results = Callable[[], tuple[list[dict[str, Any]], dict[str, Any]]]


@pytest.mark.parametrize("workers", [(), ("-n", "2")], ids=["plain", "two workers"])
def test_a_section_of_the_users_own_is_in_every_report(
    run: Run, results: Results, pytester: pytest.Pytester, workers: tuple[str, ...]
) -> None:
    pytester.makeconftest(
        """
        def pytest_libero_max_report(report):
            report["sections"]["Checkpoint"] = {"step": 30000, "trained on": "a | b"}
        """
    )
    assert run("-k", "camera_shift", *workers, subprocess=True).ret == 0
    assert results()[1]["sections"]["Checkpoint"] == {"step": 30000, "trained on": "a | b"}
    folder = pytester.path / "libero-max-results"
    assert (
        "## Checkpoint\n\n| Name | Value |\n| --- | --- |\n| step | 30000 |"
        in (folder / "report.md").read_text()
    )
    assert "<h2>Checkpoint</h2>" in (folder / "report.html").read_text()


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("report['overall']['played'] = 7", "changed overall, "),
        ("report['sections']['Mine'] = 3", "*'Mine'*=3: "),
        ("report['sections']['Mine'] = {'a': [1]}", "*'Mine'*=*'a': *1"),
        ("raise OSError('no network')", "OSError: no network"),
    ],
)
def test_a_report_keeps_its_numbers(
    run: Run, results: Results, pytester: pytest.Pytester, line: str, message: str
) -> None:
    pytester.makeconftest(f"def pytest_libero_max_report(report):\n    {line}\n")
    done = run("-k", "camera_shift")
    assert done.ret == 0
    done.stdout.fnmatch_lines([f"The report has no sections of your own: *{message}*"])
    assert "Mine" not in results()[1]["sections"]
    assert results()[1]["overall"]["played"] == 2


@pytest.mark.parametrize("workers", [(), ("-n", "2")], ids=["plain", "two workers"])
def test_a_hook_is_told_of_every_stored_pair(
    run: Run, pytester: pytest.Pytester, workers: tuple[str, ...]
) -> None:
    pytester.makeconftest(
        """
        def pytest_libero_max_pair_stored(pair, config):
            assert pair.item_id in (config.rootpath / "libero-max-results/pairs.jsonl").read_text()
            with open(config.rootpath / "told.txt", "a") as file:
                print(pair.item_id, file=file)
        """
    )
    assert run("-k", "camera_shift", *workers, subprocess=True).ret == 0
    told = (pytester.path / "told.txt").read_text().split()
    assert sorted(told) == [f"libero-spatial-t00-i00-camera_shift-v{variant}" for variant in (0, 1)]


def test_a_hook_that_raises_costs_no_pair(run: Run, results: Results, pytester: pytest.Pytester) -> None:
    pytester.makeconftest("def pytest_libero_max_pair_stored(pair):\n    raise OSError('no network')\n")
    done = run("-k", "camera_shift")
    assert done.ret == 0
    done.stdout.fnmatch_lines(["pytest_libero_max_pair_stored raised OSError: no network"])
    assert len(results()[0]) == 2


def test_a_hook_is_told_where_the_reports_are(run: Run, pytester: pytest.Pytester) -> None:
    pytester.makeconftest(
        """
        import json

        def pytest_libero_max_reported(report, folder, config):
            assert json.loads((folder / "report.json").read_text()) == report
            report.clear()
            (folder / "sent.txt").write_text(str(sorted(path.name for path in folder.iterdir())))
            raise OSError("no network")
        """
    )
    done = run("-k", "camera_shift", "--libero-max-gate=dynamic_sr <= 0.5")
    assert done.ret == 0
    done.stdout.fnmatch_lines(["pytest_libero_max_reported raised OSError: no network", "gate pass*"])
    sent = (pytester.path / "libero-max-results" / "sent.txt").read_text()
    assert "pairs.jsonl" in sent
    assert "report.html" in sent
    assert "in-progress" not in sent
