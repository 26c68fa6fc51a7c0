from __future__ import annotations

import pytest

from pytest_libero_max.lab.fleet.costs import Cost
from pytest_libero_max.lab.fleet.fleet import Fleet, play, workers_fed

PAIR = Cost(worker_s=2.0, calls=10, policy_s=1.0)


def test_workers_share_the_pairs() -> None:
    assert play([PAIR] * 8, Fleet(workers=1)).seconds == pytest.approx(24.0)
    played = play([PAIR] * 8, Fleet(workers=4))
    assert played.seconds == pytest.approx(6.0)
    assert played.computing == pytest.approx(1.0)
    assert played.bottleneck == "workers"
    assert play([PAIR] * 8, Fleet(workers=4, start_s=5.0)).seconds == pytest.approx(11.0)


def test_the_last_long_pair_leaves_workers_without_work() -> None:
    played = play([PAIR] * 2 + [Cost(9.0, 0, 0.0)], Fleet(workers=2))
    assert played.seconds == pytest.approx(12.0)
    assert played.computing == pytest.approx(15.0 / 24.0)


def test_a_query_in_a_worker_takes_what_is_said() -> None:
    assert play([PAIR] * 4, Fleet(workers=2, query_s=0.5)).seconds == pytest.approx(2 * (2.0 + 5.0))


def test_one_worker_waits_for_each_answer() -> None:
    played = play([PAIR] * 3, Fleet(workers=1, servers=1, query_s=0.1))
    assert played.seconds == pytest.approx(3 * 3.0)
    assert played.serving == pytest.approx(1 / 3)


@pytest.mark.parametrize("servers", [1, 2, 5])
def test_servers_that_never_rest_are_the_bottleneck(servers: int) -> None:
    played = play([PAIR] * 200, Fleet(workers=50, servers=servers, query_s=0.1))
    assert played.seconds == pytest.approx(200 * 10 * 0.1 / servers, rel=0.05)
    assert played.bottleneck == "policy servers"
    assert played.serving > 0.95


def test_servers_answer_batches() -> None:
    alone = play([PAIR] * 200, Fleet(workers=50, servers=1, query_s=0.1))
    together = play([PAIR] * 200, Fleet(workers=50, servers=1, query_s=0.1, batch=8))
    assert together.seconds == pytest.approx(alone.seconds / 8, rel=0.1)
    slower = Fleet(workers=50, servers=1, query_s=0.1, batch=8, batch_s=0.8)
    assert slower.answer_s(1) == pytest.approx(0.1)
    assert slower.answer_s(5) == pytest.approx(0.5)
    assert play([PAIR] * 200, slower).seconds == pytest.approx(alone.seconds, rel=0.1)


def test_with_one_worker_for_each_server_nobody_waits_in_a_queue() -> None:
    with_servers = play([PAIR] * 40, Fleet(workers=4, servers=4, query_s=0.1))
    assert with_servers.seconds == pytest.approx(play([PAIR] * 40, Fleet(workers=4)).seconds)


def test_a_slow_disk_is_the_bottleneck_of_many_workers() -> None:
    played = play([PAIR] * 500, Fleet(workers=250, record_s=0.1))
    assert played.seconds == pytest.approx(500 * 0.1 + 3.0)
    assert played.bottleneck == "controller"


@pytest.mark.parametrize(("clients", "measured_s"), [(1, 79.8), (2, 50.9), (4, 50.5), (8, 51.3)])
def test_the_measured_times_of_one_server_are_met(clients: int, measured_s: float) -> None:
    """The table "One policy server" of ``reports/cost.md``."""
    pair = Cost(worker_s=1.45, calls=57, policy_s=57 * 0.0569)
    played = play([pair] * 16, Fleet(workers=clients, servers=1, query_s=0.0569))
    assert played.seconds == pytest.approx(measured_s, rel=0.07)


def test_the_same_fleet_plays_the_same_way_again() -> None:
    costs = [Cost(1.0 + 0.37 * (number % 7), number % 11, 0.0) for number in range(100)]
    fleet = Fleet(workers=7, servers=2, query_s=0.05, batch=2)
    assert play(costs, fleet) == play(costs, fleet)


def test_one_controller_feeds_as_many_workers_as_records_fit_into_a_pair() -> None:
    assert workers_fed([PAIR] * 3, Fleet(workers=1, record_s=0.01)) == 300
    assert workers_fed([PAIR], Fleet(workers=1, query_s=0.8, record_s=0.01)) == 1000
    assert workers_fed([PAIR], Fleet(workers=1, record_s=100.0)) == 1
    assert workers_fed([PAIR], Fleet(workers=1)) is None
