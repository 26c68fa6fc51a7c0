from pytest_libero_max.makers.bench.images import ImageRate, device, measure_rates, rate_lines
from pytest_libero_max.substrates.contract import SubstrateOptions


def test_images_of_two_processes_are_counted_together() -> None:
    (rate,) = measure_rates("embedded", SubstrateOptions(), [("libero_object", 0)], [2], seconds=0.2, size=32)
    assert (rate.scene, rate.processes) == ("libero_object/0", 2)
    assert rate.images >= 2
    assert 0.0 < rate.seconds < 0.4
    assert device()


def test_the_table_has_rates_of_all_and_times_of_one() -> None:
    lines = rate_lines([ImageRate("a/0", 4, 400, 5.0)])
    assert lines[-1] == "| a/0 | 4 | 80 | 50.0 |"
