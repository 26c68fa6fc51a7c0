"""Loading an adapter: from a reference a user types to a checked policy."""

from __future__ import annotations

import ast
import hashlib
import importlib
import importlib.util
import inspect
import sys
from collections.abc import Iterable
from pathlib import Path
from types import ModuleType
from typing import Any

from pytest_libero_max.errors import AdapterError, did_you_mean
from pytest_libero_max.events.schedules import Cadence
from pytest_libero_max.policies.cadence import at_cadence, declare
from pytest_libero_max.policies.check import check_policy, locate
from pytest_libero_max.policies.clients.address import is_served
from pytest_libero_max.policies.contract import Policy
from pytest_libero_max.policies.references import (
    Reference,
    file_of,
    find_spec,
    no_module,
    parse_reference,
    refusal,
    require_installed,
)

_PRIVATE = "_pytest_libero_max_adapter_"


def load_policy(
    text: str,
    *,
    horizon: int | None = None,
    query_interval: int | None = None,
    profile: str | None = None,
    revision: str | None = None,
    seat: int = 0,
    further: bool = False,
) -> Policy:
    """Load the policy that a reference names.

    The address of a server (``openpi://host:8000``) is connected to; ``profile`` is the profile of the policy
    behind it. Several addresses with commas between them, or a ``.toml`` file that lists them,
    are equal servers, or one group of servers for each suite.

    The reference is the name of a built-in or installed policy (``expert``), a file (``adapter.py``) or an
    importable module (``package.module``); the latter two with ``:name`` for anything but the default name
    ``policy``. The name is a policy, or a class or function which returns one when it is called without
    arguments.

    A file is executed anew by every call. Its folder then stands at the end of ``sys.path`` until another
    file is loaded: a helper beside the adapter can be imported at any time, also within ``predict`` and by a
    process that the adapter spawns, and a file called ``random.py`` never hides the standard library's. When
    another file is loaded, the helpers of the one before are forgotten, so that two adapters may each have a
    ``helper.py``. The module is called like the file, unless there is another module of that name: then it
    has a private name, and spawned processes cannot import it.

    Args:
        horizon: Replaces H of the adapter's spec.
        query_interval: Replaces Q of the adapter's spec.
        profile: Name or path of the profile of a policy behind a server.
        seat: Number of this process among those that play; spreads them over several servers.
        further: True for one more policy of this process: the adapter file before keeps its folder and its
            helpers (:func:`~.adapter_digest.require_separate_helpers`).

    Returns:
        The policy. With H or Q replaced, its ``spec`` attribute is set to the new spec before anything else
        is called, so an adapter that reads ``self.spec.horizon`` follows the override; for a policy instance
        in an importable module that lasts as long as the module.

    Raises:
        AdapterError: Nothing can be loaded from there, or it is no policy; names the missing part.
        ServerError: The server cannot be reached, or does not speak its protocol.
    """
    if is_served(text):
        from pytest_libero_max.policies.clients.fleet import open_fleet
        from pytest_libero_max.policies.clients.opening import open_server, parse_address
        from pytest_libero_max.policies.clients.servers import read_servers

        servers = read_servers(text, profile, revision).resolved()
        if len(servers.addresses) > 1 or servers.groups[0].marks or servers.name:
            return open_fleet(servers, seat, horizon, query_interval)
        (only,) = servers.groups
        return open_server(
            parse_address(only.addresses[0]), only.profile, horizon, query_interval, only.revision
        )
    _refuse_server_options(text, profile, revision)
    reference = parse_reference(text)
    path = file_of(reference)
    if reference.is_file:
        assert path is not None
        if further:
            _beside.append(_BesideAdapter())
        policy = _beside[-1 if further else 0].load(path, reference)
    else:
        module = _import(reference, path)
        policy = _construct(_find(module, reference), reference, path)
    return override(check_policy(policy, reference.where), horizon, query_interval)


