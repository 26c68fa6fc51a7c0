"""References by which a user names a policy. Nothing here executes an adapter."""

from __future__ import annotations

import importlib.util
import os
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from functools import partial
from importlib.machinery import ModuleSpec, all_suffixes
from operator import attrgetter
from pathlib import Path

from pytest_libero_max.errors import AdapterError, did_you_mean
from pytest_libero_max.registry import Registry

DEFAULT_NAME = "policy"

_VERSION = re.compile(r"^VERSION = (\d+)$", re.MULTILINE)

GROUP = "pytest_libero_max.policies"
"""Entry point group by which an installed package offers policies by name."""

_PACKAGE = __name__.partition(".")[0]


def registry() -> Registry[str]:
    """Return the reference behind each name that stands for a policy by itself. Nothing is imported."""

    def own() -> dict[str, Callable[[], str]]:
        names = ("expert", "stale_expert", "noop", "random")
        return {name: partial(f"{_PACKAGE}.experts.{{}}:{{}}".format, name, DEFAULT_NAME) for name in names}

    return Registry("policy", GROUP, own, lambda _, value: str(value), AdapterError, attrgetter("value"))


POLICIES = registry()


def require_installed(name: str) -> None:
    """Check that a policy of this name is installed: programs are data and name no code."""
    if name not in POLICIES:
        raise AdapterError.seen(
            "policy",
            name,
            f" of an arm, but no policy of this name is installed. {did_you_mean(name, POLICIES)} A package "
            f"offers one in the entry-point group {GROUP}.",
        )


FORMS = "Give FILE.py, FILE.py:NAME, PACKAGE.MODULE, PACKAGE.MODULE:NAME, or the name of a policy (expert)."


@dataclass(frozen=True)
class Reference:
    """Reference to a policy."""

    text: str
    """The reference as the user typed it."""
    target: str
    """A path that ends in ``.py``, or the dotted name of a module."""
    name: str
    """Name to take from there: a policy, or a class or function that makes one."""

    @property
    def is_file(self) -> bool:
        """True if ``target`` is a path."""
        return self.target.endswith(".py")

    @property
    def where(self) -> str:
        """Name in an error."""
        return f"{self.target}:{self.name}"


def shipped_names() -> tuple[str, ...]:
    """Return the names of the policies that ship with the package."""
    return tuple(name for name in POLICIES if POLICIES[name].startswith(f"{_PACKAGE}."))


def shipped_version(reference: Reference) -> int | None:
    """Return the version of a policy that ships with the package; None for any other.

    It is ``VERSION`` in the policy's module, which is not imported. Raise it when the policy may act
    otherwise somewhere: runs of two versions are runs of two policies. A test compares actions with golden
    ones and says so where they differ. Names, comments, speed and modules are no reason; code that several
    policies share is one for each of them that it makes act otherwise.
    """
    if not reference.target.startswith(f"{_PACKAGE}."):
        return None
    file = file_of(reference)
    match = None if file is None else _VERSION.search(file.read_text(encoding="utf-8"))
    return None if match is None else int(match[1])


def refusal(text: str, rest: str) -> AdapterError:
    """Return the error about a reference: its text, and the rule and the cure with the punctuation before."""
    return AdapterError.seen("policy", text, rest)


def parse_reference(text: str) -> Reference:
    """Parse a reference.

    A word that is the name of a built-in or installed policy means that policy, whatever else has this name:
    ``random`` is the policy, ``random.py`` (or ``./random.py``) the file in the working directory, and
    ``random:policy`` the module.
    """
    names = set(POLICIES)
    reference = POLICIES[text] if text in names else text
    target, colon, name = reference.rpartition(":")
    if not colon or "/" in name or "\\" in name:  # the second: a Windows drive
        target, name = reference, DEFAULT_NAME
    target = os.path.expanduser(target)  # reports write the home folder as ~
    if name.isdigit():
        raise refusal(
            text, f" is no reference to a policy. The address of a server has a scheme: openpi://{text}"
        )
    if not name.isidentifier():
        raise refusal(text, f": {name!r} is not the name of anything in Python. {FORMS}")
    if not target.endswith(".py") and not all(part.isidentifier() for part in target.split(".")):
        raise refusal(
            text,
            f": {target!r} is neither a Python file nor the dotted name of a module."
            f"{_instead(Path(target), colon + name if colon else '')} {FORMS}",
        )
    return Reference(text, target, name)


