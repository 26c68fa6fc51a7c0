"""What an environment says of itself, so that a rule compares it with what it means to be."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import sys
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from pytest_libero_max.conformance.environment.reference import TaskReference, read_reference
from pytest_libero_max.errors import OptionError, did_you_mean

DEFAULT_REFERENCE = "libero_spatial-0"
"""Name of the reference of an environment that declares none."""

Turn = Literal["delivered", "flipped", "mirrored", "rotated"]


@dataclass(frozen=True)
class DeclaredEnvironment:
    """An environment of one of LIBERO's tasks, and the conventions that it means to keep.

    A factory may return an environment as it is; then everything here has its default.
    """

    make: Callable[[], Any]
    """Opens an environment: Gymnasium's, alone or a vector of them, or one like LIBERO's own."""
    reference: str | Path | TaskReference = DEFAULT_REFERENCE
    """What genuine LIBERO does in the task: a name, a file or the value."""
    initial_states: Sequence[Any] | None = None
    """States for ``set_init_state``, by index; None for an environment that has its own."""
    begin: Callable[[Any, int], Any] | None = None
    """Begins an episode from an initial state by its index, and returns what ``reset`` returns. None:
    ``seed(0)``, ``reset()`` and ``set_init_state`` where there are :attr:`initial_states`, else
    ``reset(seed=0)``, which begins from the reference's initial state."""
    keys: Mapping[str, str] = field(default_factory=dict)
    """Places of an observation, by role (:data:`.observing.ROLES`): keys with slashes between levels. Known
    names are found without."""
    images: Turn = "delivered"
    """Orientation of its images beside those that LIBERO delivers, bottom row first."""
    settle_steps: int = 0
    """No-op steps that beginning an episode plays; what lacks until ten is played by the rules."""

    drawing: Callable[[Any, bool], None] | None = None
    """Switches the drawing of images off, for steps of which no rule reads the image, and on again. None:
    every step draws; with software rendering that is nine tenths of its time."""

    def expects(self) -> TaskReference:
        """Return the reference.

        Raises:
            OptionError: There is none of its name.
        """
        return self.reference if isinstance(self.reference, TaskReference) else read_reference(self.reference)


@dataclass(frozen=True)
class FactoryName:
    """Place of a factory of environments: ``PACKAGE:FACTORY``, with arguments after another colon."""

    module: str
    """Importable name, or path of a file ending in ``.py``."""
    factory: str
    written: str = ""
    """Its arguments as TOML, ``name=value`` with commas between."""

    @property
    def arguments(self) -> Mapping[str, Any]:
        """The arguments by name.

        Raises:
            TOMLDecodeError: They are not TOML.
        """
        arguments: dict[str, Any] = tomllib.loads(f"arguments = {{{self.written}}}")["arguments"]
        return arguments

    def __str__(self) -> str:
        return ":".join([self.module, self.factory, *([self.written] if self.written else [])])

    def absolute(self) -> FactoryName:
        """Return the same place for a process in another folder."""
        return (
            replace(self, module=str(Path(self.module).absolute())) if self.module.endswith(".py") else self
        )

    @classmethod
    def read(cls, text: str) -> FactoryName:
        """Return the place that a text names.

        Raises:
            ValueError: It names no factory, or the arguments are no TOML.
        """
        module, _, rest = text.partition(":")
        name = cls(module, *rest.split(":", 1))
        if not module or not name.factory.isidentifier():
            raise ValueError(
                f"env:{text} names no factory. Write env:PACKAGE:FACTORY or env:FILE.py:FACTORY, with "
                "arguments as in TOML: env:my_package.envs:make:task_id=0,suite='libero_spatial'"
            )
        try:
            _ = name.arguments
        except tomllib.TOMLDecodeError as error:
            raise ValueError(
                f"arguments={name.written!r} are not TOML ({error}). Write name=value with commas between, "
                "and texts in quotation marks: task_id=0,suite='libero_spatial'"
            ) from None
        return name

    def check(self) -> None:
        """Check that the module is there, without executing it.

        Raises:
            OptionError: It is not.
        """
        if self.module.endswith(".py"):
            missing = not Path(self.module).is_file()
        else:
            missing = not _is_importable(self.module)
        if missing:
            raise OptionError.seen(
                "env",
                self.module,
                ", but there is no such module or file. Install the package, or name a file.",
            )

    def load(self) -> DeclaredEnvironment:
        """Import the module, and return what its factory makes, opened later.

        Raises:
            OptionError: The module cannot be imported, or has no such factory.
        """
        try:
            module = (
                _executed(Path(self.module))
                if self.module.endswith(".py")
                else importlib.import_module(self.module)
            )
        except Exception as error:  # a module of others may raise anything
            raise OptionError.seen(
                "env", self.module, f" cannot be imported: {type(error).__name__}: {error}"
            ) from error
        factory = getattr(module, self.factory, None)
        if isinstance(factory, DeclaredEnvironment):
            return factory
        if not callable(factory):
            names = [name for name, value in vars(module).items() if callable(value) and name[0] != "_"]
            near = did_you_mean(self.factory, names)
            raise OptionError.seen(
                "factory", self.factory, f", but {self.module} has no function or class of this name. {near}"
            )
        if _declares(factory):
            try:
                declared = factory(**self.arguments)
            except Exception as error:  # a factory of others may raise anything
                raise OptionError.seen(
                    "factory", self.factory, f" raised {type(error).__name__}: {error}"
                ) from error
            assert isinstance(declared, DeclaredEnvironment)
            return declared
        return DeclaredEnvironment(lambda: factory(**self.arguments))


def _declares(factory: Any) -> bool:
    """Return True for a function that is annotated to return a declared environment."""
    returned = getattr(inspect.unwrap(factory), "__annotations__", {}).get("return")
    return returned is DeclaredEnvironment or str(returned).endswith("DeclaredEnvironment")


def _is_importable(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except (ImportError, ValueError):
        return False


def _executed(path: Path) -> Any:
    """Return the module of a file, whose folder then stands on the import path for its neighbours."""
    folder = str(path.absolute().parent)
    if folder not in sys.path:
        sys.path.append(folder)
    spec = importlib.util.spec_from_file_location(f"_libero_max_environment_{path.stem}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module
