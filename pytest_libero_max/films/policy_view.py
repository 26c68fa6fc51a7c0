"""The images of a policy's queries, as it got them and, where known, as its model did.

The images are rendered again from the replayed world, in the cameras and size that the policy declares. Their
preprocessing is known for a policy behind a server, from its profile, and for an adapter with
``model_inputs``. That of another adapter cannot be seen.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Picture

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import AdapterError, ReportError
from pytest_libero_max.films.replay import Look, View, opening_m
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.pairing.trace import ArmTrace
from pytest_libero_max.policies.adapter_digest import adapter_digest, shown_identity
from pytest_libero_max.policies.clients.address import is_served
from pytest_libero_max.policies.clients.messages import Request
from pytest_libero_max.policies.contract import Episode, Policy, PolicySpec, Query, query_seed
from pytest_libero_max.policies.loading import load_policy
from pytest_libero_max.policies.model_inputs import as_image, model_inputs
from pytest_libero_max.policies.profile import Profile, load_profile, profile_names
from pytest_libero_max.policies.wrappers import WRAPPERS
from pytest_libero_max.policies.wrapping import WrappedPolicy
from pytest_libero_max.worlds.contract import Image, ImageSize, Observation, World

_GROUND = 96
_RESTORE = "restore="
_AS_DELIVERED = "the images as delivered, bottom row first"


@dataclass(frozen=True)
class Shown:
    """Conversion of an observation to the images of a query."""

    words: str
    """Owner of the images, for the caption."""
    images: Callable[[Observation, Query], Mapping[str, Image]]
    """The images by name, (H, W, 3) uint8 each, from an observation and its query."""
    instruction: Callable[[str], str] = str
    """Converts the policy's instruction to the model's."""
    policy: Policy | None = None
    """The policy where one was loaded; its episode is begun."""
    every_step: bool = False
    """The policy was shown every step, and not queries alone."""


def shown_by(ran: Json, adapter: str | None = None, profile: str | None = None) -> Shown:
    """Return views that can be shown of the policy of a run.

    Args:
        ran: ``policy`` of the run's provenance.
        adapter: The adapter of the run, to be loaded and asked; None: do not load it.
        profile: The profile of the run, where it is none of this package's.

    Raises:
        AdapterError: The adapter or the profile cannot be loaded, or is not the one of the run.
    """
    if adapter is not None:
        return _by_adapter(ran, adapter)
    if not is_served(str(ran["reference"])):
        if profile is not None:
            raise AdapterError.seen(
                "profile", profile, f", but policy {ran['reference']!r} is no server's address."
            )
        return Shown(f"{_AS_DELIVERED}; what the adapter does to them is not known", _delivered)
    profile_of_run = _profile_of(ran, profile)
    if profile_of_run is None:
        return Shown(f"{_AS_DELIVERED}; the profile is not known, give it with --profile", _delivered)
    if profile_of_run.get("policy", "declared_by_server", False):
        return Shown(f"{_AS_DELIVERED}, which are sent to the server unchanged", _delivered)
    request, every_step = Request(profile_of_run), profile_of_run.get("policy", "every_step", False)
    return Shown(
        f"the images {'of every step ' if every_step else ''}as profile {profile_of_run.name} sends them",
        lambda observation, query: _images_among(request.visible(observation)),
        request.instruction,
        every_step=every_step,
    )


def policy_look(
    case: Case, record: PairRecord, traces: Mapping[str, ArmTrace], shown: Shown, size: int
) -> tuple[Look, frozenset[int]]:
    """Return the policy's view of a world: its images at each query, kept until the next one.

    A policy that was shown every step is followed step by step.

    Returns:
        The look for :func:`~.replay.play_again`, and the policy steps after which it must be called.

    Raises:
        ReportError: The policy asked for no image.
    """
    cameras = tuple(record.policy.get("cameras", ()))
    if not cameras:
        raise ReportError(f"{record.item_id}: the policy asked for no images, so there is nothing it saw.")
    if shown.policy is not None:
        shown.policy.reset(
            Episode(case.suite, case.task_index, record.instruction, case.policy_seed, case.budget)
        )
    wrappers = _wrapped(record)
    number = {
        name: {int(step): index for index, step in enumerate(trace.query_steps)}
        for name, trace in traces.items()
    }

    # An adapter that was loaded tells what it hands to its model, which is asked at queries alone.
    is_seeing = shown.every_step or (record.policy.get("memory") == "frames" and shown.policy is None)

    def look(name: str, step: int, world: World, before: View | None) -> View:
        is_over, is_query = step >= record.arms[name].steps, step in number[name]
        if is_over or not (is_query or is_seeing):
            opening = opening_m(world, world.observe((), 1))
            return View(before.images, opening, before.words) if before else View({}, opening)
        instruction = world.language if case.instruction is None else case.instruction
        index = max(index for query_step, index in number[name].items() if query_step <= step)
        query = Query(index, step, instruction, query_seed(case.policy_seed, index))
        observation: Observation = world.observe(cameras, _size(record))
        for wrapper in wrappers:
            observation = wrapper.seen(observation)
        images = shown.images(observation, query)
        if not images:
            raise ReportError(f"{record.item_id}: there is no image among what the policy was shown.")
        words = [f"query {index} at step {step}" if is_query else f"step {step}"]
        if shown.instruction(instruction) != record.instruction:
            words.append(shown.instruction(instruction))
        pictures = {
            f"{label} {image.shape[1]}x{image.shape[0]}": fitted(image, size)
            for label, image in images.items()
        }
        return View(pictures, opening_m(world, observation), tuple(words))

    return look, frozenset(step for steps in number.values() for step in steps)


def caption(record: PairRecord, shown: Shown) -> str:
    """Return the caption of a film of a policy's view."""
    words = f"What the policy saw: {shown.words}"
    for wrapper in record.policy.get("wrappers", ()):
        words += f"; after {wrapper}" if _restores(wrapper) else f"; what {wrapper} does to them is not known"
    return words


