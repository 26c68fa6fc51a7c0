"""Images of a world, straight from MuJoCo: OpenGL row order, shadows only of lights told to cast them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any
from weakref import WeakSet

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import SimulatorError, SubstrateError, did_you_mean
from pytest_libero_max.worlds.contract import Image, ImageSize, height_and_width
from pytest_libero_max.worlds.rendering import gl
from pytest_libero_max.worlds.rendering.context import shared_context
from pytest_libero_max.worlds.rendering.visibility import Boxes, Camera, Mirror, Part, Pieces

gl.prepare()

import mujoco  # noqa: E402

OFFSAMPLES = 4
"""Samples per pixel, as in LIBERO. In software, 4 take twice the time of none (12 instead of 6 ms for a
256 pixel image of a tabletop scene, on one core), and 2 as long as 4."""

MAX_GEOMS = 2000
MAX_SIZE = 4096
DRAWN_GROUPS = (1, 2)
"""Geom groups in an image, as in LIBERO: 0 holds collision shapes, 3 and more are never drawn."""

SHADOW_MAP = 2048
"""Side of the shadow map in texels, where a light casts shadows. With it an image takes some ten times as
long in software, so that the light events and most scenes do without."""

SHADOW_REACH = 3.0
"""Half the width of the area of a directional light's shadow map, in extents of the model: the whole room.
A narrower one leaves the map's own texels as shadows on everything."""

_LEFT_OUT = 5
"""Geom group of what is out of view, while a scene is put together."""

_SHAPE_WORK, _IMAGE_WORK = 1000, 22000
"""Triangles in whose time a box is drawn, and an image that shows nothing."""

_OUT_OF_VIEW = 0.4
"""Time that a triangle beside the image takes, of the time of one in it."""

_BOX = mujoco.mjtGeom.mjGEOM_BOX
_NOTHING = np.array([], np.intp)
_NOTHING.setflags(write=False)
_Test = Callable[[Boxes], NDArray[np.bool_]]


