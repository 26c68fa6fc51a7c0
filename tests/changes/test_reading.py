"""Changes from manifests: every field checked, nothing invented."""

import copy
from typing import Any

import pytest

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.changes import OPERATIONS, change_from_dict
from pytest_libero_max.errors import ChangeError

PLACEMENT = {
    "object": "milk_1",
    "relative_to": "butter_1",
    "offset_m": [0.14, 0.0, 0.0],
    "preserve_initial_z": True,
    "support_entity": "floor",
}
VALID: dict[str, Json] = {
    "set_lighting": {"scale": 0.2},
    "shift_camera": {
        "camera": "agentview",
        "delta_position_m": [0.06, 0.0, 0.02],
        "yaw_degrees": 18.0,
        "delta_fovy_degrees": 12.0,
        "calibration": "fixed_global_viewpoint",
    },
    "set_visual_theme": {"rgb_permutation": [2, 0, 1], "rgb_multiplier": [0.7, 1.15, 1.3]},
    "set_sensor_corruption": {"noise_std": 24.0, "occlusion_fraction": 0.08, "seed": 5},
    "move_object": {
        "object": "plate_1",
        "delta_position_m": [-0.06, 0.0, 0.0],
        "direction_xy": [-1.0, 0.0],
        "distance_m": 0.06,
        "support_entity": "main_table",
        "calibration": "deterministic_candidate_requires_preflight",
    },
    "remove_object": {"object": "milk_1", "offworld_position_m": [-2.0, 0.0, -5.0]},
    "insert_distractors": {"distractor_count": 1, "placements": [PLACEMENT]},
    "insert_obstacle": {**PLACEMENT, "placement_rule": "target_support_approach_ring"},
    "nothing": {},
    "reseed_policy": {},
    "orbit_camera": {
        "camera": "agentview",
        "pivot_m": [0.0, 0.0, 0.8],
        "elevation_degrees": 15.0,
        "azimuth_degrees": -40.0,
        "distance_scale": 1.2,
        "yaw_degrees": 4.0,
        "pitch_degrees": -6.0,
    },
    "place_camera": {
        "camera": "agentview",
        "position_m": [0.5, 0.2, 1.6],
        "quaternion_wxyz": [0.6, 0.0, 0.8, 0.0],
        "blend": 0.5,
    },
    "offset_arm": {"delta_joint_rad": [0.1, 0.0, -0.1, 0.2, 0.0, 0.1, 0.0], "keep_clear": True},
    "set_lamps": {
        "levels": [0.02, 0.16, 0.01],
        "diffuse_factor": [1.2, 0.8, 1.0],
        "specular": 2.0,
        "azimuth_degrees": 30.0,
        "tilt_degrees": -10.0,
        "cast_shadows": True,
        "blend": 0.5,
    },
    "set_texture": {"material": "room_table", "texture": "surface_cork"},
    "cover_entity": {"entity": "plate_1", "rgb": [1.0, 0.5, 0.0], "texture": "surface_cork"},
    "corrupt_picture": {"camera": "agentview", "kind": "fog", "level": 3, "seed": 5, "blend": 0.5},
    "set_glare": {"strength": 0.8, "across": 0.5, "up": 0.7, "radius": 0.3},
    "put_object": {
        "object": "milk_1",
        "onto": "main_table",
        "offset_xy_m": [0.1, 0.0],
        "relative_to": "plate_1",
        "yaw_degrees": 20.0,
    },
    "turn_object": {"object": "milk_1", "yaw_degrees": 45.0},
    "set_instruction": {"instruction": "grab the milk", "style": "synonyms"},
    "hide_inputs": {"cameras": ["agentview"], "state": True},
    "freeze_images": {"cameras": ["agentview"], "height": 64, "width": 64},
    "swap_images": {
        "cameras": ["agentview"],
        "height": 64,
        "width": 64,
        "suite": "libero_object",
        "task_index": 3,
        "init_state_index": 0,
    },
    "open_gripper": {},
    "bump_object": {"object": "milk_1", "velocity_m_s": [0.5, 0.0, -1.0]},
    "delay_answers": {"latency": "4steps,sync"},
    "set_task": {"instruction": "take the milk", "goal": [["on", "milk_1", "plate_1"]]},
    "replace_instruction": {
        "instruction": "take the milk",
        "alternate_goal": [{"predicate": "On", "arguments": ["milk_1", "plate_1"]}],
        "alternate_task_id": "libero_object/task_7",
    },
    "cancel_instruction": {
        "instruction": "leave it",
        "stop_window_steps": 10,
        "eef_stop_threshold_m": 0.02,
        "eef_path_threshold_m": 0.04,
        "target_stop_threshold_m": 0.01,
    },
}


@pytest.mark.parametrize("operation", OPERATIONS)
def test_a_change_is_written_as_it_was_read(operation: str) -> None:
    raw = {"operation": operation, **VALID[operation]}
    kept = copy.deepcopy(raw)
    assert change_from_dict(raw).to_dict() == raw == kept


@pytest.mark.parametrize("operation", OPERATIONS)
def test_an_unknown_field_is_refused(operation: str) -> None:
    with pytest.raises(ChangeError, match=f"{operation} .*'extra'"):
        change_from_dict({"operation": operation, **VALID[operation], "extra": 1})


OPTIONAL = {
    "orbit_camera": {
        "elevation_degrees",
        "azimuth_degrees",
        "distance_scale",
        "yaw_degrees",
        "pitch_degrees",
    },
    "place_camera": {"blend"},
    "offset_arm": {"keep_clear"},
    "delay_answers": {"latency"},
    "set_lamps": set(VALID["set_lamps"]),
    "cover_entity": {"texture"},
    "corrupt_picture": {"blend"},
    "put_object": {"relative_to", "yaw_degrees"},
    "set_instruction": {"style"},
    "replace_instruction": {"alternate_task_id"},
}
REQUIRED = [
    (operation, field)
    for operation, fields in VALID.items()
    for field in fields
    if field not in ("calibration", "direction_xy", "distance_m", "support_entity", "placement_rule")
    and field not in OPTIONAL.get(operation, ())
]


