from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest

from pytest_libero_max.worlds.rendering import renderer, visibility
from pytest_libero_max.worlds.rendering.renderer import Renderer
from pytest_libero_max.worlds.rendering.visibility import Boxes, Camera, Part

SIZE = 96
MIRROR = '<material name="mirror" rgba="0.6 0.6 0.6 1" reflectance="0.5"/>'
TABLE = '<geom type="box" size="0.8 0.7 0.03" pos="0 0 -0.03" rgba="0.7 0.5 0.3 1" group="1"/>'
PLATE = '<geom type="box" size="{} {} 0.02" pos="{} {} 0.02" material="mirror" group="1"/>'
LIGHT = '<light pos="1 1 3" dir="-0.3 -0.3 -1" castshadow="{}"/>'


def scene(seed: int, *more: str, shadows: bool = False, mirrors: int = 1) -> mujoco.MjModel:
    """A table over a floor with things on, above, beside and under it, and plates that reflect."""
    rng = np.random.default_rng(seed)
    parts = [LIGHT.format(str(shadows).lower()), '<geom type="plane" size="0 0 1" pos="0 0 -1" group="1"/>']
    parts += [TABLE, *more]
    for _ in range(mirrors):
        parts.append(PLATE.format(*rng.uniform(0.1, 0.2, 2), *rng.uniform(-0.4, 0.4, 2)))
    for number in range(40):
        kind = ("box", "sphere", "capsule", "cylinder", "ellipsoid", "mesh")[number % 6]
        x, y, z = rng.uniform((-1.2, -1.2, -0.9), (1.2, 1.2, 0.9))
        size = " ".join(f"{value:.3f}" for value in rng.uniform(0.02, 0.15, 3))
        shape = 'mesh="wedge"' if kind == "mesh" else f'size="{size}"'
        red, green, blue = rng.uniform(0, 1, 3)
        clear = 0.4 if number % 7 == 0 else 1.0
        turned = " ".join(f"{value:.3f}" for value in rng.normal(size=4))
        parts.append(
            f'<geom type="{kind}" {shape} pos="{x:.3f} {y:.3f} {z:.3f}" quat="{turned}" '
            f'rgba="{red:.2f} {green:.2f} {blue:.2f} {clear}" group="{1 + number % 2}"/>'
        )
    for number in range(12):
        eye = rng.uniform((-1.5, -1.5, 0.05), (1.5, 1.5, 1.5))
        ahead = eye - rng.uniform((-0.4, -0.4, -0.2), (0.4, 0.4, 0.2))
        right = np.cross(rng.normal(size=3), ahead)
        axes = " ".join(f"{value:.4f}" for value in (*right, *np.cross(ahead, right)))
        where = " ".join(f"{value:.3f}" for value in eye)
        parts.append(
            f'<camera name="eye{number}" pos="{where}" xyaxes="{axes}" fovy="{rng.uniform(20, 90):.1f}"/>'
        )
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><asset>{MIRROR}<mesh name="wedge" vertex="0.1 0 0 0.4 0 0 0.1 0.2 0 0.1 0 0.1"/></asset>'
        f"<worldbody>{''.join(parts)}</worldbody></mujoco>"
    )


