from __future__ import annotations

import hashlib
import re
import runpy
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from importlib.metadata import PathDistribution
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.benchmark.tracks import CHECKSUMS, content_of
from pytest_libero_max.cli.init import SOURCES

pytest.importorskip("setuptools", reason="the build needs it; .ci/development.txt has it")

ROOT = Path(__file__).parents[1]
CASES = "cases"
NEEDED = ("setup.py", "pyproject.toml", "MANIFEST.in", "README.md", "LICENSE", "NOTICE")
FOLDERS = ("pytest_libero_max", "tests", "fixtures", CASES)
# "starter" and "tracks" lie in the folder of the package where a build was made in the checkout.
UNTRACKED = shutil.ignore_patterns("__pycache__", ".*", "*.egg-info", "tracks")


@pytest.fixture(scope="module")
def setup() -> dict[str, Any]:
    return runpy.run_path(str(ROOT / "setup.py"), run_name="setup")


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    for name in NEEDED:
        shutil.copy(ROOT / name, tmp_path)
    for name in FOLDERS:
        shutil.copytree(ROOT / name, tmp_path / name, ignore=UNTRACKED)
    return tmp_path


def build(checkout: Path, kind: str) -> subprocess.CompletedProcess[str]:
    command = f"from setuptools import build_meta; build_meta.build_{kind}('dist')"
    return subprocess.run([sys.executable, "-c", command], cwd=checkout, capture_output=True, text=True)


def frozen(folder: Path) -> dict[str, str]:
    lines = (folder / CHECKSUMS).read_text().splitlines()
    return {name: digest for digest, name in map(str.split, lines)}


def test_a_wheel_has_every_track_and_every_room(checkout: Path) -> None:
    result = build(checkout, "wheel")
    assert result.returncode == 0, result.stderr
    (wheel,) = (checkout / "dist").glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(checkout / "installed")
    package = checkout / "installed" / "pytest_libero_max"
    for name, digest in frozen(ROOT / CASES).items():
        (path,) = package.glob(f"tracks/{name}*")
        assert hashlib.sha256(content_of(path)).hexdigest() == digest
    for name in SOURCES.values():
        assert (package / "starter" / name).read_bytes() == (ROOT / "fixtures" / name).read_bytes()
    modules = {path.relative_to(package) for path in package.rglob("*.py")}
    source = ROOT / "pytest_libero_max"
    copied = {Path("starter", name) for name in SOURCES.values() if name.endswith(".py")}
    assert modules == {path.relative_to(source) for path in source.rglob("*.py")} | copied
    pages = [
        path for kind in ("css", "js", "webp") for path in (source / "report" / "page").rglob(f"*.{kind}")
    ]
    assert len(pages) > 16
    assert all((package / path.relative_to(source)).is_file() for path in pages)
    data = [path for kind in ("json", "toml", "typed") for path in source.rglob(f"*.{kind}")]
    assert all((package / path.relative_to(source)).is_file() for path in data if "tracks" not in path.parts)
    assert not [*package.rglob("*.md"), *package.rglob("test_*"), *package.rglob("*.nbc")]
    (metadata,) = (checkout / "installed").glob("*.dist-info")
    attached = PathDistribution(metadata).entry_points
    assert {point.group.partition(".")[0] for point in attached} >= {"pytest11", "pytest_libero_max"}
    assert any(point.module.startswith("pytest_libero_max.lab.") for point in attached)
    for point in attached:
        path = checkout / "installed" / point.module.replace(".", "/")
        assert path.with_suffix(".py").is_file() or (path / "__init__.py").is_file(), point
    assert {path.name for path in (checkout / "installed").iterdir()} == {
        "pytest_libero_max",
        f"{wheel.name.removesuffix('-py3-none-any.whl')}.dist-info",
    }


def test_a_source_distribution_has_tests_cases_and_fixtures(checkout: Path) -> None:
    result = build(checkout, "sdist")
    assert result.returncode == 0, result.stderr
    (archive,) = (checkout / "dist").glob("*.tar.gz")
    with tarfile.open(archive) as tar:
        names = {name.partition("/")[2] for name in tar.getnames()}
    for folder in FOLDERS:
        copied = (path for path in (checkout / folder).rglob("*") if path.is_file())
        assert {
            str(path.relative_to(checkout)) for path in copied if "__pycache__" not in path.parts
        } <= names


