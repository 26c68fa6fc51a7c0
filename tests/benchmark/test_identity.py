"""Names and seeds of cases, against published values."""

import pytest

from pytest_libero_max.benchmark.identity import Identity


@pytest.mark.parametrize(
    ("identity", "event", "variant", "seed"),
    [
        (Identity("pro", "libero_10", 0, 1, "camera_view_angle"), "sensor_noise_onset", 0, 2342431568),
        (Identity("pro", "libero_10", 1, 6, "camera_view_angle"), "distractor_burst", 0, 318522221),
        (Identity("plus", "libero_object", 646, 0), "target_relocation", 1, 1425746499),
    ],
)
def test_published_seeds(identity: Identity, event: str, variant: int, seed: int) -> None:
    assert identity.seed(event, variant) == seed


@pytest.mark.parametrize(
    ("suite", "task", "event", "direction"),
    [("libero_10", 5, "target_relocation", 6), ("libero_10", 6, "receptacle_relocation", 1)],
)
def test_published_directions(suite: str, task: int, event: str, direction: int) -> None:
    for source in ("libero", "plus", "pro"):
        assert Identity(source, suite, task, 3, "object").direction_index(event) == direction


def test_names() -> None:
    pro = Identity("pro", "libero_10", 1, 6, "camera_view_angle")
    assert pro.case_id("distractor_burst", 0) == "pro-camera-view-angle-10-t01-i06-distractor_burst-d0-p195"
    assert pro.base_task_id == "libero-pro/camera_view_angle/libero_10/task_1"
    plus = Identity("plus", "libero_object", 646, 0)
    assert plus.scenario_id("target_relocation", 1) == "libero_object-t0646-target_relocation-d1"
    assert plus.base_task_id == "libero_object/task_646"
    libero = Identity("libero", "libero_spatial", 3, 4)
    assert libero.case_id("camera_shift", 1) == "libero-spatial-t03-i04-camera_shift-d1-p195"
    assert libero.base_task_id == "libero/libero_spatial/task_3"
