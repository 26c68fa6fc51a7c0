from pytest_libero_max.makers.bench.serving import ServingRate, measure_serving, serving_lines


def test_a_server_is_asked_by_two_clients_at_once() -> None:
    (rate,) = measure_serving(None, [2], seconds=0.3)
    assert rate.clients == 2
    assert rate.queries >= 2
    assert 0.0 < rate.median_ms <= rate.p99_ms


def test_the_table_has_queries_of_all_and_times_of_one() -> None:
    lines = serving_lines([ServingRate(4, 500, 5.0, 39.96, 80.0)])
    assert lines[-1] == "| 4 | 100 | 40.0 | 80.0 |"
