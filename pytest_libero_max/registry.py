"""Registries of named things: those of this package, and those that other installed packages add.

There is one registry for each kind of thing that a user's package can add without touching this one. Each
reads one entry-point group::

    [project.entry-points."pytest_libero_max.events"]
    push = "my_package.push:Push"

Looking at the names imports nothing; an entry is imported when it is asked for, and checked alike wherever it
is from.
"""

from __future__ import annotations

import importlib
import importlib.util
import pkgutil
from collections.abc import Callable, Collection, Iterator, Mapping
from functools import partial
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Generic, TypeAlias, TypeVar

from pytest_libero_max.errors import LiberoMaxError, did_you_mean

T = TypeVar("T")

ENTRY_POINTS = {
    "pytest_libero_max.events": "a subclass of `EventKind`, under the name of the event",
    "pytest_libero_max.changes": "a class of changes, under the name of its operation",
    "pytest_libero_max.triggers": "a class of triggers, under the name of its type",
    "pytest_libero_max.probes": "a subclass of `Probe`, under its name",
    "pytest_libero_max.stopping_rules": "a subclass of `StoppingRule`, under its name",
    "pytest_libero_max.substrates": "a `SubstrateKind`, under its name",
    "pytest_libero_max.robots": "a `Robot`, under its name",
    "pytest_libero_max.suites": "a `Suite`, under its name",
    "pytest_libero_max.studies": "a subclass of `Study`, under its name",
    "pytest_libero_max.protocols": "a `ServerProtocol`, under the scheme of its addresses",
    "pytest_libero_max.policies": "a policy, or a class or function that makes one",
    "pytest_libero_max.wrappers": "a subclass of `WrappedPolicy` with `modes`, under its name",
    "pytest_libero_max.commands": "a module with a function `add_command`, under the name of the command",
    "pytest_libero_max.launchers": "what makes a plugin from the controller of a session, under its option",
    "pytest_libero_max.comparisons": "a module with `add_options` and `compare`, under its option",
    "pytest_libero_max.sections": "a subclass of `ReportSection`, under its name",
    "pytest_libero_max.study_sections": "a subclass of `StudySection`, under the name of its study",
    "pytest_libero_max.rules": "a `Rule`, under its id",
    "pytest_libero_max.exports": "a module with a function `text`, `files` or `write`, under its name",
    "pytest_libero_max.readers": "a subclass of `ResultsReader`, under its name",
}
"""The entry-point groups that other packages can add to, and the entries of each."""


Own: TypeAlias = Callable[[], Mapping[str, Callable[[], object]]]
"""Returns functions that load objects, by name."""


