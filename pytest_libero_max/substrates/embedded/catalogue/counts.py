"""The numbers of variations of each kind in LIBERO-Plus's registry, which the catalogue reproduces."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

KINDS = (
    "table",
    "table_and_wall",
    "spherical",
    "distance",
    "orientation",
    "language",
    "light",
    "add",
    "level",
    "robot",
    "noise",
)
"""The columns of :data:`VARIATIONS`: surfaces, camera moves, words, light, layouts, poses, corruptions."""

VARIATIONS: Mapping[str, tuple[tuple[int, ...], ...]] = MappingProxyType(
    {
        "libero_spatial": (
            (19, 10, 4, 0, 2, 46, 42, 24, 20, 32, 32),
            (6, 4, 28, 3, 6, 32, 10, 18, 19, 38, 34),
            (23, 23, 24, 4, 7, 28, 50, 21, 17, 35, 35),
            (11, 20, 30, 10, 9, 42, 24, 25, 20, 24, 31),
            (17, 9, 28, 10, 10, 37, 44, 26, 19, 40, 40),
            (20, 15, 28, 9, 9, 32, 34, 24, 16, 32, 37),
            (8, 12, 29, 10, 3, 46, 31, 19, 13, 27, 34),
            (21, 20, 29, 10, 4, 35, 32, 18, 16, 43, 41),
            (6, 0, 19, 10, 4, 45, 4, 9, 18, 37, 28),
            (9, 5, 19, 10, 8, 47, 21, 24, 19, 42, 39),
        ),
        "libero_object": (
            (20, 12, 14, 0, 7, 23, 41, 21, 20, 42, 42),
            (5, 0, 12, 3, 5, 34, 4, 7, 20, 39, 44),
            (11, 14, 30, 10, 7, 36, 32, 25, 17, 40, 42),
            (26, 21, 29, 9, 9, 26, 49, 24, 20, 38, 41),
            (6, 5, 27, 10, 10, 37, 13, 5, 20, 38, 43),
            (9, 4, 30, 10, 10, 36, 22, 30, 18, 38, 44),
            (18, 3, 30, 10, 9, 28, 45, 24, 20, 42, 44),
            (15, 17, 29, 10, 9, 42, 26, 25, 20, 40, 39),
            (16, 6, 27, 10, 4, 49, 31, 18, 20, 34, 42),
            (21, 19, 9, 10, 7, 43, 34, 29, 20, 47, 41),
        ),
        "libero_goal": (
            (18, 12, 14, 0, 7, 46, 42, 25, 19, 43, 42),
            (6, 0, 25, 3, 4, 19, 4, 10, 18, 38, 29),
            (19, 22, 30, 7, 3, 39, 28, 25, 19, 40, 38),
            (25, 20, 30, 8, 10, 50, 50, 27, 18, 45, 41),
            (7, 6, 30, 10, 10, 44, 13, 16, 18, 43, 46),
            (18, 9, 30, 10, 9, 39, 36, 27, 19, 40, 33),
            (15, 17, 29, 10, 10, 48, 25, 25, 18, 47, 47),
            (7, 4, 30, 10, 6, 40, 21, 30, 18, 37, 29),
            (17, 13, 18, 10, 3, 35, 26, 25, 19, 37, 32),
            (26, 20, 23, 10, 9, 50, 34, 30, 19, 39, 42),
        ),
        "libero_10": (
            (7, 6, 14, 0, 6, 45, 13, 19, 15, 41, 46),
            (16, 19, 25, 1, 6, 21, 18, 20, 14, 35, 35),
            (21, 12, 28, 10, 9, 41, 42, 13, 13, 44, 48),
            (24, 21, 29, 9, 10, 47, 49, 13, 10, 44, 48),
            (24, 20, 28, 9, 10, 42, 33, 22, 13, 38, 48),
            (9, 4, 27, 10, 9, 28, 22, 29, 19, 34, 46),
            (20, 19, 30, 9, 7, 46, 31, 18, 17, 42, 44),
            (8, 0, 30, 10, 10, 41, 4, 4, 9, 39, 39),
            (19, 12, 27, 9, 7, 30, 24, 14, 11, 34, 46),
            (20, 8, 20, 10, 10, 42, 38, 21, 18, 42, 49),
        ),
    }
)
"""Variations of each unmodified task by kind, in the suite's order of tasks."""

DIFFICULTY: Mapping[str, Mapping[str, tuple[int, ...]]] = MappingProxyType(
    {
        "Background Textures": MappingProxyType(
            {
                "libero_spatial": (99, 87, 55, 16, 1, 0),
                "libero_object": (76, 59, 82, 26, 5, 0),
                "libero_goal": (34, 69, 73, 60, 45, 0),
                "libero_10": (24, 56, 53, 61, 95, 0),
            }
        ),
        "Robot Initial States": MappingProxyType(
            {
                "libero_spatial": (90, 69, 75, 46, 70, 0),
                "libero_object": (50, 70, 90, 87, 101, 0),
                "libero_goal": (44, 76, 109, 69, 111, 0),
                "libero_10": (64, 77, 100, 83, 69, 0),
            }
        ),
        "Camera Viewpoints": MappingProxyType(
            {
                "libero_spatial": (67, 133, 114, 40, 22, 0),
                "libero_object": (63, 71, 58, 58, 146, 0),
                "libero_goal": (53, 109, 98, 72, 76, 0),
                "libero_10": (16, 47, 55, 58, 243, 0),
            }
        ),
        "Language Instructions": MappingProxyType(
            {
                "libero_spatial": (115, 100, 58, 82, 35, 0),
                "libero_object": (103, 67, 72, 63, 49, 0),
                "libero_goal": (45, 49, 52, 79, 185, 0),
                "libero_10": (65, 64, 77, 104, 73, 0),
            }
        ),
        "Sensor Noise": MappingProxyType(
            {
                "libero_spatial": (51, 136, 95, 57, 12, 0),
                "libero_object": (40, 157, 71, 104, 50, 0),
                "libero_goal": (59, 110, 53, 98, 59, 0),
                "libero_10": (27, 97, 81, 124, 120, 0),
            }
        ),
        "Objects Layout": MappingProxyType(
            {
                "libero_spatial": (6, 40, 141, 153, 45, 0),
                "libero_object": (76, 78, 63, 33, 153, 0),
                "libero_goal": (116, 110, 60, 51, 88, 0),
                "libero_10": (150, 74, 65, 20, 3, 0),
            }
        ),
        "Light Conditions": MappingProxyType(
            {
                "libero_spatial": (52, 104, 92, 38, 6, 0),
                "libero_object": (2, 9, 71, 110, 105, 0),
                "libero_goal": (46, 49, 28, 21, 14, 121),
                "libero_10": (11, 35, 53, 73, 102, 0),
            }
        ),
    }
)
"""Variations of difficulty 1 to 5, and of none, by category and suite. The order of the categories is that of
the registry."""
