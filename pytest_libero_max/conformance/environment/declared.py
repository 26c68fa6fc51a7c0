"""The declaration of an environment: the conventions that it means to keep, which rules compare it with."""

from __future__ import annotations

import inspect
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pytest_libero_max.conformance.python_name import PythonName
from pytest_libero_max.errors import OptionError

if TYPE_CHECKING:
    from pytest_libero_max.conformance.environment.reference import TaskReference

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
    """Recording of genuine LIBERO in the task: a name, a file or the value."""
    initial_states: Sequence[Any] | None = None
    """States for ``set_init_state``, by index; None for an environment that has its own."""
    begin: Callable[[Any, int], Any] | None = None
    """Begins an episode from an initial state by its index, and returns what ``reset`` returns. None:
    ``seed(0)``, ``reset()`` and ``set_init_state`` where there are :attr:`initial_states`, else
    ``reset(seed=0)``, which begins from the reference's initial state."""
    keys: Mapping[str, str] = field(default_factory=dict)
    """Places of an observation, by role (:data:`.subject.ROLES`): keys with slashes between levels. Known
    names are found without."""
    images: Turn = "delivered"
    """Orientation of its images beside those that LIBERO delivers, bottom row first."""
    settle_steps: int = 0
    """No-op steps that beginning an episode plays; what lacks until ten is played by the rules."""

    drawing: Callable[[Any, bool], None] | None = None
    """Switches the drawing of images off, for steps of which no rule reads the image, and on again. None:
    every step draws; with software rendering that is nine tenths of its time."""

    def expects(self) -> TaskReference:
        """Return the reference."""
        from pytest_libero_max.conformance.environment.reference import read_reference

        given = self.reference
        return read_reference(given) if isinstance(given, str | Path) else given


@dataclass(frozen=True)
class FactoryName:
    """Name of a factory of environments: ``PACKAGE:FACTORY``, with arguments after another colon."""

    place: PythonName
    written: str = ""
    """Its arguments as TOML, ``name=value`` with commas between."""

    @classmethod
    def read(cls, text: str) -> FactoryName:
        """Return the factory that a text names."""
        module, _, rest = text.partition(":")
        function, _, written = rest.partition(":")
        name = cls(PythonName.read("env", f"{module}:{function}"), written)
        try:
            _ = name.arguments
        except tomllib.TOMLDecodeError as error:
            raise ValueError(
                f"arguments={written!r} are not TOML ({error}). Write name=value with commas between, "
                "and texts in quotation marks: task_id=0,suite='libero_spatial'"
            ) from None
        return name

    @property
    def arguments(self) -> Mapping[str, Any]:
        """The arguments by name."""
        arguments: dict[str, Any] = tomllib.loads(f"arguments = {{{self.written}}}")["arguments"]
        return arguments

    def __str__(self) -> str:
        parts = [self.place.module, self.place.function, *([self.written] if self.written else [])]
        return ":".join(parts)

    def absolute(self) -> FactoryName:
        """Return the same name for a process in another folder."""
        if not self.place.module.endswith(".py"):
            return self
        return replace(self, place=replace(self.place, module=str(Path(self.place.module).absolute())))

    def load(self) -> DeclaredEnvironment:
        """Import the module, and return what its factory makes, opened later."""
        factory = self.place.load()
        if not _declares(factory):
            return DeclaredEnvironment(lambda: factory(**self.arguments))
        try:
            declared = factory(**self.arguments)
        except Exception as error:  # a factory of others may raise anything
            raise OptionError.seen(
                "factory", self.place.function, f" raised {type(error).__name__}: {error}"
            ) from error
        assert isinstance(declared, DeclaredEnvironment)
        return declared


def _declares(factory: Any) -> bool:
    """Return True for a function that is annotated to return a declared environment."""
    returned = getattr(inspect.unwrap(factory), "__annotations__", {}).get("return")
    return returned is DeclaredEnvironment or str(returned).endswith("DeclaredEnvironment")