class Registry(Generic[T]):
    """Named entries in a fixed order: the package's own first, then those of other packages by name.

    Args:
        noun: Word for an entry in messages, for example ``event``.
        group: Entry-point group by which other packages add theirs.
        own: Returns a function that loads the object of an entry, for each name of the package's own, in
            order: :func:`classes_in`, :func:`references` and :func:`given`. It is called on first use.
        accept: Turns an object into an entry; raises ``ValueError`` with the rule that the object breaks.
        error: Raised for an unknown name, for a name that is used twice and for an entry that cannot be
            loaded.
        read: Returns the object of an entry point; by default imports the one that it names.
        attribute: Attribute of another package's entry that has to be its name; None where it has none.
    """

    def __init__(
        self,
        noun: str,
        group: str,
        own: Own,
        accept: Callable[[str, object], T],
        error: type[LiberoMaxError],
        read: Callable[[EntryPoint], object] = EntryPoint.load,
        attribute: str | None = None,
    ) -> None:
        self.noun = noun
        self.group = group
        self._own = own
        self._accept = accept
        self._error = error
        self._read = read
        self._attribute = attribute
        self._loaders: Mapping[str, Callable[[], T]] | None = None
        self._loaded: dict[str, T] = {}

    def __iter__(self) -> Iterator[str]:
        return iter(self._known())

    def __len__(self) -> int:
        return len(self._known())

    def __contains__(self, name: object) -> bool:
        return name in self._known()

    def __getitem__(self, name: str) -> T:
        """Return the entry of that name.

        Raises:
            LiberoMaxError: Of the registry's kind: there is none (the message suggests the closest name), or
                it cannot be loaded.
        """
        if name not in self._loaded:
            if name not in self._known():
                raise self._error(
                    f"{self.noun}={name!r} is not {_a(self.noun)}. {did_you_mean(name, self._known())}"
                )
            self._loaded[name] = self._known()[name]()
        return self._loaded[name]

    @property
    def ours(self) -> tuple[str, ...]:
        """Names of this package's own entries, without a look at others."""
        return tuple(self._own())

    def is_ours(self, name: str) -> bool:
        """Return True for an entry of this package, which may be imported because a file names it."""
        points = entry_points(group=self.group, name=name)
        return name in self._own() or any(point.value.startswith(f"{__package__}.") for point in points)

    def none_called(self, name: str) -> str:
        """Return sentences for the name of no entry: a package that is not installed may have it."""
        other = f"If another package offers this {self.noun} (entry-point group {self.group}), install it."
        return f"{did_you_mean(name, self)} {other}".strip()

    def items(self) -> Iterator[tuple[str, T]]:
        """Names with their entries, each of which is loaded."""
        return ((name, self[name]) for name in self)

    def values(self) -> Iterator[T]:
        """Return the entries, each of which is loaded."""
        return (self[name] for name in self)

    def _known(self) -> Mapping[str, Callable[[], T]]:
        if self._loaders is None:
            own = self._own().items()
            loaders: dict[str, Callable[[], T]] = {
                name: partial(self._accepted_own, name, load) for name, load in own
            }
            sources = dict.fromkeys(loaders, "pytest-libero-max")
            for point in sorted(entry_points(group=self.group), key=lambda point: point.name):
                source = _distribution(point)
                if point.name in loaders:
                    raise self._error(
                        f"The {self.noun} {point.name!r} is offered twice, by {sources[point.name]} and by "
                        f"{source} (entry-point group {self.group!r}). Uninstall one of them or rename its "
                        f"{self.noun}."
                    )
                loaders[point.name] = self._loader(point)
                sources[point.name] = source
            self._loaders = loaders
        return self._loaders

    def _accepted(self, name: str, value: object) -> T:
        entry = self._accept(name, value)
        own = name if self._attribute is None else getattr(entry, self._attribute, None)
        if own != name:
            raise ValueError(
                f"{self._attribute}={own!r}, but it is registered as {name!r}; both must be the same"
            )
        return entry

    def _accepted_own(self, name: str, load: Callable[[], object]) -> T:
        return self._accepted(name, load())

    def _loader(self, point: EntryPoint) -> Callable[[], T]:
        def load() -> T:
            try:
                return self._accepted(point.name, self._read(point))
            except Exception as error:  # somebody else's module may raise anything
                raise self._error(
                    f"The {self.noun} {point.name!r} of {_distribution(point)} cannot be used: "
                    f"{point.value} ({type(error).__name__}: {error}). Repair the package or uninstall it."
                ) from error

        return load


def given(attribute: str, *things: object) -> Own:
    """Return things that are there already, named by an attribute of theirs."""
    return lambda: {getattr(thing, attribute): partial(_same, thing) for thing in things}


def references(package: str, objects: Callable[[], Mapping[str, str]]) -> Own:
    """Return objects of a package, each as ``MODULE:NAME`` by its name in the registry."""
    return lambda: {name: partial(_named, f"{package}.{reference}") for name, reference in objects().items()}


def listed_in(reference: str, attribute: str = "name") -> Own:
    """Return the things that a module lists, named by an attribute of theirs."""
    return lambda: given(attribute, *_named(reference))()


def classes_in(
    package: str, base: type[Any] | str, *, first: Collection[str] = (), skip: Collection[str] = ()
) -> Own:
    """Return the class of each module of a folder, called like the module.

    Args:
        base: The class that each extends, or ``MODULE:NAME`` of one that is imported late.
        skip: Modules without such a class.
    """

    def own() -> dict[str, Callable[[], object]]:
        names = dict.fromkeys((*first, *modules_in(package)))
        return {name: partial(class_in, f"{package}.{name}", base) for name in names if name not in skip}

    return own


def class_in(module: str, base: type[Any] | str) -> Any:
    """Import a module and return the one class in it that is defined there and extends ``base``."""
    base = _named(base) if isinstance(base, str) else base
    values = vars(importlib.import_module(module)).values()
    (kind,) = (
        value
        for value in values
        if isinstance(value, type) and issubclass(value, base) and value.__module__ == module
    )
    return kind


def modules_in(package: str) -> tuple[str, ...]:
    """Names of the modules in a package's folder, sorted; none of them is imported."""
    spec = importlib.util.find_spec(package)
    folders = spec.submodule_search_locations if spec is not None else None
    return tuple(sorted(module.name for module in pkgutil.iter_modules(folders or [])))


def _same(thing: object) -> object:
    return thing


def _named(reference: str) -> Any:
    module, _, name = reference.partition(":")
    return getattr(importlib.import_module(module), name)


def _distribution(point: EntryPoint) -> str:
    return point.dist.name if point.dist is not None else point.value


def _a(noun: str) -> str:
    return f"an {noun}" if noun[0] in "aeiou" else f"a {noun}"