@pytest.mark.parametrize(("operation", "field"), REQUIRED)
def test_a_missing_field_is_named(operation: str, field: str) -> None:
    raw = {"operation": operation, **VALID[operation]}
    del raw[field]
    with pytest.raises(ChangeError, match=f"{operation} lacks {field}"):
        change_from_dict(raw)


WRONG = {"list": [], "dict": {}, "nan": float("nan"), "empty": "", "huge": 10**400}


EMPTY_IS_FINE = {("set_instruction", "instruction", "empty"), ("hide_inputs", "cameras", "list")}


@pytest.mark.parametrize(
    ("operation", "field", "wrong"),
    [
        (operation, field, wrong)
        for operation, fields in VALID.items()
        for field in fields
        for wrong in WRONG
        if (field, wrong) != ("seed", "huge")  # a seed may be as long as it likes
        and (operation, field, wrong) not in EMPTY_IS_FINE
    ],
)
def test_a_wrong_value_is_named(operation: str, field: str, wrong: str) -> None:
    with pytest.raises(ChangeError, match=f"{operation}\\.{field}"):
        change_from_dict({"operation": operation, **VALID[operation], field: WRONG[wrong]})


@pytest.mark.parametrize(
    ("operation", "field", "wrong", "message"),
    [
        ("set_lighting", "scale", -0.1, r"scale=-0.1, but must be a finite number from 0 to 100"),
        ("set_lighting", "scale", 101, r"scale=101, but must be a finite number from 0 to 100"),
        (
            "move_object",
            "delta_position_m",
            [1e6, 0, 0],
            r"delta_position_m\[0\]=1000000.0, but must be a finite number from -10 to 10",
        ),
        (
            "remove_object",
            "offworld_position_m",
            [0, 0, -11],
            r"offworld_position_m\[2\]=-11, but must be a finite number from -10 to 10",
        ),
        ("set_lighting", "scale", True, r"scale=True, but must be a finite number"),
        (
            "shift_camera",
            "delta_position_m",
            [0, 0],
            r"delta_position_m=\[0, 0\], but must be a list of 3 items",
        ),
        (
            "shift_camera",
            "delta_position_m",
            [0, 0, "up"],
            r"delta_position_m\[2\]='up', but must be a finite",
        ),
        ("set_visual_theme", "rgb_permutation", [0, 0, 1], r"must be a permutation of \[0, 1, 2\]"),
        (
            "set_visual_theme",
            "rgb_permutation",
            [0, 1, 3],
            r"rgb_permutation\[2\]=3, but must be an integer from 0 to 2",
        ),
        ("set_sensor_corruption", "occlusion_fraction", 1.5, "from 0 to 1"),
        ("set_sensor_corruption", "seed", 1.5, "must be an integer of at least 0"),
        ("insert_distractors", "distractor_count", 2, "distractor_count=2, but there are 1 placement"),
        ("insert_distractors", "placements", [3], r"placements\[0\]=3, but must be an object"),
        ("insert_distractors", "placements", [PLACEMENT, PLACEMENT], "every object may come back only once"),
        (
            "insert_distractors",
            "placements",
            [{**PLACEMENT, "offset": 1}],
            r"placements\[0\]: placement has the unknown field 'offset'. Did you mean 'offset_m'",
        ),
        (
            "insert_distractors",
            "placements",
            [{**PLACEMENT, "operation": "insert_obstacle"}],
            "a placement is not a change",
        ),
        ("place_camera", "quaternion_wxyz", [1.0, 1.0, 0.0, 0.0], "must have unit length"),
        ("orbit_camera", "distance_scale", 0.0, "distance_scale=0.0, but must be a finite number from 0.05"),
        ("corrupt_picture", "kind", "frog", "kind='frog' is not a corruption. Did you mean 'fog'"),
        ("corrupt_picture", "level", 11, "level=11, but must be an integer from 1 to 10"),
        ("cover_entity", "rgb", [1.0, 0.5, 1.5], r"rgb\[2\]=1.5, but must be a finite number from 0 to 1"),
        ("offset_arm", "delta_joint_rad", [], "must be a list of at least one number"),
        ("set_task", "goal", [], "must be a non-empty list of predicates"),
        ("set_task", "goal", [["on"]], r"goal\[0\]=\['on'\], but must be a predicate and one or two names"),
        ("insert_obstacle", "preserve_initial_z", 1, "preserve_initial_z=1, but must be true or false"),
    ],
)
def test_a_broken_rule_is_explained(operation: str, field: str, wrong: object, message: str) -> None:
    with pytest.raises(ChangeError, match=message):
        change_from_dict({"operation": operation, **VALID[operation], field: wrong})


@pytest.mark.parametrize("raw", [None, [], "shift_camera"])
def test_what_is_no_object_is_refused(raw: Any) -> None:
    with pytest.raises(ChangeError, match="operation"):
        change_from_dict(raw)


@pytest.mark.parametrize("operation", [None, 3, ["set_lighting"], "set_lightning"])
def test_an_unknown_operation_is_refused(operation: object) -> None:
    with pytest.raises(ChangeError, match="is not a change"):
        change_from_dict({"operation": operation})


def test_the_closest_operation_is_suggested() -> None:
    with pytest.raises(ChangeError, match="Did you mean 'set_lighting'"):
        change_from_dict({"operation": "set_lightning"})
