"""Checks of a policy: that it has the members of the contract, and that its actions can be played."""

from __future__ import annotations

import hashlib
import inspect
import pickle
import sys
import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import (
    ActionError,
    AdapterError,
    LimitReached,
    RefusalError,
    ServerError,
    class_name,
    counted,
    did_you_mean,
    text_of,
)
from pytest_libero_max.policies.answers import Unplayable, read_rows
from pytest_libero_max.policies.contract import (
    BatchItem,
    BatchPolicy,
    Episode,
    MemoryKind,
    Policy,
    PolicySpec,
    Query,
    RemembersPolicy,
    SeeingPolicy,
)
from pytest_libero_max.policies.files_read import FILES_READ
from pytest_libero_max.worlds.contract import FARTHEST_M, Observation, World
from pytest_libero_max.worlds.rendering import gl

Actions = NDArray[np.float64]

MOST_TURN_RAD = 2 * np.pi + 1e-3
"""Largest rotation of an absolute action; the rotations of either sign of a quaternion are below."""


_OPTIONAL = MappingProxyType(
    {"snapshot": (), "restore": ("memory",), "see": ("observation", "step"), "predict_batch": ("items",)}
)
"""Methods that a policy may offer, with their arguments."""


def check_policy(policy: Any, where: str) -> Policy:
    """Return ``policy`` if it has every member of the Policy contract.

    Raises:
        AdapterError: A member is missing, is of the wrong type, or cannot be called the way it will be.
    """
    if not hasattr(policy, "spec"):
        raise AdapterError(
            f"{where} ({class_name(policy)}) has no attribute 'spec', but a policy declares itself with "
            "a PolicySpec. Add `spec = PolicySpec(name=...)`."
        )
    if not isinstance(policy.spec, PolicySpec):
        raise AdapterError.seen(
            f"{where}.spec", policy.spec, ", but must be a PolicySpec. Write `spec = PolicySpec(name=...)`."
        )
    _check_method(policy, "reset", where, "episode")
    _check_method(policy, "predict", where, "observation", "query")
    offered = [name for name in ("snapshot", "restore") if hasattr(policy, name)]
    if len(offered) == 1:
        missing = "restore" if offered == ["snapshot"] else "snapshot"
        raise AdapterError(
            f"{where} offers {offered[0]} but not {missing}; a policy with memory has both, one without has "
            f"neither. Add {missing}."
        )
    for name, arguments in _OPTIONAL.items():
        if hasattr(policy, name):
            _check_method(policy, name, where, *arguments)
    checked: Policy = policy
    return checked


def check_cameras(policy: Policy, world: World) -> None:
    """Check that a scene has the cameras of which a policy wants images, and that they can be drawn."""
    known = world.cameras
    for camera in policy.spec.cameras:
        if camera not in known:
            raise AdapterError.seen(
                "camera",
                camera,
                f" of policy {policy.spec.name!r} does not exist in scene {world.scene}. "
                f"{did_you_mean(camera, known)}",
            )
    if policy.spec.cameras:
        gl.require()
        from pytest_libero_max.worlds.rendering.renderer import require_images

        require_images()


def require_spec(policy: Policy, spec: PolicySpec, where: str) -> None:
    """Check that the policy's spec is unchanged."""
    if policy.spec == spec:
        return
    now = policy.spec
    names = (item.name for item in fields(spec))
    name = next((name for name in names if getattr(now, name, None) != getattr(spec, name)), None)
    before, after = (spec, now) if name is None else (getattr(spec, name), getattr(now, name, None))
    raise RefusalError(
        f"policy {spec.name!r} changed its spec in {where}: {name or 'spec'}={before!r} became {after!r}. "
        "The spec is part of every result: declare it when the policy is constructed, and leave it."
    )


def remembers(policy: Policy) -> bool:
    """Return True if the policy's memory can be copied (see :class:`RemembersPolicy`)."""
    return hasattr(policy, "snapshot") and hasattr(policy, "restore")


def sees(policy: Policy) -> bool:
    """Return True if the policy is shown every step (see :class:`SeeingPolicy`)."""
    return hasattr(policy, "see")


def memory_of(policy: Policy) -> MemoryKind:
    """Return the way to bring the policy's memory to the event, given the methods that it offers."""
    if remembers(policy):
        return "snapshot"
    if sees(policy):
        return "frames"
    return "queries" if policy.spec.history else "none"


