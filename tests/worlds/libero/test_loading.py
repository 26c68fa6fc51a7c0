"""What an import of LIBERO does by itself, and does not do here. Every test has a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.worlds.libero import loading
from tests.worlds.libero.data import DATA, needs_package

BEGIN = f"""
from pathlib import Path
from pytest_libero_max.worlds.libero.installation import find_installation
from pytest_libero_max.worlds.libero.substrate import LiberoSubstrate
installation = find_installation(assets=Path({str(DATA / "assets")!r}))
"""


def run(code: str, home: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    variables = {name: value for name, value in os.environ.items() if not name.startswith(("LIBERO", "MPL"))}
    folders = {"HOME": str(home), "XDG_CONFIG_HOME": str(home / "config"), "TMPDIR": str(home.parent)}
    return subprocess.run(
        [sys.executable, "-c", BEGIN + code],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        env=variables | folders | environment,
    )


@pytest.fixture
def home(tmp_path: Path) -> Path:
    (tmp_path / "home").mkdir()
    return tmp_path / "home"


@needs_package
def test_a_world_is_built_without_a_question_and_without_leaving_anything(home: Path) -> None:
    code = """
from pytest_libero_max.worlds import rendering
substrate = LiberoSubstrate(installation)
world = substrate.task_world("libero_object", 0, 195)
world.step([0.0] * 7)
assert rendering._shared_context.cache_info().currsize == 0, "a context is made too early"
assert world.observe(size=64)["agentview_image"].any()
substrate.close()
"""
    result = run(code, home)
    assert result.returncode == 0, result.stderr
    assert list(home.iterdir()) == []
    assert result.stderr == ""
    left = [path.name for path in home.parent.iterdir() if path != home]
    assert left == [], "the private settings stay, or a log file does"


@needs_package
def test_torch_is_not_imported(home: Path) -> None:
    code = """
import sys
sys.modules["torch"] = None
LiberoSubstrate(installation).task_world("libero_spatial", 1, 195)
"""
    result = run(code, home)
    assert result.returncode == 0, result.stderr


@needs_package
def test_the_users_own_settings_are_neither_read_nor_written(home: Path) -> None:
    settings = home / ".libero" / "config.yaml"
    settings.parent.mkdir()
    settings.write_text("assets: /nowhere\nbddl_files: /nowhere\n")
    result = run('LiberoSubstrate(installation).task_world("libero_object", 2, 0)', home)
    assert result.returncode == 0, result.stderr
    assert settings.read_text() == "assets: /nowhere\nbddl_files: /nowhere\n"


@needs_package
def test_an_adapter_may_import_the_package_too(home: Path) -> None:
    code = """
from pytest_libero_max.worlds.libero.loading import load
load(installation)
from libero.libero import get_libero_path
from libero.libero.envs import OffScreenRenderEnv
assert Path(get_libero_path("assets")) == installation.assets
"""
    result = run(code, home)
    assert result.returncode == 0, result.stderr


@needs_package
def test_a_second_installation_is_refused(home: Path) -> None:
    other = home.parent / "other" / "libero" / "libero"
    for folder in ("assets", "bddl_files", "init_files"):
        (other / folder).mkdir(parents=True)
    (other / "__init__.py").write_text("")
    code = f"""
from pytest_libero_max.worlds.libero.loading import load
load(installation)
load(find_installation(Path({str(other)!r})))
"""
    result = run(code, home)
    assert "SubstrateError: This process has imported the LIBERO in" in result.stderr


@needs_package
def test_an_adapter_that_has_imported_another_libero_is_told_so(home: Path) -> None:
    code = """
import sys, types
outer, inner = types.ModuleType("libero"), types.ModuleType("libero.libero")
inner.__file__ = "/elsewhere/libero/libero/__init__.py"
sys.modules |= {"libero": outer, "libero.libero": inner}
from pytest_libero_max.worlds.libero.loading import load
load(installation)
"""
    result = run(code, home)
    assert "all of them are called 'libero'" in result.stderr


@needs_package
def test_a_placement_that_fails_is_tried_again_and_then_an_error(home: Path) -> None:
    code = """
import pdb
from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.worlds.libero import environment
from pytest_libero_max.worlds.libero.loading import load
environments = load(installation)
from robosuite.utils.errors import RandomizationError
from libero.libero.envs.bddl_base_domain import BDDLBaseDomain
tried, original = [], BDDLBaseDomain.reset
def reset(self):
    tried.append(1)
    if len(tried) <= failures:
        pdb.set_trace()
        raise RandomizationError("Cannot place all objects")
    return original(self)
BDDLBaseDomain.reset = reset
bddl = next((installation.bddl / "libero_object").glob("*.bddl"))
failures = 3
environment.build(environments, bddl, 0)
assert len(tried) == 4
tried.clear()
failures = 99
try:
    environment.build(environments, bddl, 0)
except SubstrateError as error:
    assert "could not be laid out in 10 attempts: Cannot place all objects" in str(error), error
else:
    raise AssertionError
assert len(tried) == 10
"""
    result = run(code, home)
    assert result.returncode == 0, result.stderr


def test_missing_modules_are_named_with_the_cure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from pytest_libero_max.worlds.libero.installation import find_installation
    from tests.worlds.libero.test_installation import checkout

    monkeypatch.setattr(loading, "missing_requirements", lambda: ["bddl", "future"])
    monkeypatch.setattr(loading, "_loaded", None)
    monkeypatch.delitem(sys.modules, "libero.libero", raising=False)
    with pytest.raises(SubstrateError, match=r"needs the modules bddl, future.*`pip install easydict future"):
        loading.load(find_installation(checkout(tmp_path)))
