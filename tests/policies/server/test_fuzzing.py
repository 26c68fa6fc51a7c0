"""Whatever comes in: every message gets an answer or an error, and the server goes on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from pytest_libero_max.errors import LiberoMaxError
from pytest_libero_max.policies.clients.codecs import OPENPI, VLA_EVAL, pack, unpack
from pytest_libero_max.policies.contract import PolicySpec
from pytest_libero_max.policies.server import openpi
from pytest_libero_max.policies.server.host import Host
from pytest_libero_max.policies.server.sockets import serving
from pytest_libero_max.policies.server.vla_eval import Session
from tests.policies.server.policies import Counting

EXAMPLES = 60
ON_THE_WIRE = 40
ANSWER_S = 10.0


class Blind(Counting):
    """Wants no images, so that sound messages are small; looks at whatever it is shown."""

    def __init__(self) -> None:
        super().__init__()
        self.spec = PolicySpec("blind", 8, 4, cameras=())

    def predict(self, observation: Any, query: Any) -> Any:
        return super().predict(observation, query) + 0.0 * sum(float(v.size) for v in observation.values())


def request() -> dict[str, Any]:
    return {
        "prompt": "x",
        "observation": {"robot0_eef_pos": np.zeros(3)},
        "query": {"index": 0, "step": 0, "seed": 1},
        "episode": {"suite": "s", "task_index": 0, "instruction": "x", "seed": 1, "max_steps": 10},
        "memory": {"client": "a", "at": None, "keep": []},
    }


def messages() -> list[dict[str, Any]]:
    payloads = {
        "hello": {"harness_version": "x", "protocol_version": 1},
        "episode_start": {"task": {"name": "x", "suite": "s", "task_id": 1, "episode_idx": 2}},
        "observation": {"images": {}, "task_description": "x", "states": np.zeros(8), "seed": 3},
        "episode_end": {},
        "error": {"error": "x"},
    }
    return [
        {"type": kind, "payload": payload, "seq": number, "timestamp": 0.0}
        for number, (kind, payload) in enumerate(payloads.items())
    ]


TEXTS = st.text("ab\u00e9\n", max_size=3)
ARRAYS = npst.arrays(
    st.sampled_from(["<f8", "<f4", "<i8", "|u1", "|b1"]),
    npst.array_shapes(min_dims=0, max_dims=3, max_side=4),
)
VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**63)
    | st.floats()
    | TEXTS
    | st.binary(max_size=3)
    | ARRAYS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXTS, inner, max_size=3),
    max_leaves=5,
)


def places(value: Any, way: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The way to every value inside maps."""
    yield way
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from places(inner, (*way, key))


def altered(value: Any, way: tuple[Any, ...], new: Any, drop: bool) -> Any:
    """``value`` with another value, or none, at a place."""
    if not way:
        return new
    changed = {key: inner for key, inner in value.items() if not (drop and way == (key,))}
    if way[0] in changed:
        changed[way[0]] = altered(value[way[0]], way[1:], new, drop)
    return changed


@given(st.sampled_from(sorted(places(request()), key=str)), VALUES, st.booleans())
@example(("query",), np.zeros(()), False)
@settings(max_examples=EXAMPLES, deadline=None)
def test_any_request_is_answered_or_refused(way: tuple[Any, ...], value: Any, drop: bool) -> None:
    host = Host(Blind(), "x")
    with host.open(), suppress(LiberoMaxError):
        assert openpi.answer(host, altered(request(), way, value, drop))["actions"].shape == (8, 7)


@given(
    st.lists(
        st.tuples(
            st.integers(0, len(messages()) - 1),
            st.sampled_from([(), ("task",), ("task", "task_id"), ("images",), ("states",), ("seed",)]),
            VALUES,
            st.booleans(),
        ),
        max_size=6,
    )
)
@settings(max_examples=EXAMPLES, deadline=None)
def test_any_course_of_a_session_is_answered_or_refused(course: list[Any]) -> None:
    host = Host(Blind(), "x")
    with host.open():
        session = Session(host)
        for number, way, value, drop in course:
            payload = altered(messages()[number]["payload"], way, value, drop)
            with suppress(LiberoMaxError):
                if isinstance(payload, dict):
                    session.reply(messages()[number]["type"], payload)
        session.reply("episode_start", {})
        answer = session.reply("observation", {"states": np.zeros(8)})
        assert answer is not None
        assert answer[1]["actions"].shape == (7,)


