from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable

import pytest

Run = Callable[..., pytest.RunResult]


def test_the_policy_alone_collects_every_pair_under_short_sorted_ids(run: Run) -> None:
    result = run("--collect-only", "-q")
    ids = [line for line in result.outlines if line.startswith("libero-max::")]
    assert len(ids) == 16
    assert ids == sorted(ids)
    assert ids[0] == "libero-max::test_pair[libero-spatial-t00-i00-camera_shift-v0]"
    assert result.ret == 0


def test_collecting_writes_nothing(run: Run, pytester: pytest.Pytester) -> None:
    run("--collect-only")
    assert not (pytester.path / "libero-max-results").exists()


def test_the_users_own_tests_are_left_out_unless_named(run: Run, pytester: pytest.Pytester) -> None:
    pytester.makepyfile(test_mine="def test_mine(): pass")
    assert "test_mine" not in run("--collect-only", "-q").stdout.str()
    named = run("--collect-only", "-q", "test_mine.py")
    named.stdout.fnmatch_lines(["test_mine.py::test_mine"])
    assert "libero-max::" not in named.stdout.str()


def test_the_pseudo_path_stands_for_the_pairs(run: Run, pytester: pytest.Pytester) -> None:
    pytester.makepyfile(test_mine="def test_mine(): pass")
    both = run("--collect-only", "-q", "libero-max", "test_mine.py")
    assert sum(line.startswith("libero-max::") for line in both.outlines) == 16
    both.stdout.fnmatch_lines(["test_mine.py::test_mine"])


def test_a_node_id_selects_one_pair(run: Run) -> None:
    wanted = "libero-max::test_pair[libero-spatial-t00-i00-obstacle_insertion-v1]"
    result = run("--collect-only", "-q", wanted)
    assert [line for line in result.outlines if line.startswith("libero-max::")] == [wanted]


@pytest.mark.parametrize(
    ("arguments", "count"),
    [
        (["-k", "camera_shift"], 2),
        (["-k", "camera_shift and v1"], 1),
        (["-m", "geometry"], 4),
        (["-m", "appearance_and_clutter and variant_0"], 3),
        (["-m", "libero_spatial and source_libero and category_unmodified"], 16),
        (["-m", "libero_object"], 0),
        (["--libero-max-limit=8"], 8),
    ],
)
def test_pairs_can_be_selected(run: Run, arguments: list[str], count: int) -> None:
    result = run("--collect-only", "-q", "--strict-markers", *arguments)
    assert sum(line.startswith("libero-max::") for line in result.outlines) == count


def test_a_limit_covers_every_event(run: Run) -> None:
    result = run("--collect-only", "-q", "--libero-max-limit=8")
    events = {line.rsplit("-", 2)[1] for line in result.outlines if line.startswith("libero-max::")}
    assert len(events) == 8


ELSEWHERE = """
import pytest

collect_ignore_glob = ["*"]

def pytest_ignore_collect():
    return True

@pytest.hookimpl(tryfirst=True)
def pytest_pycollect_makemodule(module_path, parent):
    return pytest.Module.from_parent(parent, path=module_path)

@pytest.hookimpl(tryfirst=True)
def pytest_pycollect_makeitem():
    return []
"""


@pytest.mark.parametrize(
    "arguments",
    [
        ("-o", "python_functions=check_*", "-o", "python_classes=*", "-o", "python_files=check_*.py"),
        ("-o", "norecursedirs=*", "-o", "testpaths=tests", "--ignore-glob=*/plugin/*"),
        ("--import-mode=importlib", "--rootdir=/", "--doctest-modules"),
        ("-o", "collect_imported_tests=false", "--strict-config", "--strict-markers", "--noconftest"),
    ],
)
def test_pairs_are_collected_whatever_a_project_calls_its_tests(
    run: Run, pytester: pytest.Pytester, arguments: tuple[str, ...]
) -> None:
    pytester.makeconftest(ELSEWHERE)
    done = run("--collect-only", "-q", "-k", "camera_shift", *arguments)
    assert sum(line.startswith("libero-max::test_pair[") for line in done.outlines) == 2
    assert done.ret == 0


def test_the_node_id_of_a_pair_is_one_string_which_reporters_keep_by_its_identity(
    run: Run, pytester: pytest.Pytester
) -> None:
    pytester.makeconftest(
        """
        import pytest

        class Reporter:
            # As allure-pytest does: what belongs to a test is found by id(item.nodeid).
            known = {}

            @pytest.hookimpl(tryfirst=True)
            def pytest_runtest_protocol(self, item):
                self.known[id(item.nodeid)] = item

            @pytest.hookimpl(wrapper=True)
            def pytest_runtest_makereport(self, item):
                report = yield
                assert self.known[id(report.nodeid)] is self.known[id(item.nodeid)] is item
                return report

        def pytest_configure(config):
            config.pluginmanager.register(Reporter())
        """
    )
    run("-k", "camera_shift").assert_outcomes(passed=2)


HEAVY = ("mujoco", "robosuite", "numba", "scipy", "cv2", "numpy", "torch")


def test_an_unused_plugin_imports_no_simulator_and_prints_nothing(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        f"""
        import sys

        def test_nothing_heavy():
            assert [name for name in {HEAVY!r} if name in sys.modules] == []
        """
    )
    result = pytester.run(
        sys.executable, "-I", "-m", "pytest", "-p", "no:xdist"
    )  # a process that is not warm
    result.assert_outcomes(passed=1)
    assert "libero" not in result.stdout.str().lower().replace(str(pytester.path).lower(), "").replace(
        "plugins: ", ""
    ).replace("libero-max-0", "")


def test_importing_the_package_imports_nothing_heavy() -> None:
    code = (
        "import sys, pytest_libero_max, pytest_libero_max.benchmark.cases, pytest_libero_max.plugin.hooks\n"
        f"print([name for name in {HEAVY!r} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("ini", ["", "[pytest]\nlibero_max_gate = base_sr >= 50%\n"])
def test_pairs_without_a_policy_are_one_error_that_says_how_to_name_it(
    pytester: pytest.Pytester, ini: str
) -> None:
    pytester.makefile(".ini", pytest=ini)
    result = pytester.runpytest_inprocess("libero-max")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["*no policy is named*--libero-max-policy=adapter.py*"])


def test_an_option_without_a_policy_is_said_to_play_no_pair(pytester: pytest.Pytester) -> None:
    result = pytester.runpytest_inprocess("--libero-max-track=smoke")
    assert result.ret == pytest.ExitCode.NO_TESTS_COLLECTED
    result.stdout.fnmatch_lines(["libero-max: no policy is named, so --libero-max-track plays no pair"])