def batches(policy: Policy) -> bool:
    """Return True if the policy can answer several queries together (see :class:`BatchPolicy`)."""
    return hasattr(policy, "predict_batch")


def check_actions(value: Any, spec: PolicySpec) -> Actions:
    """Return the answer to a query as a fresh C-contiguous (n, d) float64 array, Q <= n <= H.

    d is the number of components of the policy's robot, 7 for LIBERO's. A single action may come as a (d,)
    vector, which counts as n = 1 and so is enough only for Q = 1; a batch of one, (1, n, d), is its chunk.
    Components beyond +-1 are left alone: the controller clips them, as it does for LIBERO.

    Raises:
        ActionError: Not numbers, not that shape, too few, too many, or not finite; or, under absolute
            control, a pose that no hand could have.
    """
    width = spec.components
    expected = f"an (n, {width or 'd'}) array with {spec.query_interval} <= n <= {spec.horizon}"
    try:
        actions = read_rows(value)
    except Unplayable as error:
        rule = error.rule or f"predict must return {expected} of real numbers"
        raise ActionError(
            f"policy {spec.name!r} returned {error.what}, but {rule}. {error.cure}".rstrip()
        ) from error
    if width is not None and actions.shape[1] != width:
        raise ActionError(
            f"policy {spec.name!r} returned actions of shape {np.shape(value)}, but predict must return "
            f"{expected}."
        )
    count = len(actions)
    if count < spec.query_interval:
        raise ActionError(
            f"policy {spec.name!r} returned {counted(count, 'action')}, but "
            f"query_interval={spec.query_interval} are "
            f"executed before the next query: return {expected}, or lower Q."
        )
    if count > spec.horizon:
        raise ActionError(
            f"policy {spec.name!r} returned {count} actions > horizon={spec.horizon}, but a query returns at "
            f"most H. Return actions[: self.spec.horizon], or raise H."
        )
    if spec.control == "absolute":
        _check_poses(actions, spec)
    return actions


def _check_poses(actions: Actions, spec: PolicySpec) -> None:
    """Refuse poses that are metres away or have more than a whole turn."""
    for what, columns, most, cure in (
        ("position", slice(0, 3), FARTHEST_M, "metres from the world's origin. It is in other units, or"),
        ("rotation", slice(3, -1), MOST_TURN_RAD, "rad. It is in degrees, or no axis times angle, or"),
    ):
        sizes = np.linalg.norm(actions[:, columns], axis=1)
        row = int(sizes.argmax())
        if sizes[row] > most:
            raise ActionError(
                f"policy {spec.name!r} (control='absolute') returned a {what} of size {sizes[row]:.4g} in "
                f"actions[{row}], but a pose of the hand has at most {most:.4g} {cure} normalised still: "
                "repair the adapter."
            )


def start(policy: Policy, episode: Episode) -> None:
    """``policy.reset(episode)``."""
    with _blaming(policy, "reset"), FILES_READ.resetting():
        policy.reset(episode)


def show(policy: Policy, observation: Observation, step: int) -> None:
    """``policy.see(observation, step)``, for a policy that :func:`sees`."""
    seeing: SeeingPolicy = policy  # type: ignore[assignment]  # sees() looked
    with _blaming(policy, f"see, step {step}"):
        seeing.see(observation, step)


def ask(policy: Policy, observation: Observation, query: Query) -> Actions:
    """Return the policy's checked answer, (n, 7) with Q <= n <= H. One that sees is shown it first.

    Raises:
        ActionError: The answer cannot be played; see :func:`check_actions`.
        AdapterError: The policy raised; the original is chained.
        ServerError: The policy's server was given up.
    """
    spec, where = policy.spec, f"query {query.index} at step {query.step}"
    if sees(policy):
        show(policy, observation, query.step)
    with _blaming(policy, f"predict, {where}"):
        answer = policy.predict(observation, query)
    try:
        return check_actions(answer, spec)
    except ActionError as error:
        raise error.within(where) from error


def notes_of(policy: Policy) -> dict[str, int] | None:
    """Return the counts of a policy at its last query (``query_notes``); None where it offers none."""
    notes = getattr(policy, "query_notes", None)
    if notes is None:
        return None
    counts = dict(notes) if isinstance(notes, Mapping) else {}
    if counts != notes or not all(type(name) is str and _is_count(n) for name, n in counts.items()):
        raise AdapterError.seen(
            "query_notes",
            notes,
            f" of policy {policy.spec.name!r}, but must be counts by name, integers of "
            "at least 0. They are added up in the record.",
        )
    return {name: int(count) for name, count in counts.items()}


