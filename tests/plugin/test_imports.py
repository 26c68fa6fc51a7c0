from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import pytest_libero_max
from tests.plugin.test_run import Run

CONFTEST = """
import sys
from pathlib import Path

def pytest_sessionfinish():
    Path("modules.txt").write_text("\\n".join(sorted(sys.modules)))
"""


def test_a_run_imports_nothing_of_lab_and_makers_but_what_the_report_shows(
    pytester: pytest.Pytester, run: Callable[..., pytest.RunResult]
) -> None:
    pytester.makeconftest(CONFTEST)
    run("--libero-max-limit=1", subprocess=True).assert_outcomes(passed=1)
    modules = (pytester.path / "modules.txt").read_text().split()
    assert "pytest_libero_max.pairing.runner" in modules
    beside = [
        name for name in modules if name.startswith(("pytest_libero_max.lab.", "pytest_libero_max.makers"))
    ]
    shown = ("pytest_libero_max.lab.sections", "pytest_libero_max.lab.studies")
    assert [name for name in beside if not name.startswith(shown)] == []


REWRITTEN = """
import os, sys
from pathlib import Path

def pytest_sessionfinish():
    names = [name for name in sys.modules if name.startswith("pytest_libero_max.")]
    later = names[names.index("pytest_libero_max.plugin") + 1:]
    kinds = {type(sys.modules[name].__loader__).__name__ for name in later}
    Path(f"loaders_{os.getpid()}.txt").write_text(f"{len(later)} {' '.join(kinds)}")
"""


def test_neither_controller_nor_worker_rewrites_asserts_of_the_package(
    pytester: pytest.Pytester, run: Callable[..., pytest.RunResult]
) -> None:
    pytester.makeconftest(REWRITTEN)
    run("--libero-max-limit=1", "-n1", subprocess=True).assert_outcomes(passed=1)
    processes = [path.read_text().split() for path in pytester.path.glob("loaders_*.txt")]
    assert len(processes) == 2
    for number, *loaders in processes:
        assert int(number) > 100
        assert loaders == ["SourceFileLoader"]


AT_THE_END = """
import sys
from pathlib import Path

def pytest_unconfigure():
    Path("modules.txt").write_text("\\n".join(sorted(sys.modules)))
"""


def test_a_run_ends_with_few_modules(pytester: pytest.Pytester, run: Callable[..., pytest.RunResult]) -> None:
    pytester.makeconftest(AT_THE_END)
    run("--libero-max-limit=1", subprocess=True).assert_outcomes(passed=1)
    modules = (pytester.path / "modules.txt").read_text().split()
    assert not [name for name in modules if name.split(".")[0] in ("numba", "torch")]
    assert len(modules) < 1400, len(modules)


def test_playing_in_a_clone_loads_no_hypothesis() -> None:
    """pytest loads the ``conftest.py`` of the folder ``tests`` where it is called, also to play pairs."""
    script = "import sys, tests.conftest; print([m for m in sys.modules if m.split('.')[0] == 'hypothesis'])"
    command = [sys.executable, "-c", script]
    root = Path(pytest_libero_max.__file__).parents[1]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=root)
    assert done.stdout == "[]\n"


HEAVY = ("mujoco", "cv2", "scipy", "hypothesis", "robosuite", "torch", "numba")


def test_importing_the_package_imports_nothing_heavy_and_few_of_its_own_modules() -> None:
    script = f"import sys, pytest_libero_max; print([m for m in sys.modules if m.split('.')[0] in {HEAVY}])"
    script += "; print([m for m in sys.modules if m.startswith('pytest_libero_max.')])"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split("\n")[:2] == ["[]", "[]"]


@pytest.mark.parametrize("name", pytest_libero_max.__all__)
def test_every_public_name_is_where_the_facade_says(name: str) -> None:
    value = getattr(pytest_libero_max, name)
    assert value.__doc__
    assert name in dir(pytest_libero_max)
    for public in getattr(value, "__all__", ()):
        assert hasattr(value, public), f"{name}.{public}"


def test_type_checkers_see_the_names_that_the_facade_offers() -> None:
    tree = ast.parse(Path(pytest_libero_max.__file__).read_text(encoding="utf-8"))
    (block,) = (node for node in tree.body if isinstance(node, ast.If))
    imports = [node for node in block.body if isinstance(node, ast.ImportFrom)]
    seen = {alias.name: node.module for node in imports for alias in node.names}
    assert sorted(seen) == sorted(pytest_libero_max.__all__)
    for name, module in pytest_libero_max._MODULE_OF.items():
        assert seen[name] == f"pytest_libero_max.{module}"


def test_a_name_that_is_not_public_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'Nothing'"):
        pytest_libero_max.Nothing  # noqa: B018


@pytest.mark.parametrize("autoload", ["", "1"], ids=["autoload", "no autoload"])
@pytest.mark.parametrize(
    "named",
    [
        ("-p", "libero_max"),
        ("-p", "pytest_libero_max.plugin"),
        ("-p", "libero_max", "-p", "pytest_libero_max.plugin"),
    ],
    ids=" ".join,
)
def test_the_plugin_is_loaded_once_by_the_names_that_people_type(
    run: Run, monkeypatch: pytest.MonkeyPatch, autoload: str, named: tuple[str, ...]
) -> None:
    if autoload:
        monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", autoload)
    done = run(*named, "-Werror", "--collect-only", "-q", "-k", "camera_shift", subprocess=True)
    assert sum(line.startswith("libero-max::") for line in done.outlines) == 2
    assert done.ret == 0
