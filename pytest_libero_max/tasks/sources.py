"""The two benchmarks that vary LIBERO's tasks, and the categories into which they sort their variations."""

from __future__ import annotations

from pytest_libero_max.benchmark.suites import VARIED

SOURCES = VARIED
"""LIBERO-Plus and LIBERO-PRO, as cases name them."""

PLUS_CATEGORIES = (
    "Background Textures",
    "Robot Initial States",
    "Camera Viewpoints",
    "Language Instructions",
    "Sensor Noise",
    "Objects Layout",
    "Light Conditions",
)
"""The seven categories of LIBERO-Plus, in the order of its registry."""

PRO_CATEGORIES = (
    "semantic",
    "object",
    "position",
    "task",
    "visual_noise_glare",
    "camera_view_angle",
    "object_texture",
    "view_occlusion",
    "object_shape",
    "initial_pose_position_angle",
)
"""The ten categories of LIBERO-PRO, in its order."""