def _is_count(value: object) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool) and int(value) >= 0


def ask_together(policy: Policy, items: Sequence[BatchItem]) -> list[Actions]:
    """Return the checked answers to several queries, of a policy that :func:`batches`; see :func:`ask`."""
    together: BatchPolicy = policy  # type: ignore[assignment]  # batches() looked
    with _blaming(policy, f"predict_batch, {counted(len(items), 'item')}"):
        answers = list(together.predict_batch(items))
    if len(answers) != len(items):
        raise AdapterError(
            f"policy {policy.spec.name!r} returned {counted(len(answers), 'answer')} from predict_batch for "
            f"{counted(len(items), 'item')}. Return one array of actions for each, in their order."
        )
    return [check_actions(answer, policy.spec) for answer in answers]


def copy_memory(policy: Policy) -> object:
    """``policy.snapshot()``, or None for a policy that has none."""
    if not remembers(policy):
        return None
    remembering: RemembersPolicy = policy  # type: ignore[assignment]  # remembers() looked
    with _blaming(policy, "snapshot"):
        return remembering.snapshot()


def memory_digest(memory: object) -> bytes | None:
    """Fingerprint of a copied memory, to notice later changes; None if it cannot be pickled."""
    try:
        pickled = pickle.dumps(memory, protocol=5)
    except Exception:  # whatever a foreign object raises: it then goes unchecked
        return None
    return hashlib.sha256(pickled).digest()


def restore_memory(policy: Policy, memory: object) -> None:
    """``policy.restore(memory)``, for a policy that :func:`remembers`."""
    remembering: RemembersPolicy = policy  # type: ignore[assignment]  # remembers() looked
    with _blaming(policy, "restore"):
        remembering.restore(memory)


def _check_method(policy: Any, name: str, where: str, *arguments: str) -> None:
    form = f"{name}({', '.join(arguments)})"
    if not hasattr(policy, name):
        raise AdapterError(
            f"{where} ({class_name(policy)}) has no method {name!r}, but a policy has "
            f"reset(episode) and predict(observation, query). Add {form}."
        )
    method = getattr(policy, name)
    if not callable(method):
        raise AdapterError.seen(
            f"{where}.{name}", method, f" is not callable, but must be the method {form}."
        )
    try:
        signature = inspect.signature(method)
    except ValueError:  # an extension method that does not tell its signature
        return
    try:
        signature.bind(*arguments)
    except TypeError as error:
        raise AdapterError(
            f"{where}.{name}{signature} cannot be called as {form}: {error}. Give it these arguments."
        ) from None


def locate(error: BaseException, file: str) -> str | None:
    """``name.py, line n``: the innermost place in ``file`` through which the error went, or None."""
    frames = traceback.extract_tb(error.__traceback__)
    line = next((frame.lineno for frame in reversed(frames) if frame.filename == file), None)
    return None if line is None else f"{Path(file).name}, line {line}"


def ends_the_session(error: BaseException) -> bool:
    """Return True if an exception has to pass: an interrupt, a time limit, or one of pytest's own.

    Every other exception of an adapter is the adapter's fault, also one that is not an ``Exception``: an
    ``asyncio.CancelledError``, a ``SystemExit``, a ``GeneratorExit``.
    """
    ours = isinstance(error, (KeyboardInterrupt, LimitReached))
    return ours or type(error).__module__.startswith("_pytest.")


@contextmanager
def _blaming(policy: Policy, what: str) -> Iterator[None]:
    """Turn exceptions of the policy in the block into an AdapterError, except a ServerError."""
    try:
        yield
    except BaseException as error:
        left = type(error).__module__ == "_pytest.outcomes" and class_name(error) == "Exit"
        if (ends_the_session(error) and not left) or isinstance(error, ServerError):
            raise
        module = sys.modules.get(type(policy).__module__)
        place = locate(error, getattr(module, "__file__", None) or "")
        raise AdapterError(
            f"policy {policy.spec.name!r} raised {class_name(error)} in {what}"
            f"{f' ({place})' if place else ''}: {text_of(error)}. Repair the adapter and play the pair again."
        ) from error
