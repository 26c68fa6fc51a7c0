from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pytest_libero_max.errors import ServerError
from pytest_libero_max.policies.clients.served import declared_spec
from pytest_libero_max.policies.contract import PolicySpec


@pytest.mark.parametrize(
    ("greeting", "message"),
    [
        ({}, "declares no spec"),
        ({"spec": {"name": "x"}}, "declares no spec"),
        ({"spec": {**PolicySpec("x").to_dict(), "horizon": 0}}, "cannot be used"),
    ],
)
def test_another_server_is_not_taken_for_one(greeting: Any, message: str) -> None:
    with pytest.raises(ServerError, match=message):
        declared_spec(greeting)


def test_a_spec_with_an_array_in_it_is_an_error_of_the_server() -> None:
    spec = {"name": "x", "horizon": np.arange(2), "query_interval": 4}
    with pytest.raises(ServerError, match="cannot be used"):
        declared_spec({"spec": spec})
