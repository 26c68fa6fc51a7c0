import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_libero_max.changes import Brightness, SensorCorruption, SetSensorCorruption
from pytest_libero_max.changes.pixels import PublishedSensorCorruption
from pytest_libero_max.substrates.tiny.world import TinyWorld
from pytest_libero_max.worlds.contract import Image
from pytest_libero_max.worlds.robot import CAMERAS

EVENT = (24.0, 0.08, 2342431568)
GREY = np.full((64, 64, 3), 128, dtype=np.uint8)
GREY.flags.writeable = False


def corruptions() -> st.SearchStrategy[SensorCorruption]:
    return st.builds(SensorCorruption, st.floats(0.0, 60.0), st.floats(0.0, 1.0), st.integers(0, 2**32 - 1))


def global_stream() -> bytes:
    state = np.random.get_state(legacy=True)  # noqa: NPY002 - it is the one that must not move
    assert isinstance(state, tuple)
    return state[1].tobytes()


@pytest.mark.parametrize(("factor", "expected"), [(0.75, [0, 75, 191]), (1.25, [0, 125, 255])])
def test_brightness_multiplies_and_clips(factor: float, expected: list[int]) -> None:
    image = np.array([[[0, 100, 255]]], dtype=np.uint8)
    assert Brightness(factor)(image, "agentview", 0).tolist() == [[expected]]


@given(corruptions(), st.sampled_from(["agentview", "robot0_eye_in_hand"]), st.integers(0, 600))
def test_corruption_is_a_pure_function(corruption: SensorCorruption, camera: str, step: int) -> None:
    state = global_stream()
    first = corruption(GREY, camera, step)
    corruption(GREY, "another", step + 1)
    again = SensorCorruption(*(getattr(corruption, f) for f in ("noise_std", "occlusion_fraction", "seed")))
    assert np.array_equal(first, again(GREY, camera, step))
    assert first.dtype == np.uint8
    assert (GREY == 128).all()
    assert global_stream() == state


@given(corruptions(), st.floats(0.0, 1.0), st.floats(0.0, 60.0))
def test_the_rectangle_does_not_depend_on_the_noise(
    corruption: SensorCorruption, fraction: float, other_noise: float
) -> None:
    bright = np.full((64, 64, 3), 255, dtype=np.uint8)
    quiet = SensorCorruption(0.0, fraction, corruption.seed)(bright, "agentview", 3)
    noisy = SensorCorruption(other_noise, fraction, corruption.seed)(bright, "agentview", 3)
    assert not noisy[(quiet == 0).all(axis=-1)].any()


@pytest.mark.parametrize("other", [("robot0_eye_in_hand", 5, 1), ("agentview", 6, 1), ("agentview", 5, 2)])
def test_camera_step_and_seed_each_give_another_pattern(other: tuple[str, int, int]) -> None:
    camera, step, seed = other
    one = SensorCorruption(24.0, 0.08, 1)(GREY, "agentview", 5)
    assert not np.array_equal(one, SensorCorruption(24.0, 0.08, seed)(GREY, camera, step))


@pytest.mark.parametrize(("noise", "fraction", "side"), [(24.0, 0.08, 72), (36.0, 0.16, 102)])
def test_noise_and_occlusion_have_the_stated_size(noise: float, fraction: float, side: int) -> None:
    image = np.full((256, 256, 3), 128, dtype=np.uint8)
    corrupted = SensorCorruption(noise, fraction, 195)(image, "agentview", 0)
    # With noise this strong a black pixel by chance is possible in one channel, hardly in all three.
    black = (corrupted == 0).all(axis=-1)
    rows, columns = np.flatnonzero(black.sum(1) > side / 2), np.flatnonzero(black.sum(0) > side / 2)
    assert (len(rows), len(columns)) == (side, side)
    assert black[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1].all()
    noisy = corrupted[~black].astype(float)
    assert abs(noisy.mean() - 127.5) < 0.5
    assert abs(noisy.std() - noise) < 0.05 * noise


def test_the_random_stream_is_frozen() -> None:
    corrupted = SensorCorruption(24.0, 0.08, 2342431568)(GREY, "agentview", 4)
    assert corrupted[0, :4, 0].tolist() == [119, 121, 120, 133]
    rows, columns = np.nonzero((corrupted == 0).all(axis=-1))
    assert (rows.min(), columns.min(), rows.max(), columns.max()) == (44, 5, 61, 22)


def as_published(images: dict[str, Image], std: float, fraction: float, seed: int) -> dict[str, Image]:
    """One observation, worked out from the description: one stream, camera after camera."""
    stream, seen = np.random.RandomState(seed), {}
    for camera, image in images.items():
        work = image.astype(np.float32)
        work += stream.normal(0.0, std, size=work.shape)
        rows, columns = work.shape[:2]
        tall, wide = round(rows * fraction**0.5), round(columns * fraction**0.5)
        top = stream.randint(0, rows - tall + 1)
        left = stream.randint(0, columns - wide + 1)
        work[top : top + tall, left : left + wide] = 0
        seen[camera] = np.clip(work, 0, 255).astype(np.uint8)
    return seen


@pytest.mark.parametrize("step", [0, 1, 7])
@pytest.mark.parametrize("size", [16, 64])
def test_both_cameras_spend_one_stream(step: int, size: int) -> None:
    source = np.random.default_rng(1)
    images = {name: source.integers(0, 256, (size, size, 3), dtype=np.uint8) for name in CAMERAS}
    std, fraction, seed = EVENT
    expected = as_published(images, std, fraction, seed + step)
    for camera, image in images.items():
        seen = PublishedSensorCorruption(*EVENT)(image, camera, step)
        assert np.array_equal(seen, expected[camera]), camera


def test_other_cameras_are_left_alone() -> None:
    image = np.full((8, 8, 3), 100, dtype=np.uint8)
    assert np.array_equal(PublishedSensorCorruption(*EVENT)(image, "frontview", 0), image)


def test_a_world_says_which_noise_it_gets(monkeypatch: pytest.MonkeyPatch) -> None:
    world = TinyWorld()
    change = SetSensorCorruption(*EVENT)
    world.reset(0)
    change.apply(world)
    assert isinstance(world.filters[0][0], SensorCorruption)
    monkeypatch.setattr(TinyWorld, "semantics", "published")
    world.reset(0)
    change.apply(world)
    assert isinstance(world.filters[0][0], PublishedSensorCorruption)
