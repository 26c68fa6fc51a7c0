from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_libero_max.errors import ActionError, AdapterError
from pytest_libero_max.policies.check import (
    ask,
    check_actions,
    check_policy,
    copy_memory,
    remembers,
    restore_memory,
    start,
)
from pytest_libero_max.policies.contract import Episode, PolicySpec, Query

SPEC = PolicySpec("p", horizon=4, query_interval=2)
ABSOLUTE = PolicySpec("p", horizon=4, query_interval=2, control="absolute")
QUERY = Query(3, 6, "do it", 0)
EPISODE = Episode("libero_spatial", 0, "do it", 195, 220)


class Sound:
    """A policy without fault; the broken ones below change one thing."""

    spec = SPEC

    def reset(self, episode: Episode) -> None:
        pass

    def predict(self, observation: Any, query: Query) -> Any:
        return np.zeros((2, 7))


class WithMemory(Sound):
    """The same, with a memory."""

    memory: object = "m"

    def snapshot(self) -> object:
        return self.memory

    def restore(self, memory: object) -> None:
        self.memory = memory


def broken(base: type = Sound, /, **members: Any) -> Any:
    return type("Broken", (base,), members)()


def test_a_sound_policy_passes() -> None:
    for policy in (Sound(), WithMemory(), broken(predict=lambda self, *anything: None)):
        assert check_policy(policy, "a.py:policy") is policy
    assert remembers(WithMemory())
    assert not remembers(Sound())


# Each with one fault, and what the message must name.
BROKEN_POLICIES: dict[str, tuple[Any, str]] = {
    "no spec": (type("Bare", (), {})(), r"^a\.py:policy \(Bare\) .*'spec'.*PolicySpec"),
    "a dictionary for a spec": (broken(spec={"horizon": 4}), r"^a\.py:policy\.spec=\{'horizon': 4\}"),
    "no predict": (
        type("Idle", (), {"spec": SPEC, "reset": lambda self, episode: None})(),
        r"\(Idle\) .*'predict'.* Add predict\(observation, query\)",
    ),
    "no reset": (
        type("Restless", (), {"spec": SPEC, "predict": lambda self, observation, query: None})(),
        r"\(Restless\) .*'reset'.* Add reset\(episode\)",
    ),
    "predict is a table": (broken(predict=[0.0]), r"predict=\[0\.0\] .*predict\(observation, query\)"),
    "reset without the episode": (broken(reset=lambda self: None), r"reset\(\) .* reset\(episode\)"),
    "predict without the query": (
        broken(predict=lambda self, observation: None),
        r"predict\(observation\) .* predict\(observation, query\)",
    ),
    "predict with one more": (
        broken(predict=lambda self, observation, query, text: None),
        r"predict\(observation, query, text\) .* 'text'",
    ),
    "snapshot without restore": (broken(snapshot=lambda self: None), "Add restore"),
    "restore without snapshot": (broken(restore=lambda self, memory: None), "Add snapshot"),
    "restore without the memory": (
        broken(WithMemory, restore=lambda self: None),
        r"restore\(\) .* restore\(memory\)",
    ),
}


@pytest.mark.parametrize("name", BROKEN_POLICIES)
def test_a_broken_policy_is_told_what_is_wrong(name: str) -> None:
    policy, message = BROKEN_POLICIES[name]
    with pytest.raises(AdapterError, match=message):
        check_policy(policy, "a.py:policy")


BROKEN_ACTIONS: dict[str, tuple[Any, str]] = {
    "nothing": (None, r"NoneType of dtype object.*\(n, 7\)"),
    "text": ("left", r"str of length 4.*\(n, 7\)"),
    "booleans": (np.ones((2, 7), bool), "dtype bool"),
    "complex numbers": (np.ones((2, 7), complex), "dtype complex128"),
    "ragged rows": ([[0.0] * 7, [0.0] * 6], "a list that is no array"),
    "eight components": (np.zeros((2, 8)), r"shape \(2, 8\)"),
    "a batch": (np.zeros((2, 2, 7)), r"shape \(2, 2, 7\)"),
    "one number": (0.5, r"shape \(\).*\(n, 7\)"),
    "no action": (np.zeros((0, 7)), "0 actions, .*query_interval=2"),
    "a single action where Q = 2": (np.zeros(7), "1 action, .*query_interval=2"),
    "more than H": (np.zeros((5, 7)), "5 actions > horizon=4"),
    "not a number": ([[0.0] * 7, [0.0, np.nan, *[0.0] * 5]], r"actions\[1, 1\]=nan"),
    "infinity": ([[0.0] * 7, [-np.inf] * 7], r"actions\[1, 0\]=-inf"),
}


@pytest.mark.parametrize("name", BROKEN_ACTIONS)
def test_broken_actions_are_told_what_is_wrong(name: str) -> None:
    actions, message = BROKEN_ACTIONS[name]
    with pytest.raises(ActionError, match=f"^policy 'p' .*{message}"):
        check_actions(actions, SPEC)
    with pytest.raises(ActionError, match=r"^query 3 at step 6: "):
        ask(broken(predict=lambda self, observation, query: actions), {}, QUERY)


