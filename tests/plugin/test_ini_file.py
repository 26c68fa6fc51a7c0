"""A policy in the ini file: ``pytest libero-max``, or ``pytest`` with ``testpaths = libero-max``."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.evaluation.settings import OPTIONS
from pytest_libero_max.plugin.options import native_value
from tests.plugin.conftest import REACHER, tiny_manifest

Results = Callable[..., tuple[list[dict[str, Any]], dict[str, Any]]]

INI = """
[pytest]
addopts = --strict-markers --strict-config -p no:cacheprovider
filterwarnings = error
libero_max_policy = adapter.py
libero_max_manifest = tiny.json
libero_max_substrate = tiny
libero_max_gate =
    dynamic_sr >= 0.6
"""


@pytest.fixture
def project(pytester: pytest.Pytester, short_sessions: None) -> pytest.Pytester:
    """A project with an adapter, a manifest, a test of its own, and everything else in its ini file."""
    pytester.makeini(INI)
    pytester.makepyfile(adapter=REACHER)
    pytester.path.joinpath("tests").mkdir()
    pytester.path.joinpath("tests/test_mine.py").write_text("def test_mine(): pass\n")
    pytester.path.joinpath("tiny.json").write_text(json.dumps(tiny_manifest(events=("camera_shift",))))
    return pytester


_OPTIONS = {option.name: option for option in OPTIONS}


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("limit", 8, "8"),
        ("resume", True, True),
        ("gate", ["delta > 0", "missing == 0"], ["delta > 0", "missing == 0"]),
        ("noise", {"sham": 0.2, "floor": 4}, "sham:0.2,floor:4"),
        ("wrap", ["restore:gated", {"adaptive": "image"}], "restore:gated,adaptive:image"),
        ("wrap", [], None),
        (
            "substrate",
            {"libero": {"semantics": "corrected", "variations": "own"}},
            "libero:semantics=corrected,variations=own",
        ),
        ("study", {"cadence": [2, 4]}, "cadence:2,4"),
        ("timeout", {"query": 20, "pair": 600}, "query:20,pair:600"),
    ],
)
def test_lists_and_tables_are_read_as_the_option_spells_them(name: str, value: object, text: object) -> None:
    assert native_value(_OPTIONS[name], value) == text


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("horizon", [4], r"libero_max_horizon=\[4\]: expected text or a number$"),
        ("gate", {"delta": 0}, "or a list of these$"),
        ("noise", {"sham": True}, "libero_max_noise=True: .* table of them by name, as in sham:SHARE"),
        ("resume", 1, "libero_max_resume=1: expected true or false"),
    ],
)
def test_another_type_is_refused_with_the_key_and_what_it_takes(
    name: str, value: object, message: str
) -> None:
    with pytest.raises(pytest.UsageError, match=message):
        native_value(_OPTIONS[name], value)


def set_testpaths(project: pytest.Pytester, *paths: str) -> None:
    project.makeini(f"{INI}testpaths = {' '.join(paths)}\n")


def played(folder: Path) -> int:
    lines = (folder / "libero-max-results" / "pairs.jsonl").read_text().splitlines()
    return sum(json.loads(line)["line"] == "pair" for line in lines)


@pytest.mark.parametrize("workers", [(), ("-n", "2")], ids=["plain", "two workers"])
def test_pytest_libero_max_plays_reports_and_decides_the_gates(
    project: pytest.Pytester, results: Results, workers: tuple[str, ...]
) -> None:
    done = project.runpytest_subprocess("libero-max", *workers)
    done.assert_outcomes(passed=2)
    assert done.ret == 10
    done.stdout.fnmatch_lines(["gate FAIL*dynamic_sr*", "Exit status 10: 1 of 1 gate failed."])
    assert results()[1]["selection"]["whole"]
    assert played(project.path) == 2


@pytest.mark.parametrize("workers", [(), ("-n", "2")], ids=["plain", "two workers"])
def test_bare_pytest_plays_the_pairs_that_testpaths_name(
    project: pytest.Pytester, workers: tuple[str, ...]
) -> None:
    set_testpaths(project, "libero-max")
    done = project.runpytest_subprocess(*workers)
    done.assert_outcomes(passed=2)
    assert done.ret == 10
    assert played(project.path) == 2


def test_testpaths_may_name_the_users_own_tests_too(project: pytest.Pytester) -> None:
    set_testpaths(project, "tests", "libero-max")
    done = project.runpytest_subprocess()
    done.assert_outcomes(passed=3)
    assert done.ret == 10
    assert played(project.path) == 2


def test_a_policy_in_the_ini_file_alone_leaves_the_users_tests_as_they_are_and_says_so(
    project: pytest.Pytester,
) -> None:
    done = project.runpytest_subprocess()
    done.assert_outcomes(passed=1)
    assert done.ret == 0
    done.stdout.fnmatch_lines(
        ["libero-max: policy adapter.py is for tests that ask for it; *: pytest libero-max"]
    )
    assert not (project.path / "libero-max-results").exists()


def test_the_command_line_wins_over_the_ini_file(project: pytest.Pytester, results: Results) -> None:
    project.makepyfile(other=REACHER.replace('"reacher"', '"other"'))
    project.runpytest_subprocess("libero-max", "--libero-max-policy=other.py", "-k", "v0")
    assert results()[1]["policy"]["name"] == "other"


@pytest.mark.parametrize("where", ["command line", "ini file"])
@pytest.mark.parametrize(
    "arguments",
    [
        ["--fixtures"],
        ["--fixtures-per-test"],
        ["--markers"],
        ["--collect-only"],
        ["--help"],
        ["--version"],
        ["--setup-plan"],
    ],
    ids=lambda arguments: arguments[0],
)
def test_only_a_run_that_plays_writes_into_the_output_folder(
    project: pytest.Pytester, arguments: list[str], where: str
) -> None:
    target = ["libero-max"] if where == "ini file" else ["--libero-max-policy=adapter.py"]
    here = ("-W", "ignore::pytest.PytestAssertRewriteWarning")  # the tests of a checkout are imported already
    project.runpytest_inprocess(*target, *arguments, *here)
    folder = project.path / "libero-max-results"
    assert not folder.exists()
    folder.mkdir()
    (folder / "report.json").write_text("kept")
    (folder / "pairs.jsonl").write_text("kept\n")
    project.runpytest_inprocess(*target, *arguments, *here)
    assert {path.name: path.read_text() for path in folder.iterdir()} == {
        "report.json": "kept",
        "pairs.jsonl": "kept\n",
    }


def test_a_session_that_cannot_collect_writes_nothing(project: pytest.Pytester) -> None:
    project.makeini(INI.partition("libero_max_gate")[0])  # workers, which gates start, play all the same
    project.path.joinpath("tests/test_broken.py").write_text("import nowhere_to_be_found\n")
    done = project.runpytest_subprocess("libero-max", "tests")
    assert done.ret == pytest.ExitCode.INTERRUPTED
    assert list((project.path / "libero-max-results").iterdir()) == []


@pytest.mark.parametrize("adapter", ["adapter.py", "my.pyramid/adapter.py"])
def test_files_of_the_ini_file_lie_beside_it(
    adapter: str, project: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, results: Results
) -> None:
    file = project.path / adapter
    file.parent.mkdir(exist_ok=True)
    project.path.joinpath("adapter.py").rename(file)
    project.makeini(INI.replace("adapter.py", adapter))
    monkeypatch.chdir(project.path / "tests")
    monkeypatch.setenv("PYTHONPATH", str(project.path), prepend=os.pathsep)
    done = project.runpytest_subprocess("libero-max", "--rootdir=..", "-c", "../tox.ini")
    done.assert_outcomes(passed=2)
    assert results("tests/libero-max-results")[1]["provenance"]["policy"]["reference"] == f"../{adapter}"


def native(lines: str) -> str:
    return f'[pytest]\nlibero_max_policy = "noop"\ntestpaths = ["libero-max"]\n{lines}\n'


needs_tables = pytest.mark.skipif(
    pytest.version_tuple < (9, 0), reason="pytest reads its own tables since 9.0"
)


@needs_tables
def test_the_tables_of_pytest_9_have_values_of_their_own_types(project: pytest.Pytester) -> None:
    Path("tox.ini").unlink()
    Path("pytest.toml").write_text(
        native(
            """
            libero_max_manifest = "tiny.json"
            libero_max_substrate = "tiny"
            libero_max_limit = 1
            libero_max_strength = 1.0
            libero_max_timeout = 'query:60'
            libero_max_retries = 0
            libero_max_isolate = false
            libero_max_only_installed = false
            libero_max_gate = ["dynamic_sr >= 0.6", "trigger_coverage >= 0.1"]
            libero_max_probe = "contact_timeline"
            """
        )
    )
    done = project.runpytest_inprocess("--collect-only", "-q")
    assert sum(line.startswith("libero-max::") for line in done.outlines) == 1
    done = project.runpytest_inprocess("--collect-only", "-q", "-o", "libero_max_limit=2")
    assert sum(line.startswith("libero-max::") for line in done.outlines) == 2


@needs_tables
@pytest.mark.parametrize(
    "line",
    [
        "libero_max_limit = [1]",
        "libero_max_limit = true",
        "libero_max_isolate = 1",
        "libero_max_gate = [true]",
    ],
)
def test_a_value_of_another_type_is_refused_with_its_key(project: pytest.Pytester, line: str) -> None:
    Path("native.toml").write_text(native(line))
    done = project.runpytest_inprocess("-c", "native.toml", "--collect-only", "-q")
    key = line.partition(" ")[0]
    done.stderr.fnmatch_lines([f"ERROR: ini option {key}=*: expected *"])
    assert done.ret == 4
