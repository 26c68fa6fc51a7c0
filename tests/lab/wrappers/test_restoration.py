"""The restoration of images: what is found, what is changed, and what passes untouched."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from pytest_libero_max.changes.pixels import SensorCorruption
from pytest_libero_max.errors import AdapterError
from pytest_libero_max.lab.wrappers.restoration import COUNTS, RestoringPolicy, assess, restore
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.pairing.runner import play_pair
from pytest_libero_max.policies.check import check_policy, notes_of, remembers
from pytest_libero_max.policies.contract import Episode, Policy, PolicySpec, Query
from pytest_libero_max.policies.loading import load_policy
from pytest_libero_max.substrates.tiny.world import TinyWorld
from pytest_libero_max.worlds.contract import Image, Observation
from pytest_libero_max.worlds.robot import CAMERAS
from tests.pairing.actors import Approaching, make_case

SETTINGS = [(24.0, 0.08), (36.0, 0.16)]
"""Noise and covered share of the benchmark's two variants."""
QUERY = Query(0, 0, "", 1)


class Looks:
    """Keeps what it is shown."""

    def __init__(self, **spec: object) -> None:
        self.spec = PolicySpec("looks", **spec)  # type: ignore[arg-type]
        self.shown: list[Observation] = []

    def reset(self, episode: Episode) -> None:
        self.shown.clear()

    def predict(self, observation: Observation, query: Query) -> NDArray[np.float64]:
        self.shown.append(observation)
        return np.zeros((1, 7))


@pytest.fixture(scope="module")
def world() -> Iterator[TinyWorld]:
    world = TinyWorld()
    yield world
    world.close()