class Renderer:
    """Draws one model from its cameras.

    All renderers of a process share one GL context, made with the first image and current whenever one
    of them draws, so that any number of worlds can be looked at in turns. Those whose models have the same
    textures and meshes share these as well: to upload those of a genuine scene takes about a second.

    Args:
        model: Its textures and meshes are uploaded with the first image and not again.
        data: Its derived values must be up to date whenever :meth:`render` is called.
        reflections: True to let a reflective surface reflect, the first of them, as MuJoCo does.
        thrifty: True to leave out geoms that are out of view, and to draw reflections only around the mirror.
            No pixel depends on it. To find those geoms takes longer than to draw a small scene.
        samples: Samples per pixel; 0 for none beside the pixel's own.
        groups: Geom groups that are drawn.

    Attributes:
        thrifty: The same, for the next image.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        reflections: bool = False,
        *,
        thrifty: bool = False,
        samples: int = OFFSAMPLES,
        groups: tuple[int, ...] = DRAWN_GROUPS,
    ) -> None:
        self._model = model
        self._data = data
        self._reflections = reflections
        self.thrifty = thrifty
        self._samples = samples
        self._groups = groups
        self._uploaded: _Uploaded | None = None
        self._scene: Any = None
        self._pieces: Pieces | None = None  # found when they are needed

    def render(self, camera: str, size: ImageSize) -> Image:
        """One image, (H, W, 3) uint8, freshly allocated, bottom row first.

        Raises:
            SubstrateError: No such camera, or a size that cannot be drawn.
            SimulatorError: No OpenGL backend is available.
        """
        height, width = height_and_width(size)
        self._aim(camera, height, width)
        whole, *rest = self._passes(height, width)
        image = self._draw(height, width, whole)
        for reflection in rest:
            assert reflection.part is not None
            left, bottom, right, top = rectangle = reflection.part.rectangle((width, height))
            shown = reflection.part.pixels(rectangle)
            image[bottom:top, left:right][shown] = self._draw(height, width, reflection, rectangle)[shown]
        return image

    def segment(self, camera: str, size: int, kind: Any = mujoco.mjtObj.mjOBJ_GEOM) -> NDArray[np.intp]:
        """Return the geom that each pixel shows, (size, size), bottom row first; -1 where there is none.

        It is drawn without samples between pixels, so each shows one geom. The errors are those of
        :meth:`render`.

        Args:
            kind: Kind of the objects that are returned, geoms or sites, as MuJoCo calls it.
        """
        self._aim(camera, size, size)
        flags = self._scene.flags
        flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = 1
        drawn = self._draw(size, size, _Pass(_NOTHING)).astype(np.intp)
        codes = drawn @ (1, 2**8, 2**16)  # 0 is the background
        flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = 0
        shown = np.full(self._scene.ngeom + 1, -1, dtype=np.intp)
        for geom in self._scene.geoms[: self._scene.ngeom]:
            if geom.objtype == kind:
                shown[geom.segid + 1] = geom.objid
        geoms: NDArray[np.intp] = shown[codes]
        return geoms

    def _aim(self, camera: str, height: int, width: int) -> None:
        """Set the scene up for one camera."""
        number = mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_CAMERA, camera)
        if number < 0:
            known = [self._model.camera(i).name for i in range(self._model.ncam)]
            hint = did_you_mean(camera, known)
            raise SubstrateError(f"camera={camera!r} does not exist in this scene. {hint}")
        if not (1 <= height <= MAX_SIZE and 1 <= width <= MAX_SIZE):
            raise SubstrateError(
                f"size=({height}, {width}): images are 1 to {MAX_SIZE} pixels high and wide."
            )
        self._prepare(max(height, width))
        self._camera.fixedcamid = number
        mujoco.mjv_updateCamera(self._model, self._data, self._camera, self._scene)

    def _passes(self, height: int, width: int) -> list[_Pass]:
        """Return what has to be drawn: an image, and then perhaps the part of it that shows a mirror."""
        model, data = self._model, self._data
        all_of_it = [_Pass(_NOTHING, self._reflections)]
        if not self.thrifty or self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW]:
            return all_of_it  # shadows of what is out of view may be in view
        camera = Camera.of(mujoco.mjv_averageCamera(*self._scene.camera), height, width)
        if camera is None:
            return all_of_it
        geoms = np.flatnonzero(np.isin(model.geom_group, self._groups))
        reflectors = self._reflectors(geoms) if self._reflections else _NOTHING
        if reflectors.size and (reflectors.size > 1 or model.geom_type[reflectors] != _BOX):
            return all_of_it
        pieces = self._pieces = self._pieces or Pieces.of(model)
        boxes = Boxes.of(model, data, geoms)
        screens = boxes.chosen(self._are_screens(geoms) & boxes.wide)
        screens = screens.chosen(screens.may_be_in(camera.image, camera))
        here = np.flatnonzero(np.isin(pieces.geoms, geoms))
        places = np.searchsorted(geoms, pieces.geoms[here])

        def which(
            test: Callable[[Boxes], NDArray[np.bool_]], at_side: NDArray[np.bool_]
        ) -> NDArray[np.bool_]:
            """Return which geoms pass a test; large ones at a side of the part are tested piece by piece."""
            passing = test(boxes)
            closer = np.flatnonzero((passing & at_side)[places])
            remaining = test(pieces.placed(here[closer], data))
            passing[places[closer]] = False
            passing[places[closer[remaining]]] = True
            return passing

        def seen_in(part: Part) -> NDArray[np.bool_]:
            return which(lambda some: _seen(some, screens, part, camera), boxes.cross(part, camera))

        seen = seen_in(camera.image)
        direct = _Pass(geoms[~seen], False)
        if not reflectors.size or reflectors[0] in direct.unseen:
            return [direct]
        number = reflectors[0]
        mirror = Mirror.of(data.geom_xpos[number], data.geom_xmat[number], model.geom_size[number])
        if not mirror.faces(camera.eye):
            return [direct]
        part = mirror.part(camera)
        if part is None:
            return all_of_it
        left, bottom, right, top = part.rectangle(camera.size)
        if left >= right or bottom >= top:
            return [direct]
        shown = which(
            lambda some: some.mirrored(mirror).may_be_in(part, camera),
            boxes.mirrored(mirror).cross(part, camera),
        )
        near = seen_in(part)
        work = self._work(geoms)
        second_pass = work[near].sum() + _OUT_OF_VIEW * work[shown ^ near].sum() + _IMAGE_WORK
        if second_pass > _OUT_OF_VIEW * work[shown ^ seen].sum():
            return [_Pass(geoms[~(seen | shown)], True)]
        return [direct, _Pass(geoms[~(near | shown)], True, part)]

    def _reflectors(self, geoms: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return those geoms of which MuJoCo lets the first that is opaque reflect."""
        model = self._model
        if not (model.mat_reflectance > 0).any():
            return _NOTHING
        materials, kinds = model.geom_matid[geoms], model.geom_type[geoms]
        flat = (kinds == mujoco.mjtGeom.mjGEOM_PLANE) | (kinds == _BOX)
        reflectors: NDArray[np.intp] = geoms[flat & (materials >= 0) & (model.mat_reflectance[materials] > 0)]
        return reflectors

    def _are_screens(self, geoms: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Return for each of some geoms whether it hides what is behind it: an opaque box."""
        model = self._model
        materials = model.geom_matid[geoms]
        opaque: NDArray[np.bool_] = (model.geom_type[geoms] == _BOX) & (model.geom_rgba[geoms, 3] == 1)
        if model.nmat:
            opaque &= (materials < 0) | (model.mat_rgba[materials, 3] == 1)
        return opaque

    def _work(self, geoms: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return roughly how many triangles some geoms are drawn with."""
        model = self._model
        meshes = model.geom_type[geoms] == mujoco.mjtGeom.mjGEOM_MESH
        work = np.full(geoms.size, _SHAPE_WORK, np.intp)
        work[meshes] += model.mesh_facenum[model.geom_dataid[geoms[meshes]]]
        return work

    def _draw(
        self, height: int, width: int, drawn: _Pass, rectangle: tuple[int, int, int, int] | None = None
    ) -> Image:
        """Draw an image, and return it or a rectangle of it: left, bottom, right, top."""
        viewport = mujoco.MjrRect(0, 0, width, height)
        left, bottom, right, top = rectangle or (0, 0, width, height)
        assert self._uploaded is not None
        groups = self._model.geom_group
        kept = groups[drawn.unseen]
        groups[drawn.unseen] = _LEFT_OUT
        scene, everything = self._scene, mujoco.mjtCatBit.mjCAT_ALL
        try:
            mujoco.mjv_updateScene(
                self._model, self._data, self._option, None, self._camera, everything, scene
            )
        finally:
            groups[drawn.unseen] = kept
        scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = drawn.reflections
        mujoco.mjr_render(viewport, scene, self._uploaded.context)
        image: Image = np.empty((top - bottom, right - left, 3), dtype=np.uint8)
        read = mujoco.MjrRect(left, bottom, right - left, top - bottom)
        mujoco.mjr_readPixels(image, None, read, self._uploaded.context)
        return image

    def close(self) -> None:
        """Free buffers, meshes and textures. The renderer makes them again if it is used again."""
        if self._uploaded is not None:
            self._uploaded.release()
            self._uploaded = self._scene = None

    def rest(self, *, shareable: bool) -> None:
        """Let what is uploaded go: now, or if another renderer can share it, where that one cannot after all.

        It is uploaded again if it is used again.
        """
        if self._uploaded is not None:
            self._uploaded.resting = True
            if not shareable:
                self._uploaded.free()

    def _prepare(self, size: int) -> None:
        shared_context().make_current()
        shadows = bool(self._model.light_castshadow.any())
        if self._uploaded is not None and not self._uploaded.suits(_Target(size, shadows, self._samples)):
            self.close()
        if self._uploaded is None:
            self._open(max(size, 256), shadows)
        assert self._uploaded is not None
        self._uploaded.use_for(self._model)

    def _open(self, side: int, shadows: bool) -> None:
        self._uploaded = _uploaded_for(self._model, _Target(side, shadows, self._samples))
        self._scene = mujoco.MjvScene(self._model, maxgeom=MAX_GEOMS)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = shadows
        self._option = mujoco.MjvOption()
        self._option.geomgroup[:] = [group in self._groups for group in range(6)]
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED


@dataclass(frozen=True)
class _Pass:
    """One drawing of an image."""

    unseen: NDArray[np.intp]
    """Geoms that are left out."""
    reflections: bool = False
    """True if a mirror reflects."""
    part: Part | None = None
    """Part of the image that it is for; None: all of it."""


def _seen(boxes: Boxes, screens: Boxes, part: Part, camera: Camera) -> NDArray[np.bool_]:
    """Return for each box whether some of it may be seen in a part of an image."""
    seen = boxes.may_be_in(part, camera)
    there = np.flatnonzero(seen)
    seen[there] = ~boxes.chosen(there).hidden_by(screens, part, camera)
    return seen


@dataclass(frozen=True)
class _Target:
    """Buffers that images are drawn into."""

    side: int
    """Of the largest image, pixels."""
    shadows: bool
    """True if some light casts them."""
    samples: int
    """Samples per pixel."""

    def holds(self, other: _Target) -> bool:
        """Return True if what another target is for can be drawn into this one."""
        return other.side <= self.side and replace(other, side=self.side) == self


class _Uploaded:
    """Buffers to draw into, and the textures and meshes of a model, in the memory of the renderer.

    Attributes:
        context: MuJoCo's handle of them.
        model: The model that asked last; earlier ones need not stay in memory.
        users: Renderers that draw with it; without any it is freed.
        resting: True if the next upload may free it.
        freed: True if it cannot be used any more.

    Raises:
        SimulatorError: The driver refuses.
    """

    def __init__(self, model: mujoco.MjModel, target: _Target) -> None:
        self.model, self._target = model, target
        self._shapes = _shapes(model)
        self.users = 0
        self.resting = self.freed = False
        try:
            self.context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        except mujoco.FatalError as error:
            raise SimulatorError(
                f"MuJoCo cannot draw with {gl.VARIABLE}={gl.require()!r}: {error}."
            ) from error

    def suits(self, target: _Target) -> bool:
        """Return True if images of this size can be drawn, with these shadows and samples."""
        return not self.freed and self._target.holds(target)

    def holds(self, model: mujoco.MjModel) -> bool:
        """Return True if a model has these very textures, meshes and other shapes."""
        return self._shapes == _shapes(model) and all(
            _equal(_bytes(self.model, name), _bytes(model, name)) for name in _UPLOADS
        )

    def use_for(self, model: mujoco.MjModel) -> None:
        """Draw a model next."""
        self.resting = False
        # The framebuffer in use belongs to the GL context, and another renderer may have drawn last.
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self.context)
        # The context keeps its own copy of which texture a material shows, and how.
        for name in ("mat_texid", "mat_texrepeat", "mat_texuniform"):
            values = getattr(model, name)
            getattr(self.context, name)[: values.size] = values.ravel()

    def release(self) -> None:
        """Count one renderer less, and free the buffers without any."""
        self.users -= 1
        if self.users == 0:
            self.free()

    def free(self) -> None:
        """Free the buffers."""
        if not self.freed:
            self.freed = True
            _in_use.discard(self)
            shared_context().make_current()
            self.context.free()


