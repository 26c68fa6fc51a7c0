"""The tasks of an installation: their order, files and instructions, without importing its benchmark.

LIBERO's own list lives in a module that imports torch; the table behind it is a literal in a file beside it.
"""

from __future__ import annotations

import ast
import contextlib
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from pytest_libero_max.errors import SubstrateError, did_you_mean
from pytest_libero_max.substrates.libero.installation import Installation

_TABLE = "libero_task_map"
_WORDS = re.compile(r"\(:language\s+([^)]*)\)")


@dataclass(frozen=True)
class Task:
    """One task of a suite."""

    suite: str
    index: int
    """Index in the suite's order, from 0."""
    name: str
    """Stem of its BDDL file."""
    bddl: Path
    states: Path

    @property
    def language(self) -> str:
        """The authors' prompt, which the benchmark derives from the task's name."""
        return sentence(self.name)

    @property
    def clean_language(self) -> str:
        """The prompt without the name of the variation."""
        return self.language

    @property
    def source(self) -> str:
        """Part of the scene's name that distinguishes it from tasks of other sources with the same index."""
        return ""

    @contextlib.contextmanager
    def description(self) -> Iterator[Path]:
        """File from which the package's wrapper builds it, for as long as the block runs."""
        yield self.bddl


def text_of(file: Path) -> str:
    """Return the text of a file of the package, or raise SubstrateError."""
    try:
        return file.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise SubstrateError(f"Cannot read {str(file)!r}: {error}. Restore it.") from error


def words_of(bddl: Path) -> str:
    """Return the instruction in a BDDL file, or raise SubstrateError."""
    match = _WORDS.search(text_of(bddl))
    if match is None:
        raise SubstrateError(f"{str(bddl)!r} has no words for its task. Restore it from the package.")
    return " ".join(match.group(1).split())


def sentence(name: str) -> str:
    """Return the instruction that the benchmark makes of a task's name."""
    words = name
    if words[:1].isupper():  # LIBERO-100 puts the scene before the sentence
        words = words.partition("SCENE")[2].lstrip("0123456789").removeprefix("_")
    return " ".join(words.split("_"))


def task_of(installation: Installation, suite: str, index: int) -> Task:
    """Return a task by its place in the benchmark's order, or raise SubstrateError."""
    name = task_name(installation, suite, index)
    bddl = installation.bddl / suite / f"{name}.bddl"
    states = states_file(installation.states / suite / f"{name}.pruned_init")
    for path in (bddl, states):
        if not path.is_file():
            raise SubstrateError(f"{installation} lacks {str(path)!r}. Restore it from the package.")
    return Task(suite, index, name, bddl, states)


def states_file(path: Path) -> Path:
    """Return the file of initial states; some packages keep NumPy's own form, ``.pruned_init.npz``."""
    packed = path.with_name(f"{path.name}.npz")
    return packed if packed.is_file() and not path.is_file() else path


def check_name(installation: Installation, task: Task, name: str | None) -> None:
    """Check that a task has the name that a case gives it; a case may also give none.

    Raises:
        SubstrateError: See above.
    """
    if name is not None and name != task.name:
        raise SubstrateError(
            f"Task {task.index} of {task.suite} is {task.name!r} in {installation}, but {name!r} in the "
            "case: the manifest was made with another registry."
        )


def task_name(installation: Installation, suite: str, index: int) -> str:
    """Return a task's name by its place in the registry, or raise SubstrateError."""
    names = task_names(installation, suite)
    if not 0 <= index < len(names):
        raise SubstrateError(f"task_index={index} of {suite}, but {installation} has 0 to {len(names) - 1}.")
    return names[index]


def task_names(installation: Installation, suite: str) -> tuple[str, ...]:
    """Return the names of all tasks of a suite, in the registry's order, or raise SubstrateError."""
    table = _task_map(installation.package)
    if suite not in table:
        raise SubstrateError.seen(
            "suite", suite, f" is not one of {installation}. {did_you_mean(suite, table)}"
        )
    return table[suite]


@cache
def _task_map(package: Path) -> Mapping[str, tuple[str, ...]]:
    path = package / "benchmark" / "libero_suite_task_map.py"
    try:
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for statement in tree.body:
            if isinstance(statement, ast.Assign) and any(
                isinstance(target, ast.Name) and target.id == _TABLE for target in statement.targets
            ):
                table = ast.literal_eval(statement.value)
                return {suite: tuple(names) for suite, names in table.items()}
    except (
        OSError,
        ValueError,
        SyntaxError,
        TypeError,
        AttributeError,
        RecursionError,
        MemoryError,
    ) as error:
        raise SubstrateError(f"Cannot read the list of tasks {str(path)!r}: {error}.") from error
    raise SubstrateError(f"{str(path)!r} defines no {_TABLE}. Restore it from the package.")
