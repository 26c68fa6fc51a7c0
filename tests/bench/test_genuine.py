from __future__ import annotations

from pytest_libero_max.bench.genuine import GenuineTimes, measure_genuine
from pytest_libero_max.worlds.libero.installation import find_installation
from pytest_libero_max.worlds.libero.substrate import LiberoSubstrate
from tests.worlds.libero.data import DATA, needs_package


def test_the_table_states_the_ratios() -> None:
    times = GenuineTimes("LIBERO x", "case", 4.0, 12.0, 120.0, 6.0, 90.0, 460)
    text = "\n".join(times.lines())
    assert "250 steps/s" in text
    assert "3.0 times the lean step" in text
    assert "10.00 pairs/min" in text
    assert "15.0 times the pair runner" in text


@needs_package
def test_steps_are_compared_with_the_packages_own() -> None:
    substrate = LiberoSubstrate([find_installation(assets=DATA / "assets")])
    times = measure_genuine(substrate, "libero_object", steps=6, repeats=0)
    assert times.package_ms > 1.5 * times.lean_ms
    assert times.images_ms > times.package_ms