@pytest.mark.parametrize("kind", ["wheel", "sdist"])
def test_a_build_without_a_track_fails(checkout: Path, kind: str) -> None:
    (checkout / CASES / "lite.json.gz").unlink()
    result = build(checkout, kind)
    assert result.returncode != 0
    assert "missing, and cases/SHA256SUMS lists" in result.stderr


def test_a_build_with_an_altered_track_fails(checkout: Path) -> None:
    shutil.copy(checkout / CASES / "camera.json.gz", checkout / CASES / "lite.json.gz")
    result = build(checkout, "wheel")
    assert result.returncode != 0
    assert "content differs from cases/SHA256SUMS" in result.stderr


def test_later_pythons_are_refused_with_the_cure(
    setup: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "version_info", (3, 15, 0))
    monkeypatch.setattr(sys, "version", "3.15.0 (main)")
    with pytest.raises(SystemExit, match=r"3\.11 to 3\.14; .* 3\.15\.0") as refusal:
        setup["check_python"]()
    assert "uv venv --clear --seed --python 3.13 .venv" in str(refusal.value)


TEXT = """\
![Scenes](reports/scenes.png) and [cases](cases), [there](https://example.org/x), [below](#tracks)
```sh
echo [not](a link)
```
"""


def test_links_of_the_readme_become_absolute(setup: dict[str, Any]) -> None:
    assert setup["readme_for_index"](TEXT, "https://example.org/project", "1.2") == TEXT.replace(
        "reports/scenes.png", "https://example.org/project/raw/v1.2/reports/scenes.png"
    ).replace("(cases)", "(https://example.org/project/blob/v1.2/cases)")


def test_without_an_address_no_link_is_broken(setup: dict[str, Any]) -> None:
    first, *rest = setup["readme_for_index"](TEXT, "", "1.2").splitlines()
    assert first == " and cases, [there](https://example.org/x), [below](#tracks)"
    assert rest == TEXT.splitlines()[1:]


def test_every_link_of_our_readme_is_found_and_leads_somewhere(setup: dict[str, Any]) -> None:
    text = setup["readme_for_index"]((ROOT / "README.md").read_text(), "https://example.org/project", "1.2")
    targets = re.findall(r"https://example\.org/project/(?:raw|blob)/v1\.2/([^)\s#]+)", text)
    assert targets
    for target in targets:
        assert (ROOT / target).exists(), target
    assert re.findall(r"\]\((?![a-z]+:|#)[^)]*\)", text) == []


def test_metadata_and_workflow_name_the_same_pythons() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    prefix = "Programming Language :: Python :: "
    named = [
        line.removeprefix(prefix) for line in project["classifiers"] if re.match(prefix + r"3\.\d", line)
    ]
    assert project["requires-python"] == f">={named[0]},<3.{int(named[-1].partition('.')[2]) + 1}"
    matrix = re.search(r"python: \[(.*)\]", (ROOT / ".github" / "workflows" / "ci.yml").read_text())
    assert matrix
    assert re.findall(r"[\d.]+", matrix[1]) == named


def test_every_place_of_the_version_names_the_same_one() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text()
    newest = re.search(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(), re.M)
    assert newest is not None
    assert newest[1] == version


@pytest.mark.parametrize("name", ["ci", "release"])
def test_the_container_is_built_for_each_change_and_each_release(name: str) -> None:
    yaml = pytest.importorskip("yaml", reason=".ci/development.txt")
    workflows = ROOT / ".github" / "workflows"
    jobs = yaml.safe_load((workflows / f"{name}.yml").read_text())["jobs"]
    assert jobs["container"] == {"uses": "./.github/workflows/container.yml"}
    (container,) = yaml.safe_load((workflows / "container.yml").read_text())["jobs"].values()
    assert any("docker build -f Containerfile" in step.get("run", "") for step in container["steps"])