def drawings(model: mujoco.MjModel) -> list[tuple[bool, int, int, int]]:
    """For each camera: equal images, drawings, geoms left out, of these in the last drawing."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    plain = Renderer(model, data, reflections=True)
    thrifty = Renderer(model, data, reflections=True, thrifty=True)
    found = []
    for number in range(model.ncam):
        image = plain.render(f"eye{number}", (SIZE, SIZE + 20))
        same = np.array_equal(thrifty.render(f"eye{number}", (SIZE, SIZE + 20)), image)
        passes = thrifty._passes(SIZE, SIZE + 20)
        found.append((same, len(passes), len(passes[0].unseen), len(passes[-1].unseen)))
    plain.close()
    thrifty.close()
    return found


@pytest.mark.parametrize("seed", range(3))
def test_what_is_left_out_changes_no_pixel(seed: int) -> None:
    model = scene(seed)
    groups = model.geom_group.copy()
    found = drawings(model)
    assert all(same for same, *_ in found)
    assert np.array_equal(model.geom_group, groups)
    assert max(left_out for *_, left_out, _ in found) > 20


@pytest.mark.parametrize("seed", range(3))
def test_a_mirror_that_is_drawn_apart_changes_no_pixel(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(renderer, "_IMAGE_WORK", -(10**9))
    found = drawings(scene(seed))
    assert all(same for same, *_ in found)
    apart = [(first, last) for _, passes, first, last in found if passes == 2]
    assert apart
    assert all(last > 0 for _, last in apart)


def test_meshes_that_are_looked_at_more_closely_change_no_pixel(monkeypatch: pytest.MonkeyPatch) -> None:
    boxes = sum(left_out for seed in (0, 1) for *_, left_out, _ in drawings(scene(seed)))
    monkeypatch.setattr(visibility, "_MANY_TRIANGLES", 1)
    found = [drawn for seed in (0, 1) for drawn in drawings(scene(seed))]
    assert all(same for same, *_ in found)
    assert sum(left_out for *_, left_out, _ in found) > boxes


def test_pieces_cover_a_mesh_and_are_small() -> None:
    rng = np.random.default_rng(0)
    triangles = rng.uniform(-0.3, 0.3, (60, 3, 3))
    triangles[30:] = triangles[30:, :1] + rng.uniform(-0.01, 0.01, (30, 3, 3))
    low, high = visibility._cover(triangles).swapaxes(0, 1)
    assert (high - low).max() < 3 * visibility._PIECE_M
    points = np.concatenate([rng.dirichlet(np.ones(3), 200) @ triangle for triangle in triangles])
    inside = ((points[:, None] >= low - 1e-9) & (points[:, None] <= high + 1e-9)).all(axis=2)
    assert inside.any(axis=1).all()


@pytest.mark.parametrize("how", [{"shadows": True}, {"mirrors": 2}])
def test_everything_is_drawn_where_shadows_or_a_second_mirror_could_show_it(how: dict[str, Any]) -> None:
    found = drawings(scene(0, **how))
    assert found == [(True, 1, 0, 0)] * len(found)


def test_without_a_mirror_nothing_reflects() -> None:
    found = drawings(scene(1, mirrors=0))
    assert all(same and passes == 1 for same, passes, *_ in found)
    assert max(left_out for *_, left_out, _ in found) > 20


def test_a_glass_table_hides_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    model = scene(2)
    opaque = sum(left_out for *_, left_out, _ in drawings(model))
    model.geom_rgba[1, 3] = 0.5
    glass = drawings(model)
    assert all(same for same, *_ in glass)
    assert sum(left_out for *_, left_out, _ in glass) < opaque
    # And the images do show a difference where too much is left out.
    monkeypatch.setattr(Renderer, "_are_screens", lambda self, geoms: self._model.geom_type[geoms] == 6)
    assert not all(same for same, *_ in drawings(model))


def test_a_part_of_an_image_holds_its_points_and_a_margin() -> None:
    rng = np.random.default_rng(0)
    square = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    for _ in range(50):
        turn = np.linalg.qr(rng.normal(size=(2, 2)))[0]
        part = Part(rng.uniform(0, 64, 2) + square * rng.uniform(0, 30, 2) @ turn)
        points = rng.dirichlet(np.ones(4), 200) @ part.corners
        lines = part.sides(2.0)
        near = points + rng.uniform(-2, 2, points.shape)
        assert (near @ lines[:, :2].T + lines[:, 2] >= -1e-9).all()
        left, bottom, _, _ = rectangle = part.rectangle((64, 64))
        shown = part.pixels(rectangle)
        for column, row in points[((points >= 0) & (points < 64)).all(axis=1)].astype(int):
            assert shown[row - bottom, column - left]


def test_a_camera_says_where_in_its_image_a_point_is() -> None:
    model = scene(3)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    drawer = Renderer(model, data)
    drawer._aim("eye0", SIZE, SIZE + 20)
    camera = Camera.of(mujoco.mjv_averageCamera(*drawer._scene.camera), SIZE, SIZE + 20)
    assert camera is not None
    places = np.random.default_rng(0).uniform(0, SIZE, (20, 2))
    again, depths = camera.seen(camera.eye + 2.5 * camera.rays(places))
    assert np.allclose(again, places)
    assert np.allclose(depths, 2.5)
    turned, half = np.tile(np.eye(3), (20, 1, 1)), np.full((20, 3), 0.01)
    ahead = Boxes(camera.eye + camera.rays(places), turned, half)
    assert ahead.may_be_in(camera.image, camera).all()
    behind = Boxes(camera.eye - camera.rays(places), turned, half)
    assert not behind.may_be_in(camera.image, camera).any()
    drawer.close()
