from pytest_libero_max.makers.bench.scenes import SceneCost, cost_lines, measure_scene, scenes_of
from pytest_libero_max.substrates.libero.installation import find_installation
from pytest_libero_max.substrates.libero.substrate import LiberoSubstrate
from pytest_libero_max.substrates.registry import open_substrate
from tests.substrates.libero.data import DATA, needs_package


def test_a_scene_is_measured() -> None:
    cost = measure_scene(
        scenes_of(open_substrate("embedded")), "libero_object", 0, steps=2, images=2, size=64
    )
    assert cost.scene == "libero_object/0"
    assert min(cost.build_s, cost.step_ms, cost.first_image_s, cost.image_ms) > 0


@needs_package
def test_a_genuine_scene_is_built_each_time_it_is_measured() -> None:
    scenes = scenes_of(LiberoSubstrate([find_installation(assets=DATA / "assets")]))
    costs = [measure_scene(scenes, "libero_object", 0, steps=2, images=2, size=64) for _ in range(2)]
    assert min(cost.build_s for cost in costs) > 10 * max(cost.step_ms for cost in costs) / 1000


def test_the_dearest_scene_is_named() -> None:
    lines = cost_lines(
        [
            SceneCost("a/0", 0.1, 2.0, 0.01, 5.0),
            SceneCost("a/1", 0.1, 2.0, 0.01, 5.0),
            SceneCost("b/0", 0.3, 4.0, 1.02, 9.0),
        ]
    )
    assert "| b/0 | 0.30 | 4.00 | 250 | 1.02 | 9.0 |" in lines
    assert "b/0 takes longest, 1.80" in lines[-1]
