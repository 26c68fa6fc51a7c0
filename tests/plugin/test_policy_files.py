"""A policy is its code and the files that loading it reads: halves of a run are of one policy."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pytest_libero_max.cli import main
from pytest_libero_max.errors import ReportError
from pytest_libero_max.runs import plan as runs_plan
from pytest_libero_max.runs.agreement import file_differences
from pytest_libero_max.runs.store import PairStore, read_pairs
from tests.plugin.conftest import REACHER
from tests.report.made_up import PROVENANCE, plan, record_of

Run = Callable[..., pytest.RunResult]
Results = Callable[..., tuple[list[dict[str, Any]], dict[str, Any]]]

WEIGHED = REACHER.replace(
    "    def reset",
    """    def __init__(self):
        self.weights = np.load(Path(__file__).with_name("weights.npy"))

    def reset""",
).replace("import numpy as np", "from pathlib import Path\nimport numpy as np")
"""Reads its weights when it is made."""

LAZY = WEIGHED.replace("def __init__(self):", "def unused(self):").replace(
    "        pass", '        self.weights = np.load(Path(__file__).with_name("weights.npy"))'
)
"""Reads them at every reset."""


def _weights(pytester: pytest.Pytester, value: float) -> None:
    np.save(pytester.path / "weights.npy", np.full(4, value))


@pytest.mark.parametrize("code", [WEIGHED, LAZY], ids=["load", "reset"])
def test_a_run_is_not_resumed_with_other_weights(
    code: str, pytester: pytest.Pytester, run: Run, results: Results
) -> None:
    pytester.makepyfile(weighed=code)
    _weights(pytester, 1.0)
    run("-k", "camera_shift", policy="weighed.py", subprocess=True).assert_outcomes(passed=2)
    (record, _) = results()[0]
    part = "files" if code is WEIGHED else "reset_files"
    assert list(record["policy"][part]) == ["weights.npy"]
    assert set(record["policy"][part]["weights.npy"]) == {"bytes", "sha256"}
    _cut(pytester.path / "libero-max-results" / "pairs.jsonl", 2)
    _weights(pytester, 2.0)
    again = ("-k", "camera_shift", "--libero-max-resume")
    result = run(*again, policy="weighed.py", subprocess=True)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stdout.fnmatch_lines(["*the policy's file 'weights.npy': bytes * sha256 *PolicySpec(revision=*"])


def _cut(path: Path, lines: int) -> None:
    """Leave the first lines of a file: the run was stopped after them."""
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:lines]))


def test_shards_with_other_weights_are_not_merged(
    pytester: pytest.Pytester, run: Run, capsys: pytest.CaptureFixture[str]
) -> None:
    pytester.makepyfile(weighed=WEIGHED)
    _weights(pytester, 1.0)
    run("-k", "camera_shift", policy="weighed.py", subprocess=True)
    head, *pairs = Path("libero-max-results", "pairs.jsonl").read_text().splitlines()
    for number, pair in enumerate(pairs):
        text = pair.replace('"sha256":"', f'"sha256":"{number}') if number else pair
        pytester.mkdir(str(number)).joinpath("pairs.jsonl").write_text(f"{head}\n{text}\n")
    assert main(["shards", "merge", "0", "1", "--output=whole"]) == 1
    assert "'weights.npy'" in capsys.readouterr().err


CACHING = WEIGHED.replace(
    '        self.weights = np.load(Path(__file__).with_name("weights.npy"))',
    """        cache = Path("cache.txt")
        if cache.exists():
            cache.read_text()
        elif {at_load}:
            cache.write_text("1")""",
)
"""Keeps a cache in the working folder, which it writes when it is made, or when it is asked."""

ASKED = CACHING.replace("{at_load}", "False").replace(
    "        action = np.zeros(7)\n",
    """        with Path("cache.txt").open("a") as file:
            file.write("1")
        action = np.zeros(7)
""",
)


@pytest.mark.parametrize(
    "code", [CACHING.replace("{at_load}", "True"), ASKED], ids=["written at load", "written when asked"]
)
def test_a_cache_of_the_policy_separates_no_pairs(
    code: str, pytester: pytest.Pytester, run: Run, results: Results
) -> None:
    pytester.makepyfile(caching=code)
    command = ("-k", "camera_shift", "--libero-max-resume")
    assert run(*command, policy="caching.py", subprocess=True).ret == 0
    _cut(pytester.path / "libero-max-results" / "pairs.jsonl", 2)
    assert run(*command, policy="caching.py", subprocess=True).ret == 0
    records, report = results()
    assert [("cache.txt" in record["policy"]["files"]) for record in records] == [code is not ASKED, True]
    assert report["pairs"]["complete"]


def test_a_revision_stands_for_the_files(pytester: pytest.Pytester, run: Run, results: Results) -> None:
    pytester.makepyfile(weighed=WEIGHED.replace("image_size=64", 'image_size=64, revision="v1"'))
    _weights(pytester, 1.0)
    run("-k", "camera_shift and v0", policy="weighed.py", subprocess=True)
    assert "files" not in results()[0][0]["policy"]


def test_a_policy_without_files_says_so(run: Run, results: Results) -> None:
    run("-k", "camera_shift and v0", subprocess=True)
    assert results()[0][0]["policy"]["files"] == {}


def test_files_that_are_not_known_do_not_differ() -> None:
    weights = {"bytes": 8, "sha256": "a" * 64}
    made = {"written": "since loading began"}
    assert file_differences({}, {"files": {"w": weights}}) == []
    assert file_differences({"files": {"w": weights}}, {"files": {"w": made}}) == []
    assert file_differences({"files": {"w": weights}}, {"files": {"w": weights}}) == []
    later = weights | {"changed": "since the run began"}
    assert file_differences({"files": {}}, {"files": {"w": later}}) == []
    assert file_differences({"files": {"w": later}}, {"files": {"w": later | {"sha256": "b" * 64}}}) == []
    assert file_differences({"files": {"w": weights}}, {"files": {"w": later}}) == []
    assert file_differences({"files": {"w": weights}}, {"files": {"w": later | {"sha256": "b" * 64}}})
    (text,) = file_differences({"files": {}}, {"files": {"w": weights}})
    assert text.endswith("'w': not read, bytes 8 sha256 aaaaaaaaaaaa")


@pytest.mark.parametrize("files", [{"w": 1}, ["w"], {"w": {"bytes": []}}])
def test_files_of_another_form_are_refused(tmp_path: Path, files: object) -> None:
    store = PairStore(tmp_path, runs_plan.Run(tuple(plan()[:1]), PROVENANCE))
    store.append(record_of(plan()[0], True, True))
    store.close()
    path = store.path
    head, pair = map(json.loads, path.read_text().splitlines())
    pair["policy"]["files"] = files
    path.write_text("".join(json.dumps(line) + "\n" for line in (head, pair)))
    with pytest.raises(ReportError, match="each with numbers"):
        read_pairs(path.parent)