def installed_policy(name: str) -> Policy:
    """Load a policy by the name under which it is installed, for an arm that names it."""
    require_installed(name)
    return load_policy(name)


def check_reference(text: str, profile: str | None = None, revision: str | None = None) -> None:
    """Check a reference without executing anything or connecting to a server.

    For processes that only hand out the work: the weights belong into those that play.

    Raises:
        AdapterError: The file, module or name does not exist, cannot be read, or is not Python; or
            the address or its profile cannot be used.
    """
    if is_served(text):
        from pytest_libero_max.policies.clients.servers import read_servers

        read_servers(text, profile, revision)
        return
    _refuse_server_options(text, profile, revision)
    reference = parse_reference(text)
    path = file_of(reference)
    if not reference.is_file:
        return
    assert path is not None
    try:
        tree = ast.parse(path.read_bytes(), str(path))
    except (SyntaxError, ValueError) as error:
        raise _failed(error, reference, path, "reading it") from error
    except OSError as error:
        raise refusal(text, f" cannot be read: {error}. Check the file's permissions.") from None
    defined = _defined_names(tree.body)
    if reference.name not in defined and "*" not in defined:
        raise _no_such_name(reference, [known for known in defined if known[:1] != "_"])


def _refuse_server_options(text: str, profile: str | None, revision: str | None) -> None:
    if revision is not None:
        raise refusal(
            text,
            f" with revision={revision!r}: that declares the weights behind servers, and this one is no "
            "address. Let the adapter declare PolicySpec(revision=...), and leave --libero-max-revision out.",
        )
    if profile is not None:
        parse_reference(text)  # which knows an address that lacks its scheme
        raise refusal(
            text,
            f" with profile={profile!r}: a profile says how a policy behind a server is "
            "asked, and this one is no address (openpi://host:8000). Leave --libero-max-profile out.",
        )


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


class _BesideAdapter:
    """The folder of the adapter file that was loaded last, at the end of ``sys.path``."""

    def __init__(self) -> None:
        self._folder: Path | None = None
        self._appended = False
        self._before: frozenset[str] = frozenset()

    def load(self, path: Path, reference: Reference) -> Any:
        """Execute a file and construct its policy; the helpers of the file before are forgotten."""
        self.leave()
        self._enter(path.parent)
        try:
            return _construct(_find(_execute(path, reference), reference), reference, path)
        except BaseException:
            self.leave()
            raise

    def _enter(self, folder: Path) -> None:
        self._folder, self._before = folder, frozenset(sys.modules)
        self._appended = str(folder) not in sys.path
        if self._appended:
            # Last, not first: an adapter called random.py or numpy.py must not hide what it imports itself.
            sys.path.append(str(folder))
        importlib.invalidate_caches()

    def leave(self) -> None:
        """Restore ``sys.path`` and ``sys.modules`` to their state without the adapter."""
        folder, self._folder = self._folder, None
        if folder is None:
            return
        if self._appended and str(folder) in sys.path:
            sys.path.remove(str(folder))
        importlib.invalidate_caches()
        new = [name for name in sys.modules if name not in self._before]
        for top in sorted({name.partition(".")[0] for name in new}):
            family = [name for name in new if name.partition(".")[0] == top]
            if any(_is_inside(name, folder) for name in family) and not _found_elsewhere(top):
                for name in family:
                    del sys.modules[name]


_beside = [_BesideAdapter()]
"""The adapter files of this process: the one that was loaded last, and those that play beside it."""


def forget_adapter() -> None:
    """Restore ``sys.path`` and ``sys.modules`` to their state without the adapter files that were loaded."""
    while len(_beside) > 1:
        _beside.pop().leave()
    _beside[0].leave()


def _module_name(path: Path) -> str:
    """Return the name under which to execute a file: a private one if an import of its own finds another."""
    if path.stem not in sys.modules and path.stem.isidentifier():
        spec = find_spec(path.stem)
        if spec is not None and spec.origin is not None and Path(spec.origin).resolve() == path:
            return path.stem
    return _PRIVATE + hashlib.sha256(str(path).encode()).hexdigest()[:16]


