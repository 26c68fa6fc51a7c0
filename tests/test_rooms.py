"""The direction of imports: down the list of rooms in the package's README, never up."""

from __future__ import annotations

import ast
import re
from collections.abc import Container, Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import pytest_libero_max

PACKAGE = Path(pytest_libero_max.__file__).parent


def _rooms() -> list[str]:
    """The rooms from top to bottom."""
    text = (PACKAGE / "README.md").read_text(encoding="utf-8")
    picture = text.split("## The rooms", maxsplit=1)[1].split("```")[1]
    return re.findall(r"^(\w+)", picture, re.M)


@cache
def _imports(file: Path) -> tuple[ast.Import | ast.ImportFrom, ...]:
    nodes = ast.walk(ast.parse(file.read_text(encoding="utf-8")))
    return tuple(node for node in nodes if isinstance(node, ast.Import | ast.ImportFrom))


def _imported(file: Path) -> Iterator[str]:
    """The rooms that a file imports, also inside functions and for type checking alone."""
    for node in _imports(file):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif node.module == "pytest_libero_max":
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            names = [node.module or ""]
        for name in names:
            if name.startswith("pytest_libero_max."):
                yield name.split(".")[1]


def test_the_readme_lists_every_room() -> None:
    there = {
        path.stem for path in PACKAGE.iterdir() if path.suffix == ".py" or (path / "__init__.py").exists()
    }
    assert sorted(_rooms()) == sorted(there - {"__init__"})


def test_imports_go_down_the_list_of_rooms() -> None:
    rooms = _rooms()
    upward = {
        f"{file.relative_to(PACKAGE)} imports {imported}"
        for room in rooms
        for file in [*PACKAGE.glob(f"{room}.py"), *(PACKAGE / room).rglob("*.py")]
        for imported in _imported(file)
        if imported != room and rooms.index(imported) < rooms.index(room)
    }
    assert not upward


def test_nothing_imports_the_lab_and_the_makers() -> None:
    """They are attached by entry points alone, so that everything else plays without them."""
    importers = {
        f"{file.relative_to(PACKAGE)} imports {imported}"
        for file in PACKAGE.rglob("*.py")
        for imported in _imported(file)
        if imported in ("lab", "makers") and file.relative_to(PACKAGE).parts[0] != imported
    }
    assert not importers


def _modules() -> dict[str, Path]:
    """The modules of the package by name."""
    files = {
        ".".join(file.relative_to(PACKAGE.parent).with_suffix("").parts): file
        for file in PACKAGE.rglob("*.py")
    }
    return {name.removesuffix(".__init__"): file for name, file in files.items()}


def _imported_modules(file: Path, known: Container[str]) -> Iterator[str]:
    """The modules of the package that a file imports, also inside functions and for type checking alone."""
    for node in _imports(file):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        else:
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield inner if inner in known else str(node.module)


def test_no_module_imports_itself_through_others() -> None:
    """Not even through a function or for type checking: what needs another thing comes after it."""
    modules = _modules()
    facade = PACKAGE.name  # it names what others import from it
    graph = {
        name: {module for module in _imported_modules(file, modules) if module in modules} - {facade}
        for name, file in modules.items()
    }
    try:
        assert len([*TopologicalSorter(graph).static_order()]) == len(modules)
    except CycleError as error:
        pytest.fail(f"a circle of imports: {' -> '.join(error.args[1])}")


def test_what_a_report_says_does_not_depend_on_how_it_is_written() -> None:
    """Documents and what they are computed from import no writer: writers read them."""
    folder = PACKAGE / "report"
    computed = {
        *(folder / f"{name}.py" for name in ("build", "sections", "run_tables", "run_texts")),
        *folder.rglob("*_document.py"),
        *(folder / "studies").glob("*.py"),
    }
    modules = _modules()
    importers = {
        f"{file.relative_to(PACKAGE)} imports {module}"
        for file in computed
        for module in _imported_modules(file, modules)
        if module.startswith("pytest_libero_max.report.writers")
    }
    assert not importers