_UPLOADS = tuple(
    name for name in dir(mujoco.MjModel) if name.startswith(("tex_", "mesh_", "hfield_", "skin_"))
)


_PIECE = 2**18
"""Bytes compared at once: textures have 200 million, and NumPy's answer for all of them is as large."""


def _bytes(model: mujoco.MjModel, name: str) -> NDArray[np.uint8]:
    """Return an array of a model as its bytes: some hold NaN, which is not equal to itself."""
    values: NDArray[np.uint8] = getattr(model, name).reshape(-1).view(np.uint8)
    return values


def _equal(first_bytes: NDArray[np.uint8], second_bytes: NDArray[np.uint8]) -> bool:
    """Return True if two arrays have the same bytes."""
    pieces = range(0, first_bytes.size, _PIECE)
    return first_bytes.size == second_bytes.size and all(
        np.array_equal(first_bytes[first : first + _PIECE], second_bytes[first : first + _PIECE])
        for first in pieces
    )


def _shapes(model: mujoco.MjModel) -> tuple[object, ...]:
    """Parts of a model in the context beside textures and meshes: planes, round shapes, fog, shadows."""
    planes = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
    materials = model.geom_matid[planes]
    arrays = (model.geom_size[planes], materials >= 0, model.mat_texrepeat[materials[materials >= 0]])
    settings = (model.vis.global_.linewidth, model.vis.map, model.vis.quality, model.vis.rgba)
    return (*(array.tobytes() for array in arrays), *map(repr, settings), model.stat.extent)


