from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.policies.contract import PolicySpec


def test_integers_of_numpy_are_written_as_json() -> None:
    numbers: dict[str, Any] = {
        "horizon": np.int64(8),
        "query_interval": np.uint8(4),
        "image_size": np.int32(64),
    }
    spec = PolicySpec("p", **numbers)
    assert spec == PolicySpec("p", horizon=8, query_interval=4, image_size=64)
    assert json.loads(json.dumps(spec.to_dict()))["horizon"] == 8


@pytest.mark.parametrize("value", [0, -1, 1.0, np.float64(2.0), "2", None, True, np.bool_(True)])
def test_a_horizon_is_an_integer_of_at_least_one(value: Any) -> None:
    with pytest.raises(AdapterError, match="at least 1") as caught:
        PolicySpec("p", horizon=value)
    assert (caught.value.field, caught.value.value) == ("horizon", value)


def test_images_are_square_or_have_a_height_and_a_width() -> None:
    wide = PolicySpec("p", image_size=(480, np.int64(640)))  # type: ignore[arg-type]
    assert wide.image_size == (480, 640)
    written = json.loads(json.dumps(wide.to_dict()))
    assert written["image_size"] == [480, 640]
    assert PolicySpec("p", image_size=written["image_size"]) == wide
    assert PolicySpec("p", image_size=(256, 256)) == PolicySpec("p")
    for value in ((480,), (480, 640, 3), (480, 0), (480, 5000), "480"):
        with pytest.raises(AdapterError, match=r"^image_size=.* of policy 'p'"):
            PolicySpec("p", image_size=value)  # type: ignore[arg-type]


def test_a_revision_is_part_of_the_spec() -> None:
    assert PolicySpec("p").to_dict()["revision"] is None
    assert PolicySpec("p", revision="3f2a91").to_dict()["revision"] == "3f2a91"


@pytest.mark.parametrize("value", ["", 3, b"abc"])
def test_a_revision_is_text(value: Any) -> None:
    with pytest.raises(AdapterError) as caught:
        PolicySpec("p", revision=value)
    assert (caught.value.field, caught.value.value) == ("revision", value)


def test_only_a_control_that_is_not_delta_is_written() -> None:
    assert "control" not in PolicySpec("p").to_dict()
    assert PolicySpec("p", control="absolute").to_dict()["control"] == "absolute"
    with pytest.raises(AdapterError, match=r"control='absolut' .* mean 'absolute'"):
        PolicySpec("p", control="absolut")  # type: ignore[arg-type]


def test_a_policy_supports_all_suites_or_those_it_names() -> None:
    assert "suites" not in PolicySpec("p").to_dict()
    assert PolicySpec("p").supports("libero_10")
    spec = PolicySpec("p", suites=("libero_object", "libero_goal"))
    assert spec.to_dict()["suites"] == ["libero_goal", "libero_object"]
    assert spec.supports("libero_goal")
    assert not spec.supports("libero_10")


@pytest.mark.parametrize("value", ["libero_goal", (), ("goal",), (3,)])
def test_the_suites_of_a_policy_are_names_of_suites(value: Any) -> None:
    with pytest.raises(AdapterError, match=r"^suites=.* of policy 'p'"):
        PolicySpec("p", suites=value)


def test_no_spec_asks_for_more_than_fits() -> None:
    with pytest.raises(AdapterError, match=r"^horizon=10001 .* 10000 at most"):
        PolicySpec("p", horizon=10_001)
    assert PolicySpec("p", horizon=10_000).horizon == 10_000