def _wrapped(record: PairRecord) -> list[WrappedPolicy]:
    """Wrappers that show the policy other images than the world, from the outside in."""
    spec = PolicySpec("recorded", cameras=tuple(record.policy["cameras"]))
    return [
        WRAPPERS[_RESTORE[:-1]](_Recorded(spec), wrapper.removeprefix(_RESTORE))
        for wrapper in reversed(record.policy.get("wrappers", ()))
        if _restores(wrapper)
    ]


def _restores(wrapper: str) -> bool:
    """Return True for words of the wrapper whose images can be shown, where it is installed."""
    return wrapper.startswith(_RESTORE) and _RESTORE[:-1] in WRAPPERS


@dataclass
class _Recorded:
    """The recorded policy inside a wrapper; it is never queried."""

    spec: PolicySpec

    def reset(self, episode: Episode) -> None:
        """Do nothing."""

    def predict(self, observation: Observation, query: Query) -> NDArray[np.float64]:
        raise AssertionError("a recorded policy is asked nothing")


def fitted(image: Image, size: int) -> Image:
    """Return an image in a square picture, its proportions kept. Pixels are repeated or averaged.

    Args:
        image: (H, W, 3) uint8.
        size: Side of the picture, pixels.
    """
    height, width = image.shape[:2]
    scale = size / max(height, width)
    sides = max(round(width * scale), 1), max(round(height * scale), 1)
    how = Picture.Resampling.NEAREST if scale >= 1 else Picture.Resampling.BOX
    small = Picture.fromarray(np.ascontiguousarray(image)).resize(sides, how)
    ground = Picture.new("RGB", (size, size), (_GROUND,) * 3)
    ground.paste(small, ((size - sides[0]) // 2, (size - sides[1]) // 2))
    return np.array(ground)


def _size(record: PairRecord) -> ImageSize:
    size = record.policy["image_size"]
    return (int(size[0]), int(size[1])) if isinstance(size, list) else int(size)


def _delivered(observation: Observation, query: Query) -> dict[str, Image]:
    suffix = "_image"
    return {
        name.removesuffix(suffix): np.asarray(image)
        for name, image in observation.items()
        if name.endswith(suffix)
    }


def _images_among(arrays: Mapping[str, NDArray[Any]]) -> dict[str, Image]:
    return {name: image for name, array in arrays.items() if (image := as_image(array)) is not None}


def _by_adapter(ran: Json, adapter: str) -> Shown:
    _require_same(ran, adapter_digest(adapter), f"adapter={adapter!r}")
    policy = load_policy(adapter)

    def images(observation: Observation, query: Query) -> dict[str, Image]:
        inputs = model_inputs(policy, observation, query)
        if inputs is None:
            raise AdapterError(
                f"policy {policy.spec.name!r} has no model_inputs(observation, query), so what it does to "
                "its images cannot be seen. Offer it, or leave --adapter out for the images as delivered."
            )
        return _images_among(inputs)

    return Shown(f"the images as {adapter} hands them to its model", images, policy=policy)


def _profile_of(ran: Json, named: str | None) -> Profile | None:
    """Return the profile of a run, whose digest its provenance has; None where it is not found."""
    if named is not None:
        profile = load_profile(named)
        _require_same(ran, profile.digest, f"profile={named!r}")
        return profile
    known = map(load_profile, profile_names())  # a file that the run names is not opened
    return next((profile for profile in known if profile.digest == ran.get("code")), None)


def _require_same(ran: Json, digest: str, what: str) -> None:
    if ran.get("code") not in (None, digest):
        raise AdapterError(
            f"{what} ({shown_identity(digest)}) is not what the run was played with "
            f"({shown_identity(str(ran['code']))}), so what it shows would not be what the policy saw."
        )