def nested(depth: int) -> bytes:
    """A map of lists of lists."""
    return b"\x81\xa1a" + b"\x91" * depth + b"\xc0"


SOUND = {"/": pack(request(), OPENPI), "/vla-eval": pack(messages()[2], VLA_EVAL)}


@st.composite
def damaged(draw: st.DrawFn, sound: bytes) -> bytes | str:
    """A message cut short, altered, too long, nested, or of other bytes."""
    match draw(st.sampled_from(["any", "cut", "flipped", "longer", "nested", "huge", "text"])):
        case "any":
            return draw(st.binary(max_size=60))
        case "cut":
            return sound[: draw(st.integers(0, len(sound) - 1))]
        case "flipped":
            at = draw(st.integers(0, len(sound) - 1))
            return sound[:at] + bytes([draw(st.integers(0, 255))]) + sound[at + 1 :]
        case "longer":
            return sound + draw(st.binary(min_size=1, max_size=5))
        case "nested":
            return nested(draw(st.sampled_from([10, 500, 2000, 100_000])))
        case "huge":  # a map, a list, a binary or a text that says it is gigabytes long
            return draw(st.sampled_from([b"\xdf", b"\xdd", b"\xc6", b"\xdb"])) + b"\xff\xff\xff\xff"
        case _:
            return draw(st.text("ab\u00e9\n", max_size=20))


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    with serving(Host(Blind(), "x"), port=0) as (found, _):
        yield found


@pytest.mark.parametrize("path", ["/", "/vla-eval"])
def test_any_bytes_on_the_wire_leave_the_server_standing(path: str, port: int) -> None:
    @given(damaged(SOUND[path]))
    @settings(max_examples=ON_THE_WIRE, deadline=None)
    def send(content: bytes | str) -> None:
        answers = talk(path, port, [content])
        assert len(answers) <= 1

    send()
    assert well(path, port)


@pytest.mark.parametrize("path", ["/", "/vla-eval"])
def test_a_message_that_is_too_large_is_not_read(
    path: str, port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pytest_libero_max.policies.server.sockets.MOST_BYTES", 1000)
    with serving(Host(Blind(), "x"), port=0) as (small, _):
        assert talk(path, small, [b"x" * 1001]) == []
        assert well(path, small)


def talk(path: str, port: int, contents: Sequence[bytes | str]) -> list[Any]:
    """What a server answers to some messages, until it hangs up; fails if an answer does not come."""
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.client import connect

    answers = []
    with connect(f"ws://127.0.0.1:{port}{path}", compression=None, proxy=None, close_timeout=5) as connection:
        if path == "/":
            connection.recv(timeout=ANSWER_S)
        with suppress(ConnectionClosed):
            for content in contents:
                connection.send(content)
                if answered(path, content):
                    answers.append(connection.recv(timeout=ANSWER_S))
    return answers


def answered(path: str, content: bytes | str) -> bool:
    """Whether a message has to be answered, with an error or otherwise."""
    if path == "/" or isinstance(content, str):
        return True
    try:
        kind = msgpack.unpackb(content, strict_map_key=False).get("type")
    except Exception:  # whatever is wrong with it
        return True
    return kind not in ("episode_start", "episode_end", "error")


def well(path: str, port: int) -> bool:
    """Whether a sound client is answered."""
    if path == "/":
        return bool(unpack(talk(path, port, [SOUND[path]])[0], OPENPI)["actions"].shape == (8, 7))
    course = [pack(messages()[number], VLA_EVAL) for number in (0, 1, 2)]
    types = [unpack(answer, VLA_EVAL)["type"] for answer in talk(path, port, course)]
    return types == ["hello", "action"]
