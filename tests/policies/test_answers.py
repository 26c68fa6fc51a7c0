"""Answers: what is read from a policy in process is read from a server, and what is refused is refused."""

from __future__ import annotations

import io
import warnings
from typing import Any

import numpy as np
import pytest

from pytest_libero_max.errors import ActionError, ServerError
from pytest_libero_max.policies.check import check_actions
from pytest_libero_max.policies.clients.messages import Reply
from pytest_libero_max.policies.contract import PolicySpec
from pytest_libero_max.policies.profile import load_profile

ROWS = np.arange(28.0).reshape(4, 7) / 28
SPEC = PolicySpec("p", horizon=4, query_interval=1, cameras=())


def both(value: Any) -> tuple[Any, Any]:
    """The actions of an answer in process and from a server, or the two errors."""
    own: Any
    served: Any
    try:
        own = check_actions(value, SPEC)
    except ActionError as error:
        own = error
    try:
        served = Reply(load_profile("pi05_libero")).read({"actions": value}, 1, 4)
    except ServerError as error:
        served = error
    return own, served


def masked(*rows: int) -> Any:
    mask = np.zeros((4, 7), bool)
    mask[list(rows)] = True
    return np.ma.masked_array(ROWS, mask)


@pytest.mark.parametrize(
    "value",
    [
        ROWS,
        ROWS.astype(np.float16),
        ROWS[None],
        ROWS[None, None],
        ROWS[0],
        ROWS.tolist(),
        list(ROWS),
        tuple(ROWS),
        masked(),
        list(masked()),
    ],
)
def test_numbers_of_a_usual_shape_are_read_both_ways(value: Any) -> None:
    own, served = both(value)
    assert np.array_equal(own, served)
    assert np.allclose(own, ROWS[: len(own)], atol=1e-3)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ({"actions": ROWS}, "'actions'"),
        ({"note": "x", "action": ROWS.tolist()}, "'action'"),
        ({"status": "error"}, "a dict with the keys ['status']"),
        (masked(2, 3), "actions[2, 0] is masked"),
        (list(masked(2)), "actions[2, 0] is masked"),
        (np.stack([ROWS, ROWS]), "shape (2, 4, 7)"),
        (np.array(ROWS.tolist(), dtype=object), "dtype object"),
        ([ROWS[0], ROWS[:2]], "no array"),
        ([[None] * 7], "dtype object"),
        (ROWS.astype(complex), "dtype complex128"),
        (ROWS > 0, "dtype bool"),
        ("left", "a str"),
        (b"left", "a bytes"),
        (None, "NoneType"),
        (0.5, "shape ()"),
        (ROWS[:, :6], "(4, 6)"),
        (ROWS[:0], "0 actions"),
        (np.full((4, 7), np.nan), "actions[0, 0]=nan"),
    ],
)
def test_anything_else_is_refused_both_ways_with_the_same_words(value: Any, words: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        own, served = both(value)
    assert isinstance(own, ActionError)
    assert isinstance(served, ServerError)
    assert words in str(own)
    assert words.strip("'") in str(served)


def test_the_place_of_actions_in_a_dict_is_named_for_who_has_to_mend_it() -> None:
    own, served = both({"policy_timing": {"infer_ms": 3.0}, "actions": ROWS})
    assert "['actions']" in str(own)
    assert 'reply.at = ["actions", "actions"]' in str(served)
    with pytest.raises(ServerError, match=r'reply\.at = \["action"\]'):
        Reply(load_profile("pi05_libero")).read({"action": ROWS}, 1, 4)
    with pytest.raises(ServerError, match=r"reply\.at = \[\]"):
        Reply(load_profile("pi05_libero")).read(ROWS, 1, 4)


def test_the_bytes_of_a_numpy_file_are_read_and_nothing_is_unpickled() -> None:
    reply = Reply(load_profile("pi05_libero"))
    for array, allowed in ((ROWS, True), (np.array([[object()] * 7] * 4), False)):
        file = io.BytesIO()
        np.save(file, array, allow_pickle=not allowed)
        if allowed:
            assert np.array_equal(reply.read({"actions": file.getvalue()}, 1, 4), ROWS)
        else:
            with pytest.raises(ServerError, match="array of object"):
                reply.read({"actions": file.getvalue()}, 1, 4)


def test_an_error_in_a_reply_is_that_of_the_server() -> None:
    with pytest.raises(ServerError, match="'CUDA out of memory'"):
        Reply(load_profile("pi05_libero")).read({"error": "CUDA out of memory", "status": "error"}, 1, 4)