def _is_inside(name: str, folder: Path) -> bool:
    module = sys.modules.get(name)
    paths = getattr(module, "__path__", ())  # PyTorch has modules that answer for every name
    places = [getattr(module, "__file__", None), *(paths if isinstance(paths, Iterable) else ())]
    place = next((place for place in places if isinstance(place, str) and place), None)
    return place is not None and Path(place).resolve().is_relative_to(folder)


def _found_elsewhere(name: str) -> bool:
    """Return True if the same module would be found without the adapter's folder."""
    module = sys.modules.pop(name, None)
    try:
        spec = find_spec(name)
        return spec is not None and (module is None or spec.origin == getattr(module, "__file__", None))
    finally:
        if module is not None:
            sys.modules[name] = module


def _execute(path: Path, reference: Reference) -> ModuleType:
    try:
        return execute_file(_module_name(path), path)
    except (Exception, SystemExit) as error:
        raise _failed(error, reference, path, "importing it") from error


def execute_file(name: str, path: Path) -> ModuleType:
    """Execute a file as the module of a name, and return it; what it raises is passed on."""
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses and pickle look a class's module up here
    spec.loader.exec_module(module)
    return module


def _import(reference: Reference, path: Path | None) -> ModuleType:
    target = reference.target
    try:
        return importlib.import_module(target)
    except ModuleNotFoundError as error:
        if error.name is None or not (target == error.name or target.startswith(error.name + ".")):
            raise _failed(error, reference, path, "importing it") from error
        raise no_module(reference, error.name) from error
    except (Exception, SystemExit) as error:
        raise _failed(error, reference, path, "importing it") from error


def _find(module: ModuleType, reference: Reference) -> Any:
    try:
        return getattr(module, reference.name)
    except AttributeError:
        public = [
            known
            for known, value in vars(module).items()
            if not known.startswith("_")
            and not isinstance(value, ModuleType)
            and getattr(value, "__module__", None) == module.__name__
        ]
        raise _no_such_name(reference, public) from None


def _no_such_name(reference: Reference, public: Iterable[str]) -> AdapterError:
    known = did_you_mean(reference.name, public) or "It defines no public name."
    form = "FILE.py:NAME" if reference.is_file else "PACKAGE.MODULE:NAME"
    return AdapterError(
        f"{reference.where}: the adapter defines no {reference.name!r}. {known} Rename it, or name it as "
        f"{form}."
    )


def _construct(thing: Any, reference: Reference, path: Path | None) -> Any:
    if not inspect.isclass(thing) and (hasattr(thing, "predict") or not callable(thing)):
        return thing
    where = reference.where
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
        raise _failed(error, reference, path, f"calling {where}()") from error


def _failed(error: BaseException, reference: Reference, path: Path | None, doing: str) -> AdapterError:
    place = reference.target if path is None else path.name
    if path is not None and isinstance(error, SyntaxError) and error.filename == str(path):
        place = f"{path.name}, line {error.lineno}"
    elif path is not None:
        place = locate(error, str(path)) or path.name
    alone = (
        f"`python {Path(reference.target).name}` in its folder"
        if reference.is_file
        else f'`python -c "import {reference.target}"`'
    )
    return AdapterError(
        f"{place}: {type(error).__name__} while {doing}: {error}. Repair the adapter; {alone} shows the "
        "error alone."
    )


def override(policy: Policy, horizon: int | None, query_interval: int | None) -> Policy:
    """Return a policy whose spec has another H or Q."""
    if horizon is None and query_interval is None:
        return policy
    interval = policy.spec.query_interval if query_interval is None else query_interval
    declare(policy, at_cadence(policy.spec, Cadence(interval, horizon)))
    return policy