@pytest.fixture(scope="module")
def images(world: TinyWorld) -> list[Image]:
    """A rendered image of each camera, and one that is all texture and edges."""
    world.reset(0)
    rendered = world.observe(CAMERAS, 256)
    rows, columns = np.mgrid[:256, :256]
    tiles = 90 + 60 * ((rows // 32 + columns // 32) % 2) + 20 * np.sin(columns / 9)
    return [
        *(rendered[f"{camera}_image"] for camera in CAMERAS),
        np.stack([tiles] * 3, axis=2).astype(np.uint8),
    ]


def corrupted(image: Image, noise: float, covered: float, step: int = 3) -> Image:
    return SensorCorruption(noise, covered, 7)(image, "agentview", step)


@pytest.mark.parametrize("noise", [4.0, 12.0, 24.0, 36.0])
def test_the_noise_is_estimated_within_five_percent_or_a_quarter_level(
    noise: float, images: list[Image]
) -> None:
    middling = [image.clip(72, 183) for image in images]  # so that hardly any noise is cut off
    for image in middling:
        estimates = [assess(corrupted(image, noise, 0.08, step)).noise for step in range(5)]
        assert np.mean(estimates) == pytest.approx(noise, rel=0.05, abs=0.25)  # steps of the median


def test_noise_that_is_cut_off_at_black_is_underestimated(images: list[Image]) -> None:
    dark = np.zeros_like(images[0]) + 10
    assert 12.0 < assess(corrupted(dark, 36.0, 0.08)).noise < 30.0


@pytest.mark.parametrize(("noise", "covered"), SETTINGS)
def test_the_mask_is_the_rectangle(noise: float, covered: float, images: list[Image]) -> None:
    image = np.maximum(images[2], 60)
    damaged = corrupted(image, noise, covered)
    black = (damaged == 0).all(axis=2)
    mask = assess(damaged).mask
    assert mask.mean() == pytest.approx(covered, rel=0.03)
    assert (mask.astype(bool) & ~black).sum() == 0


def test_what_is_black_but_no_rectangle_is_no_cover(images: list[Image]) -> None:
    image = np.maximum(images[2], 60)
    disc = image.copy()
    rows, columns = np.mgrid[:256, :256]
    disc[np.hypot(rows - 128, columns - 128) < 40] = 0  # fills 79% of its box
    thin = image.copy()
    thin[100:107, 20:220] = 0  # 7 px
    small = image.copy()
    small[100:110, 100:110] = 0  # 0.15% of the image
    grey = image.copy()
    grey[100:160, 100:160] = 3
    most = image.copy()
    most[:180, :180] = 0  # 49%
    for other in (disc, thin, small, grey, most):
        assert assess(other).covered == 0.0


def test_restoration_brings_an_image_nearer_to_what_it_was(images: list[Image]) -> None:
    for image in images[:2]:
        damaged = corrupted(image, 24.0, 0.08)
        again = restore(damaged, assess(damaged).mask)
        before, after = (np.abs(image.astype(float) - other).mean() for other in (damaged, again))
        assert after < 0.75 * before
        assert restore(damaged, assess(damaged).mask).tobytes() == again.tobytes()


def test_gated_shows_undamaged_images_as_they_are_and_always_does_not(world: TinyWorld) -> None:
    observation = world.observe(CAMERAS, 128)
    gated, always = (RestoringPolicy(Looks(), mode) for mode in ("gated", "always"))
    for policy in (gated, always):
        policy.predict(observation, QUERY)
    seen = gated.inner.shown[0]  # type: ignore[attr-defined]
    assert all(seen[key] is observation[key] for key in observation)
    assert gated.query_notes == dict(zip(COUNTS, (1, 0, 2, 0, 0, 0), strict=True))
    changed = always.inner.shown[0]  # type: ignore[attr-defined]
    assert all(not np.array_equal(changed[f"{name}_image"], observation[f"{name}_image"]) for name in CAMERAS)
    assert always.query_notes["restored"] == 2


def test_only_the_damaged_image_is_restored_and_nothing_is_written_to(world: TinyWorld) -> None:
    key = f"{CAMERAS[1]}_image"
    clean = world.observe(CAMERAS, 128)
    observation = {**clean, key: corrupted(clean[key], 24.0, 0.08)}
    kept = {name: value.copy() for name, value in observation.items()}
    policy = RestoringPolicy(Looks())
    policy.predict(observation, QUERY)
    (seen,) = policy.inner.shown  # type: ignore[attr-defined]
    assert [name for name in seen if seen[name] is not observation[name]] == [key]
    assert all(np.array_equal(kept[name], value) for name, value in observation.items())
    assert dict(policy.query_notes) == dict(zip(COUNTS, (1, 1, 2, 1, 1, 1), strict=True))
    assert policy.query_seconds["restore_s"] > 0.0


def test_a_policy_without_images_is_refused() -> None:
    with pytest.raises(AdapterError, match="no images"):
        RestoringPolicy(Looks(cameras=()), "gated")
    with pytest.raises(AdapterError, match="mode='sometimes'"):
        RestoringPolicy(Looks(), "sometimes")  # type: ignore[arg-type]


def test_the_wrapper_is_part_of_the_spec_and_keeps_what_the_policy_offers() -> None:
    inner = load_policy("servo", horizon=8)
    wrapped: Policy = check_policy(RestoringPolicy(inner, "gated"), "here")
    assert wrapped.spec.to_dict() == {**inner.spec.to_dict(), "wrappers": ["restore=gated"]}
    assert remembers(wrapped)
    assert not remembers(RestoringPolicy(Looks(), "always"))


def test_a_cadence_that_is_assigned_to_the_wrapper_reaches_the_policy() -> None:
    wrapped = RestoringPolicy(Looks(horizon=4, query_interval=4), "gated")
    own = wrapped.spec
    wrapped.spec = replace(own, horizon=3, query_interval=2)
    inner = wrapped.inner.spec
    assert (inner.horizon, inner.query_interval, inner.wrappers) == (3, 2, ())
    wrapped.spec = own
    assert wrapped.inner.spec == Looks(horizon=4, query_interval=4).spec


def test_counts_and_times_are_in_the_record(world: TinyWorld) -> None:
    policy = RestoringPolicy(Approaching(wait=4, horizon=4, interval=2, cameras=CAMERAS), "gated")
    record = play_pair(make_case("sensor_noise_onset"), world, policy)
    base, dynamic = record.arms["base"], record.arms["dynamic"]
    assert record.trigger is not None
    count = record.base_queries
    assert base.notes == {**dict.fromkeys(COUNTS, 0), "queries": count, "images": 2 * count}
    count = record.dynamic_queries  # only queries after the event
    assert count > 0
    assert dynamic.notes == {**dict.fromkeys(COUNTS, 2 * count), "queries": count, "active": count}
    assert record.timings["restore_s"] > 0
    assert PairRecord.from_dict(record.to_dict()) == record
    assert record.policy["wrappers"] == ["restore=gated"]


@pytest.mark.parametrize("notes", [[1], {"images": -1}, {"images": 0.5}, {1: 1}, {"restored": True}])
def test_notes_that_are_no_counts_are_the_policys_error(notes: object) -> None:
    policy = Looks()
    policy.query_notes = notes  # type: ignore[attr-defined]
    with pytest.raises(AdapterError, match="counts by name"):
        notes_of(policy)


def test_a_policy_without_a_wrapper_has_no_notes_in_its_record(world: TinyWorld) -> None:
    record = play_pair(make_case(), world, Approaching())
    assert all("notes" not in arm for arm in record.to_dict()["arms"].values())
    assert "restore_s" not in record.timings