_in_use: WeakSet[_Uploaded] = WeakSet()  # a world that nobody closes takes what it has uploaded with it


def _uploaded_for(model: mujoco.MjModel, target: _Target) -> _Uploaded:
    """Return the upload of another renderer if it serves this model as well, else a new one."""
    model.vis.global_.offwidth = model.vis.global_.offheight = target.side
    model.vis.quality.offsamples = target.samples
    model.vis.quality.shadowsize = SHADOW_MAP if target.shadows else 0
    model.vis.map.shadowclip = SHADOW_REACH
    known = (resting for resting in _in_use if resting.suits(target) and resting.holds(model))
    upload = next(known, None)
    if upload is None:
        for resting in [resting for resting in _in_use if resting.resting]:
            resting.free()
        upload = _Uploaded(model, target)
        _in_use.add(upload)
    upload.model = model
    upload.users += 1
    return upload


def require_images() -> None:
    """Draw one tiny image to check that this process can, or raise SimulatorError."""
    model = mujoco.MjModel.from_xml_string(_ONE_BALL)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    renderer = Renderer(model, data)
    cure = f"Set {gl.VARIABLE} to the other one of {', '.join(gl.OFFSCREEN)}, or repair the driver."
    try:
        image = renderer.render("eye", 64)
    except SimulatorError as error:
        raise SimulatorError(f"{error} {cure}") from error
    renderer.close()
    if image.min() == image.max():
        raise SimulatorError(
            f"The OpenGL backend {gl.require()!r} draws one colour only where a ball should be. {cure}"
        )


_ONE_BALL = """<mujoco><worldbody>
  <light pos="0 0 3" castshadow="false"/><camera name="eye" pos="0 0 2"/><geom size="0.5" group="1"/>
</worldbody></mujoco>"""
