from __future__ import annotations

from typing import Any

import pytest

from pytest_libero_max.errors import ServerError
from pytest_libero_max.policies.server.host import (
    FORGOTTEN_AFTER_S,
    MOST_CLIENTS,
    MOST_KEPT,
    RECONNECT_S,
    Memories,
    Place,
)


def test_a_query_can_be_asked_again_and_what_is_kept_can_be_gone_back_to() -> None:
    memories = Memories()
    first = memories.add(Place("a"), "one")
    second = memories.add(Place("a", first), "two")
    again = memories.add(Place("a", first), "two again")
    third = memories.add(Place("a", again, (first,)), "three")
    assert memories.find(Place("a", first)) == "one"
    assert memories.find(Place("a", third)) == "three"
    with pytest.raises(ServerError, match="is not here"):
        memories.find(Place("a", second))
    assert len(memories) == 3


def test_clients_do_not_find_each_others_memories() -> None:
    memories = Memories()
    name = memories.add(Place("a"), "one")
    memories.add(Place("b"), "two")
    with pytest.raises(ServerError, match="is not here"):
        memories.find(Place("b", name))


def test_names_of_an_earlier_run_of_the_server_are_not_taken_for_its_own() -> None:
    old = Memories().add(Place("a"), "one")
    memories = Memories()
    memories.add(Place("a"), "other")
    with pytest.raises(ServerError, match="started again"):
        memories.find(Place("a", old))


def test_a_client_that_is_silent_for_long_is_forgotten() -> None:
    now = [0.0]
    memories = Memories(lambda: now[0])
    memories.add(Place("a"), "one")
    now[0] = FORGOTTEN_AFTER_S
    memories.add(Place("b"), "two")
    assert len(memories) == 2
    now[0] += 1.0
    memories.add(Place("b"), "three")
    assert len(memories) == 1


def test_a_client_whose_connection_ended_is_forgotten_soon_unless_it_asks_again() -> None:
    now = [0.0]
    memories = Memories(lambda: now[0])
    names = {client: memories.add(Place(client), client) for client in "ab"}
    memories.leave([*names, "unknown"])
    now[0] = RECONNECT_S
    memories.add(Place("a", names["a"]), "again")
    assert memories.find(Place("b", names["b"])) == "b"
    now[0] += 1.0
    memories.add(Place("c"), "other")
    assert memories.find(Place("a", names["a"])) == "a"
    with pytest.raises(ServerError, match="600 s after"):
        memories.find(Place("b", names["b"]))


@pytest.mark.parametrize(
    "value",
    [
        None,
        [],
        {},
        {"client": ""},
        {"client": "a", "at": 3},
        {"client": "a", "keep": "b"},
        {"client": "a", "keep": [1]},
        {"client": "a", "keep": ["x"] * (MOST_KEPT + 1)},
    ],
)
def test_a_place_that_is_none_is_refused(value: Any) -> None:
    with pytest.raises(ServerError, match="must hold 'memory'"):
        Place.read(value)


def test_a_place_is_read() -> None:
    assert Place.read({"client": "a", "at": None, "keep": ["b"]}) == Place("a", None, ("b",))


def test_invented_clients_do_not_add_up() -> None:
    memories = Memories()
    for number in range(MOST_CLIENTS + 10):
        memories.add(Place(f"client {number}"), number)
    assert len(memories) == MOST_CLIENTS
