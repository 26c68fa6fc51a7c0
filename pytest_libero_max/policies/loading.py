"""Loading an adapter: from a reference a user types to a checked policy."""

from __future__ import annotations

import ast
import hashlib
import importlib
import importlib.util
import inspect
import re
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from types import ModuleType
from typing import Any

from pytest_libero_max.errors import AdapterError, did_you_mean
from pytest_libero_max.policies.check import check_policy, locate
from pytest_libero_max.policies.contract import Policy

DEFAULT_NAME = "policy"
HORIZON_FLAG = "--libero-max-horizon"
QUERY_INTERVAL_FLAG = "--libero-max-query-interval"

BUILT_IN = {
    name: f"pytest_libero_max.experts.{name}" for name in ("expert", "stale_expert", "noop", "random")
}
"""Policies that ship with the package, by the name that loads them."""

_PRIVATE = "_pytest_libero_max_adapter_"
_FORMS = "Give FILE.py, FILE.py:NAME, PACKAGE.MODULE or PACKAGE.MODULE:NAME."


def load_policy(reference: str, *, horizon: int | None = None, query_interval: int | None = None) -> Policy:
    """Load the policy that ``reference`` names.

    The reference is a file (``adapter.py``) or an importable module (``package.module``), with ``:name``
    for anything but the default name ``policy``. The name is a policy, or a class or function which returns
    one when it is called without arguments.

    A file is executed anew by every call, under a private module name. While it is executed, and while the
    policy is constructed, its folder stands at the end of ``sys.path``: a helper beside the adapter can be
    imported at its top, and a file called ``random.py`` never hides the standard library's. Helpers are
    forgotten afterwards, so that two adapters may each have a ``helper.py``.

    Args:
        reference: What the user typed.
        horizon: Replaces H of the adapter's spec.
        query_interval: Replaces Q of the adapter's spec.

    Returns:
        The policy. With H or Q replaced, its ``spec`` attribute is set to the new spec before anything else
        is called, so an adapter that reads ``self.spec.horizon`` follows the override; for a policy instance
        in an importable module that lasts as long as the module.

    Raises:
        AdapterError: Nothing can be loaded from there, or it is no policy; the message says what is missing.
    """
    target, name = _parse(reference)
    where = f"{target}:{name}"
    if target.endswith(".py"):
        path = _existing_file(Path(target), reference)
        with _importable(path.parent):
            policy = _construct(_find(_execute(path), name, where), where, path)
    else:
        module = _import(target, reference)
        policy = _construct(_find(module, name, where), where, Path(module.__file__ or target))
    return _override(check_policy(policy, where), where, horizon, query_interval)


def check_reference(reference: str) -> None:
    """Find what is wrong with a reference without executing anything.

    For whoever only hands out the work: the weights belong into the processes that play.

    Raises:
        AdapterError: The file or its name does not exist, or it is not Python.
    """
    target, name = _parse(reference)
    if not target.endswith(".py"):
        return
    path = _existing_file(Path(target), reference)
    try:
        tree = ast.parse(path.read_bytes(), str(path))
    except (SyntaxError, ValueError) as error:
        raise _failed(error, path, "reading it") from error
    defined = _defined_names(tree.body)
    if name not in defined and "*" not in defined:
        raise _no_such_name(f"{target}:{name}", name, [known for known in defined if known[:1] != "_"])


def _defined_names(statements: Iterable[ast.stmt]) -> set[str]:
    """Names bound at the top of a module, also within ``if``, ``try`` and ``with``."""
    names: set[str] = set()
    for statement in statements:
        if isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            names.add(statement.name)
        elif isinstance(statement, ast.Import | ast.ImportFrom):
            names |= {alias.asname or alias.name.partition(".")[0] for alias in statement.names}
        else:
            names |= {
                node.id
                for node in ast.walk(statement)
                if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
            }
        for block in ("body", "orelse", "finalbody"):
            if isinstance(statement, ast.If | ast.Try | ast.With | ast.For | ast.While):
                names |= _defined_names(getattr(statement, block, []))
        for handler in getattr(statement, "handlers", []):
            names |= _defined_names(handler.body)
    return names


def _parse(reference: str) -> tuple[str, str]:
    if re.match(r"[A-Za-z][A-Za-z0-9+.-]*://", reference):
        raise AdapterError(
            f"policy={reference!r} is the address of a policy server, which is not supported yet. {_FORMS} "
            "An adapter may talk to a server itself, in predict."
        )
    reference = BUILT_IN.get(reference, reference)
    target, colon, name = reference.rpartition(":")
    if not colon or "/" in name or "\\" in name:  # the second: a Windows drive
        target, name = reference, DEFAULT_NAME
    if not name.isidentifier():
        raise AdapterError(f"policy={reference!r}: {name!r} is not the name of anything in Python. {_FORMS}")
    is_module = all(part.isidentifier() for part in target.split("."))
    if not target.endswith(".py") and not is_module:
        raise AdapterError(
            f"policy={reference!r}: {target!r} is neither a Python file nor the dotted name of a module. "
            f"{_FORMS}"
        )
    return target, name


def _existing_file(path: Path, reference: str) -> Path:
    if path.is_file():
        return path.resolve()
    folder = path.parent
    if not folder.is_dir():
        raise AdapterError(f"policy={reference!r}: there is no folder {str(folder)!r}. Check the path.")
    siblings = sorted(file.name for file in folder.glob("*.py"))
    close = get_close_matches(path.name, siblings, n=1, cutoff=0.5)
    hint = f"Did you mean {str(folder / close[0])!r}?" if close else "Check the path."
    raise AdapterError(f"policy={reference!r}: there is no file {str(path)!r}. {hint}")