@given(
    length=st.integers(2, 4),
    kind=st.sampled_from([np.float64, np.float32, np.float16, np.int64, np.uint8]),
    order=st.sampled_from(["C", "F"]),
    as_list=st.booleans(),
)
def test_any_real_numbers_of_the_right_shape_are_actions(
    length: int, kind: Any, order: Any, as_list: bool
) -> None:
    given_actions = np.arange(7 * length).reshape(length, 7).astype(kind, order=order)
    answer: Any = given_actions.tolist() if as_list else given_actions
    actions = check_actions(answer, SPEC)
    assert actions.dtype == np.float64
    assert actions.flags.c_contiguous
    assert actions.tolist() == given_actions.tolist()
    given_actions[:] = 1  # a policy may reuse its buffer
    assert actions[0].tolist() == list(range(7))


def test_a_single_action_may_be_a_vector_where_q_is_one() -> None:
    assert check_actions(np.arange(7), PolicySpec("p")).tolist() == [[0, 1, 2, 3, 4, 5, 6]]


def test_poses_of_a_hand_are_actions_under_absolute_control() -> None:
    poses = np.array([[0.4, -0.3, 1.2, 0.0, 6.2, 0.0, 1.0], [1.0, 1.0, 2.6, 3.1, 0.2, 0.1, -1.0]])
    assert np.array_equal(check_actions(poses, ABSOLUTE), poses)


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        (0, 3.1, r"a position of size 3\.1 in actions\[1\], but a pose of the hand has at most 3 metres"),
        (2, 950.0, "other units"),
        (4, 180.0, r"a rotation of size 180 in actions\[1\].* at most 6\.284 rad.*degrees"),
        (5, np.nan, "must be finite"),
    ],
)
def test_a_pose_that_no_hand_could_have_is_refused(column: int, value: float, message: str) -> None:
    poses = np.zeros((3, 7))
    poses[1, column] = value
    with pytest.raises(ActionError, match=message):
        check_actions(poses, ABSOLUTE)


def test_actions_beyond_one_are_the_controllers_business() -> None:
    assert check_actions(np.full((2, 7), 3.5), SPEC).max() == 3.5


def raising(*arguments: Any) -> Any:
    raise RuntimeError("out of memory")


@pytest.mark.parametrize(
    ("call", "where"),
    [
        (lambda policy: start(policy, EPISODE), "reset"),
        (lambda policy: ask(policy, {}, QUERY), "predict, query 3 at step 6"),
        (copy_memory, "snapshot"),
        (lambda policy: restore_memory(policy, None), "restore"),
    ],
    ids=["reset", "predict", "snapshot", "restore"],
)
def test_whatever_a_policy_raises_names_the_call_and_the_line(call: Any, where: str) -> None:
    policy = broken(Sound, reset=raising, predict=raising, snapshot=raising, restore=raising)
    with pytest.raises(AdapterError) as caught:
        call(policy)
    line = raising.__code__.co_firstlineno + 1
    assert f"RuntimeError in {where} (test_check.py, line {line}): out of memory." in str(caught.value)
    assert isinstance(caught.value.__cause__, RuntimeError)


def test_memory_is_copied_and_given_back() -> None:
    policy = WithMemory()
    policy.memory = "before"
    memory = copy_memory(policy)
    policy.memory = "after"
    restore_memory(policy, memory)
    assert policy.memory == "before"
    assert copy_memory(Sound()) is None


class NeedsGradient:
    def __array__(self, *args: Any, **kwargs: Any) -> Any:
        raise RuntimeError("Can't call numpy() on Tensor that requires grad. Use tensor.detach().numpy()")


class Unprintable(Exception):
    def __str__(self) -> str:
        raise ValueError("no text")


class Nameless(type):
    @property
    def __name__(cls) -> str:  # type: ignore[override]
        raise RuntimeError("no name")


class Odd(metaclass=Nameless):
    pass


def answering(answer: Any) -> Any:
    class Answering(Sound):
        def predict(self, observation: Any, query: Query) -> Any:
            if isinstance(answer, BaseException):
                raise answer
            return answer

    return Answering()


HOSTILE = [
    (NeedsGradient(), "NeedsGradient that is no array .*requires grad"),
    (Odd(), "returned Odd of dtype object"),
    (Unprintable(), "raised Unprintable in predict.*its text cannot be read"),
    (pytest.exit.Exception("bye", 0), "raised Exit in predict"),
]


@pytest.mark.parametrize(("answer", "message"), HOSTILE, ids=["array", "metaclass", "text", "exit"])
def test_hostile_answers_are_errors_of_the_adapter(answer: Any, message: str) -> None:
    with pytest.raises(AdapterError, match=message):
        ask(answering(answer), {}, Query(0, 0, "put it down", 1))
