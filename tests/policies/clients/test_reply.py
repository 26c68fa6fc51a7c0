"""Whatever a reply holds: actions of the right shape, or a ServerError."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from pytest_libero_max.errors import ServerError
from pytest_libero_max.policies.clients.messages import Reply
from pytest_libero_max.policies.profile import load_profile

ARRAYS = npst.arrays(
    st.sampled_from(["<f8", "<f4", "<i8", "|u1", "|b1"]),
    npst.array_shapes(min_dims=0, max_dims=4, max_side=9),
)
KEYS = ("actions", "action", "normalized_actions", "action.x", "action.gripper", "x", "data")
VALUES = st.recursive(
    st.none() | st.booleans() | st.floats() | st.text("ab", max_size=2) | st.binary(max_size=3) | ARRAYS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(KEYS), inner, max_size=3),
    max_leaves=6,
)


@pytest.mark.parametrize("name", ["pi05_libero", "openvla_oft", "starvla", "gr00t_n17", "vla_eval"])
@given(value=VALUES)
@settings(max_examples=60)
def test_any_reply_gives_actions_or_a_server_error(name: str, value: Any) -> None:
    reply = Reply(load_profile(name))
    for tried in (value, {"actions": value}):
        with suppress(ServerError):
            actions = reply.read(tried, 1, 8)
            assert actions.dtype == np.float64
            assert actions.ndim == 2
            assert actions.shape[1] == 7
            assert 1 <= len(actions) <= 8
            assert np.isfinite(actions).all()


def test_a_signalling_nan_is_an_error_without_a_warning() -> None:
    number = np.frombuffer(b"\x01\x00\x80\x7f", "<f4")
    with pytest.raises(ServerError, match="finite"):
        Reply(load_profile("vla_eval")).read({"actions": np.tile(number, (8, 7))}, 1, 8)