def absolute_reference(text: str, folder: Path) -> str:
    """Return a reference that means the same in every working folder."""
    file, colon, name = text.rpartition(":")
    if not colon or not file.endswith(".py"):
        file, colon, name = text, "", ""
    if not file.endswith((".py", ".toml")) or "://" in file:
        return text
    return f"{folder / Path(file).expanduser()}{colon}{name}"


def _instead(path: Path, name: str) -> str:
    """Suggest a correction of a path that is not a Python file."""
    file = path.with_name(f"{path.name}.py") if path.name else path
    if file.is_file():
        return f" Did you mean '{file}{name}'?"
    return f" {str(path)!r} is a folder; an adapter is a file in it." if path.is_dir() else ""


def file_of(reference: Reference) -> Path | None:
    """Return the file of a reference, without importing anything; None for a module that is not a file."""
    return _existing_file(reference) if reference.is_file else _module_file(reference)


def _existing_file(reference: Reference) -> Path:
    path, folder = Path(reference.target), Path(reference.target).parent
    if path.is_file():
        return path.resolve()
    if path.is_dir():
        raise refusal(
            reference.text, f": {str(path)!r} is a folder, but an adapter is a file. Give the file."
        )
    if not folder.is_dir():
        raise refusal(reference.text, f": there is no folder {str(folder)!r}. Check the path.")
    siblings = sorted(file.name for file in folder.glob("*.py"))
    close = get_close_matches(path.name, siblings, n=1, cutoff=0.5)
    hint = f"Did you mean {str(folder / close[0])!r}?" if close else "Check the path."
    raise refusal(reference.text, f": there is no file {str(path)!r}. {hint}")


def _module_file(reference: Reference) -> Path | None:
    top, *rest = reference.target.split(".")
    spec = find_spec(top)
    if spec is None:
        raise no_module(reference, top)
    if not rest:
        if spec.origin is None and spec.submodule_search_locations is not None:
            raise refusal(
                reference.text,
                f": {top!r} is a folder without __init__.py, but an adapter is a "
                "file or a module. Give the file in it.",
            )
        return Path(spec.origin).resolve() if spec.has_location and spec.origin else None
    file = submodule_file(spec.submodule_search_locations or (), rest)
    return None if file is None else file.resolve()


def submodule_file(folders: Iterable[str], parts: Iterable[str]) -> Path | None:
    """Return the file of a module below a package's folders, found by its path; None where there is none."""
    for folder in map(Path, folders):
        place = folder.joinpath(*parts)
        for file in (place / "__init__.py", *(place.with_name(place.name + end) for end in all_suffixes())):
            if file.is_file():
                return file
    return None


def find_spec(name: str) -> ModuleSpec | None:
    """Return the spec of a module, which is not imported (its packages are); None where there is none."""
    try:
        return importlib.util.find_spec(name)
    except (ImportError, ValueError):
        return None


def no_module(reference: Reference, missing: str) -> AdapterError:
    """Return the error for a module that is not there."""
    if reference.text == reference.target and "." not in reference.target:
        return refusal(
            reference.text,
            f" is neither the name of a policy nor a module on the import path. "
            f"{did_you_mean(reference.text, POLICIES)} For an adapter of your own, give its file: "
            f"{reference.text}.py.",
        )
    return refusal(
        reference.text,
        f": there is no module {missing!r} on the import path. Install it, put "
        f"its folder on PYTHONPATH, or give the file: {reference.target.replace('.', '/')}.py.",
    )
