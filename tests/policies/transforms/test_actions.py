from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.policies.transforms import actions
from pytest_libero_max.policies.transforms.states import Array


def with_gripper(*values: float) -> Array:
    result = np.full((len(values), 7), 0.25)
    result[:, 6] = values
    return result


@pytest.mark.parametrize(
    ("rule", "given", "expected"),
    [
        (actions.gripper_from_opening, (0.0, 0.2, 0.5, 0.8, 1.0), (1.0, 1.0, 0.0, -1.0, -1.0)),
        (actions.gripper_from_open_flag, (0.0, 0.5, 0.51, 1.0), (1.0, 1.0, -1.0, -1.0)),
        (actions.gripper_from_close_flag, (0.0, 0.5, 0.51, 1.0), (-1.0, -1.0, 1.0, 1.0)),
        (actions.gripper_sign, (-1.0, -0.1, 0.0, 0.3), (-1.0, -1.0, 1.0, 1.0)),
        (actions.gripper_inverted, (-1.0, 0.0, 0.3), (1.0, 0.0, -0.3)),
        (actions.gripper_flag_below_half, (-0.3, 0.49, 0.5, 1.0), (0.0, 0.0, 1.0, 1.0)),
    ],
)
def test_a_gripper_rule_changes_the_last_column_alone(
    rule: Any, given: tuple[float, ...], expected: tuple[float, ...]
) -> None:
    before = with_gripper(*given)
    after = rule(before)
    assert after[:, 6].tolist() == list(expected)
    assert (after[:, :6] == 0.25).all()
    assert before[:, 6].tolist() == list(given)


def statistics(rule: actions.Rule) -> actions.Statistics:
    return actions.Statistics(np.array([-2.0, 0.0]), np.array([2.0, 10.0]), np.array([True, False]), rule)


def test_one_means_the_upper_bound_and_a_masked_column_stays() -> None:
    normalised = np.array([[-1.0, 0.3], [1.0, 0.3], [0.0, 0.3], [5.0, 5.0]])
    expected = [[-2.0, 0.3], [2.0, 0.3], [0.0, 0.3], [2.0, 1.0]]
    assert np.allclose(actions.unnormalise(normalised, statistics("bounds")), expected)
    assert np.allclose(actions.unnormalise(normalised, statistics("quantiles")), expected)


def test_the_mean_rule_scales_by_the_deviation_without_a_cut() -> None:
    assert np.allclose(actions.unnormalise(np.array([[3.0, 3.0]]), statistics("mean")), [[4.0, 3.0]])


def test_statistics_of_other_columns_or_with_nan_are_refused() -> None:
    with pytest.raises(AdapterError, match="2 columns"):
        actions.unnormalise(np.zeros((4, 7)), statistics("bounds"))
    with pytest.raises(AdapterError, match="not finite"):
        actions.Statistics(np.array([np.nan]), np.ones(1), np.ones(1, bool), "bounds")
    with pytest.raises(AdapterError, match="one entry for"):
        actions.Statistics(np.zeros(2), np.ones(1), np.ones(1, bool), "bounds")


def test_a_statistics_file_is_read_by_key_and_rule(tmp_path: Path) -> None:
    entry = {"action": {"min": [0, 0], "max": [1, 1], "q01": [2, 2], "q99": [3, 3], "mask": [True, False]}}
    path = tmp_path / "dataset_statistics.json"
    path.write_text(json.dumps({"franka": entry}))
    assert actions.read_statistics(path).high.tolist() == [1.0, 1.0]
    assert actions.read_statistics(path, "franka", "quantiles").low.tolist() == [2.0, 2.0]
    assert actions.read_statistics(path).mask.tolist() == [True, False]
    with pytest.raises(AdapterError, match="Did you mean 'franka'"):
        actions.read_statistics(path, "frank")
    with pytest.raises(AdapterError, match=r"action\.mean"):
        actions.read_statistics(path, rule="mean")
    path.write_text(json.dumps({"a": entry, "b": entry}))
    with pytest.raises(AdapterError, match="several entries: a, b"):
        actions.read_statistics(path)
    path.write_text("{")
    with pytest.raises(AdapterError, match="cannot be read"):
        actions.read_statistics(path)


def test_two_columns_become_axis_and_angle() -> None:
    turn = Rotation.from_rotvec([0.3, -0.2, 0.9])
    columns = turn.as_matrix()
    row = [0.1, 0.2, 0.3, *(2.0 * columns[:, 0]), *(columns[:, 1] + 0.5 * columns[:, 0]), 0.7]
    pose = actions.pose_from_rotation_6d(np.array([row]))
    assert np.allclose(pose, [[0.1, 0.2, 0.3, 0.3, -0.2, 0.9, 0.7]])
    with pytest.raises(AdapterError, match="parallel"):
        actions.pose_from_rotation_6d(np.array([[0, 0, 0, 1, 0, 0, 2, 0, 0, 1.0]]))
    with pytest.raises(AdapterError, match=r"\(n, 10\)"):
        actions.pose_from_rotation_6d(np.zeros((2, 7)))


def test_columns_and_limits_are_cut() -> None:
    assert actions.first_columns(np.ones((2, 8)), 7).shape == (2, 7)
    assert actions.clip(np.array([[2.0, -3.0, 0.5]])).tolist() == [[1.0, -1.0, 0.5]]
    with pytest.raises(AdapterError, match="no 7 columns"):
        actions.first_columns(np.ones((2, 6)), 7)


@pytest.mark.parametrize("mask", [[[True], True], "?", [10**400]])
def test_statistics_whose_values_are_no_numbers_are_refused(tmp_path: Path, mask: Any) -> None:
    path = tmp_path / "statistics.json"
    for name in ("min", "mask"):
        action = {"min": [0.0, 0.0], "max": [1.0, 1.0], "mask": [True, True], name: mask}
        path.write_text(json.dumps({"x": {"action": action}}))
        with pytest.raises(AdapterError, match="Statistics"):
            actions.unnormalise(np.zeros((1, 2)), actions.read_statistics(path))
    path.write_text("[" * 9999)
    with pytest.raises(AdapterError, match="cannot be read"):
        actions.read_statistics(path)
