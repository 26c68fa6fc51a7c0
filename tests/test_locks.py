"""The locked environments, and the README's two commands that install them."""

from __future__ import annotations

import re
import tomllib
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
UNUSED = {"opencv-python", "pynput"}
"""What robosuite asks for and nothing here uses: .ci/runtime.txt says why."""


def _locked(name: str) -> dict[str, str]:
    """The lines of a lock by package, without those of the lock that it lies on."""
    lines = (line.split("#")[0].strip() for line in (ROOT / ".ci" / name).read_text().splitlines())
    requirements = [Requirement(line) for line in lines if line and not line.startswith("-r ")]
    return {
        canonicalize_name(each.name): str(each.specifier)
        for each in requirements
        if each.marker is None or each.marker.evaluate()
    }


def _closure(*roots: str) -> set[str]:
    """The names of all packages that installed packages ask for, on this Python."""
    names: set[str] = set()
    waiting = [Requirement(root) for root in roots]
    asked: set[tuple[str, frozenset[str]]] = set()
    while waiting:
        requirement = waiting.pop()
        name, extras = canonicalize_name(requirement.name), frozenset(requirement.extras)
        if name in UNUSED or (name, extras) in asked:
            continue
        asked.add((name, extras))
        names.add(name)
        try:
            own = [Requirement(line) for line in metadata.requires(name) or []]
        except metadata.PackageNotFoundError:
            continue  # the comparison with the lock names it
        waiting += [
            each
            for each in own
            if each.marker is None or any(each.marker.evaluate({"extra": extra}) for extra in ("", *extras))
        ]
    return names


def _project() -> dict[str, list[str]]:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    return {"": project["dependencies"], **project["optional-dependencies"]}


def _needed(requirements: list[str]) -> set[str]:
    """The closure of some requirements that hold on this Python."""
    valid = [line for line in requirements if (mark := Requirement(line).marker) is None or mark.evaluate()]
    return _closure(*valid)


def test_the_runtime_lock_is_what_the_package_asks_for_and_nothing_else() -> None:
    assert {*_locked("runtime.txt")} == _needed(_project()[""])


def test_the_development_lock_lies_on_top_and_has_every_extra_of_the_tests() -> None:
    extras = _project()
    (combined, *tools) = extras["dev"]
    wanted = [line for extra in Requirement(combined).extras for line in extras[extra]]
    outside = {"pre-commit"}  # of a developer's own machine
    needed = _needed([*wanted, *(tool for tool in tools if Requirement(tool).name not in outside)])
    development, runtime = _locked("development.txt"), _locked("runtime.txt")
    assert "-r runtime.txt" in (ROOT / ".ci" / "development.txt").read_text().splitlines()
    assert not {*development} & {*runtime}
    assert {*development} == needed - {*runtime}


def test_the_lock_of_the_pages_is_complete_alone() -> None:
    roots = ("mkdocs-material", "mkdocstrings-python", "mike")
    pytest.importorskip("mkdocs", reason=".ci/docs.txt has it")
    assert {*_locked("docs.txt")} == _closure(*roots) - UNUSED


def test_locks_that_are_installed_together_name_one_version() -> None:
    versions: dict[str, set[str]] = {}
    for name in ("runtime.txt", "development.txt", "peers.txt", "libero.txt", "docs.txt"):
        for package, version in _locked(name).items():
            versions.setdefault(package, set()).add(version)
    assert {package: each for package, each in versions.items() if len(each) > 1} == {}


@pytest.mark.parametrize("name", ["runtime.txt", "development.txt", "docs.txt"])
def test_every_line_of_a_lock_names_one_version(name: str) -> None:
    versions = _locked(name)
    assert versions
    assert all(re.fullmatch(r"==[\w.]+", version) for version in versions.values())


def _set_up() -> list[str]:
    """The README's commands that install something, each on one line."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```sh\n(.*?)^```", text, re.M | re.S)
    commands = [re.sub(r"\s*\\\n\s*", " ", block).strip() for block in blocks]
    return [command for command in commands if "install" in command]


def test_the_readme_sets_up_with_two_commands_which_the_checks_run_as_they_are_printed() -> None:
    play, test = _set_up()
    assert "\n" not in play + test
    system, python = play.split(" && python3 -m venv .venv && ")
    lines = (ROOT / ".ci" / "run").read_text().splitlines()
    played = lines.index(f"({python})")
    assert any(line.startswith(f"({test} --junitxml") for line in lines[played:])
    packages = system.partition("--no-install-recommends ")[2]
    for file in (
        ".ci/run",
        "Containerfile",
        ".github/workflows/release.yml",
        "fixtures/github-action/action.yml",
    ):
        assert packages.removeprefix("python3-venv ") in (ROOT / file).read_text(), file