@contextmanager
def _importable(folder: Path) -> Iterator[None]:
    entry = str(folder)
    before = {name.partition(".")[0] for name in sys.modules}
    # Last, not first: an adapter called random.py or numpy.py must not shadow what it imports itself.
    sys.path.append(entry)
    importlib.invalidate_caches()
    try:
        yield
    finally:
        del sys.path[len(sys.path) - 1 - sys.path[::-1].index(entry)]
        importlib.invalidate_caches()
        for name in sorted({name.partition(".")[0] for name in sys.modules} - before):
            if _is_inside(sys.modules[name], folder):
                _forget_helper(name)


def _is_inside(module: ModuleType, folder: Path) -> bool:
    places = [getattr(module, "__file__", None), *getattr(module, "__path__", ())]
    place = next((place for place in places if place), None)
    return place is not None and Path(place).resolve().is_relative_to(folder)


def _forget_helper(name: str) -> None:
    """Drop a module and its submodules unless it can be imported without the adapter's folder."""
    module = sys.modules.pop(name)
    if name.startswith(_PRIVATE) or importlib.util.find_spec(name) is not None:
        sys.modules[name] = module
        return
    for submodule in [other for other in sys.modules if other.startswith(f"{name}.")]:
        del sys.modules[submodule]


def _execute(path: Path) -> ModuleType:
    name = _PRIVATE + hashlib.sha256(str(path).encode()).hexdigest()[:16]
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses and pickle look a class's module up here
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        raise _failed(error, path, "importing it") from error
    return module


def _import(target: str, reference: str) -> ModuleType:
    try:
        return importlib.import_module(target)
    except ModuleNotFoundError as error:
        if error.name is None or not (target == error.name or target.startswith(error.name + ".")):
            raise _failed(error, _origin(target), "importing it") from error
        raise AdapterError(
            f"policy={reference!r}: there is no module {error.name!r} on the import path. Install it, put "
            f"its folder on PYTHONPATH, or give the file: {target.replace('.', '/')}.py."
        ) from error
    except (Exception, SystemExit) as error:
        raise _failed(error, _origin(target), "importing it") from error


def _origin(module: str) -> Path:
    spec = importlib.util.find_spec(module)
    return Path(spec.origin if spec is not None and spec.origin else module)


def _find(module: ModuleType, name: str, where: str) -> Any:
    try:
        return getattr(module, name)
    except AttributeError:
        public = [
            known
            for known, value in vars(module).items()
            if not known.startswith("_")
            and not isinstance(value, ModuleType)
            and getattr(value, "__module__", None) == module.__name__
        ]
        raise _no_such_name(where, name, public) from None


def _no_such_name(where: str, name: str, public: Iterable[str]) -> AdapterError:
    known = did_you_mean(name, public) or "It defines no public name."
    return AdapterError(
        f"{where}: the adapter defines no {name!r}. {known} Rename it, or name it as FILE.py:NAME."
    )


def _construct(thing: Any, where: str, path: Path) -> Any:
    if not inspect.isclass(thing) and (hasattr(thing, "predict") or not callable(thing)):
        return thing
    try:
        inspect.signature(thing).bind()
    except ValueError:  # an extension type that does not tell its signature
        pass
    except TypeError as error:
        raise AdapterError(
            f"{where} cannot be called without arguments ({error}), but must be a policy, or a class or "
            "function that returns one when it is called without arguments. Give its arguments defaults, or "
            "write `policy = ...` with the arguments in the adapter."
        ) from None
    try:
        return thing()
    except (Exception, SystemExit) as error:
        raise _failed(error, path, f"calling {where}()") from error


def _failed(error: BaseException, path: Path, doing: str) -> AdapterError:
    if isinstance(error, SyntaxError) and error.filename == str(path):
        place = f"{path.name}, line {error.lineno}"
    else:
        place = locate(error, str(path)) or path.name
    return AdapterError(
        f"{place}: {type(error).__name__} while {doing}: {error}. Repair the adapter; `python {path.name}` "
        "in its folder shows the error alone."
    )


def _override(policy: Policy, where: str, horizon: int | None, query_interval: int | None) -> Policy:
    if horizon is None and query_interval is None:
        return policy
    spec = policy.spec
    new_horizon = spec.horizon if horizon is None else horizon
    new_interval = spec.query_interval if query_interval is None else query_interval
    if new_interval > new_horizon:
        raise AdapterError(
            f"query_interval={new_interval} ({_whose(query_interval, QUERY_INTERVAL_FLAG)}) > "
            f"horizon={new_horizon} ({_whose(horizon, HORIZON_FLAG)}) of policy {spec.name!r}: a query "
            f"returns at most H actions, so Q <= H. Lower {QUERY_INTERVAL_FLAG} or raise {HORIZON_FLAG}."
        )
    changed = replace(spec, horizon=new_horizon, query_interval=new_interval)
    try:
        policy.spec = changed
    except AttributeError as error:
        raise AdapterError(
            f"{where}.spec cannot be assigned ({error}), but {HORIZON_FLAG} and {QUERY_INTERVAL_FLAG} "
            "replace it. Make `spec` a plain attribute, or leave the flags out."
        ) from error
    return policy


def _whose(override: int | None, flag: str) -> str:
    return "declared by the adapter" if override is None else flag
