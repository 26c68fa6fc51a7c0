"""Images of a world, straight from MuJoCo: OpenGL row order, shadows only of lights told to cast them."""

from __future__ import annotations

import atexit
from functools import cache
from typing import Any
from weakref import WeakSet

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import LiberoMaxError, SimulatorError, SubstrateError, did_you_mean
from pytest_libero_max.worlds.contract import Image, ImageSize, height_and_width
from pytest_libero_max.worlds.rendering import egl, gl

gl.prepare()

import mujoco  # noqa: E402

OFFSAMPLES = 4
"""Samples per pixel, as in LIBERO. In software, 4 take twice the time of none (7 instead of 4 ms for a
256 pixel image of a tabletop scene, on one core) and keep fingers, rims and lettering from fraying; 2
take as long as 4."""

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


class Renderer:
    """Draws one model from its cameras.

    All renderers of a process share one GL context, made with the first image and current whenever one
    of them draws, so that any number of worlds can be looked at in turns. Those whose models have the same
    textures and meshes share these as well: to upload those of a genuine scene takes about a second.

    Args:
        model: Its textures and meshes are uploaded with the first image and not again.
        data: Its derived values must be up to date whenever :meth:`render` is called.
        reflections: True to let reflective surfaces reflect; each of them draws the whole scene once more.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, reflections: bool = False) -> None:
        self._model = model
        self._data = data
        self._reflections = reflections
        self._uploaded: _Uploaded | None = None
        self._scene: Any = None

    def render(self, camera: str, size: ImageSize) -> Image:
        """One image, (H, W, 3) uint8, freshly allocated, bottom row first.

        Raises:
            SubstrateError: No such camera, or a size that cannot be drawn.
            SimulatorError: No OpenGL backend is available.
        """
        height, width = height_and_width(size)
        self._aim(camera, height, width)
        return self._draw(height, width)

    def segment(self, camera: str, size: int) -> NDArray[np.intp]:
        """Return the geom that each pixel shows, (size, size), bottom row first; -1 where there is none.

        It is drawn without samples between pixels, so each shows one geom. The errors are those of
        :meth:`render`.
        """
        self._aim(camera, size, size)
        flags = self._scene.flags
        flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = 1
        codes = self._draw(size, size).astype(np.intp) @ (1, 2**8, 2**16)  # 0 is the background
        flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = 0
        shown = np.full(self._scene.ngeom + 1, -1, dtype=np.intp)
        for drawn in self._scene.geoms[: self._scene.ngeom]:
            if drawn.objtype == mujoco.mjtObj.mjOBJ_GEOM:
                shown[drawn.segid + 1] = drawn.objid
        found: NDArray[np.intp] = shown[codes]
        return found

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
        mujoco.mjv_updateScene(
            self._model, self._data, self._option, None, self._camera, mujoco.mjtCatBit.mjCAT_ALL, self._scene
        )

    def _draw(self, height: int, width: int) -> Image:
        viewport = mujoco.MjrRect(0, 0, width, height)
        assert self._uploaded is not None
        mujoco.mjr_render(viewport, self._scene, self._uploaded.context)
        image: Image = np.empty((height, width, 3), dtype=np.uint8)
        mujoco.mjr_readPixels(image, None, viewport, self._uploaded.context)
        return image

    def close(self) -> None:
        """Free buffers, meshes and textures. The renderer makes them again if it is used again."""
        if self._uploaded is not None:
            self._uploaded.release()
            self._uploaded = self._scene = None

    def _prepare(self, size: int) -> None:
        _shared_context().make_current()
        shadows = bool(self._model.light_castshadow.any())
        if self._uploaded is not None and not self._uploaded.suits(size, shadows):
            self.close()
        if self._uploaded is None:
            self._open(max(size, 256), shadows)
        assert self._uploaded is not None
        self._uploaded.use_for(self._model)

    def _open(self, side: int, shadows: bool) -> None:
        self._uploaded = _uploaded_for(self._model, side, shadows)
        self._scene = mujoco.MjvScene(self._model, maxgeom=MAX_GEOMS)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = shadows
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = self._reflections
        self._option = mujoco.MjvOption()
        self._option.geomgroup[:] = [group in DRAWN_GROUPS for group in range(6)]
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED


class _Uploaded:
    """Buffers to draw into, and the textures and meshes of a model, in the memory of the renderer.

    Attributes:
        context: MuJoCo's handle of them.
        model: The model that asked last; earlier ones need not stay in memory.
        users: Renderers that draw with it; without any it is freed.

    Args:
        model: Model with the textures and meshes.
        side: Of the largest image, pixels.
        shadows: True if some light casts them.

    Raises:
        SimulatorError: The driver refuses.
    """

    def __init__(self, model: mujoco.MjModel, side: int, shadows: bool) -> None:
        self.model, self._side, self._shadows = model, side, shadows
        self._shapes = _shapes(model)
        self.users = 0
        try:
            self.context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        except mujoco.FatalError as error:
            raise SimulatorError(
                f"MuJoCo cannot draw with {gl.VARIABLE}={gl.require()!r}: {error}."
            ) from error

    def suits(self, size: int, shadows: bool) -> bool:
        """Return True if images of this size can be drawn, with shadows or without."""
        return size <= self._side and shadows == self._shadows

    def holds(self, model: mujoco.MjModel) -> bool:
        """Return True if a model has these very textures, meshes and other shapes."""
        return self._shapes == _shapes(model) and all(
            np.array_equal(_bytes(self.model, name), _bytes(model, name)) for name in _UPLOADS
        )

    def use_for(self, model: mujoco.MjModel) -> None:
        """Draw a model next."""
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
            _in_use.discard(self)
            _shared_context().make_current()
            self.context.free()


_UPLOADS = tuple(
    name for name in dir(mujoco.MjModel) if name.startswith(("tex_", "mesh_", "hfield_", "skin_"))
)


def _bytes(model: mujoco.MjModel, name: str) -> NDArray[np.uint8]:
    """Return an array of a model as its bytes: some hold NaN, which is not equal to itself."""
    values: NDArray[np.uint8] = getattr(model, name).reshape(-1).view(np.uint8)
    return values


def _shapes(model: mujoco.MjModel) -> tuple[object, ...]:
    """Parts of a model in the context beside textures and meshes: planes, round shapes, fog, shadows."""
    planes = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
    materials = model.geom_matid[planes]
    arrays = (model.geom_size[planes], materials >= 0, model.mat_texrepeat[materials[materials >= 0]])
    settings = (model.vis.global_.linewidth, model.vis.map, model.vis.quality, model.vis.rgba)
    return (*(array.tobytes() for array in arrays), *map(repr, settings), model.stat.extent)


_in_use: WeakSet[_Uploaded] = WeakSet()  # a world that nobody closes takes what it has uploaded with it


def _uploaded_for(model: mujoco.MjModel, side: int, shadows: bool) -> _Uploaded:
    """Return the upload of another renderer if it serves this model as well, else a new one."""
    model.vis.global_.offwidth = model.vis.global_.offheight = side
    model.vis.quality.offsamples = OFFSAMPLES
    model.vis.quality.shadowsize = SHADOW_MAP if shadows else 0
    model.vis.map.shadowclip = SHADOW_REACH
    known = (one for one in _in_use if one.suits(side, shadows) and one.holds(model))
    found = next(known, None)
    if found is None:
        found = _Uploaded(model, side, shadows)
        _in_use.add(found)
    found.model = model
    found.users += 1
    return found


def require_images() -> None:
    """Draw one tiny image to check that this process can.

    Raises:
        SimulatorError: It cannot; says what to do.
    """
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
  <light pos="0 0 3"/><camera name="eye" pos="0 0 2"/><geom size="0.5" group="1"/>
</worldbody></mujoco>"""


@cache
def _shared_context() -> Any:
    """Return the GL context of this process; it needs no size, as all drawing is into framebuffer objects."""
    backend = gl.require()
    try:
        if backend == "egl":
            from mujoco.egl import GLContext

            with egl.selected():
                context = GLContext(1, 1)
        else:
            from mujoco.osmesa import GLContext

            context = GLContext(1, 1)
        context.make_current()
    except LiberoMaxError:
        raise
    except Exception as error:  # whatever a driver raises, it means that images cannot be had
        raise SimulatorError(f"The OpenGL backend {backend!r} gives no context: {error}") from error
    atexit.register(_free, context)
    return context


def _free(context: Any) -> None:
    """Free the GL context before the interpreter does, which would come too late and complain about it."""
    try:
        context.free()
    except Exception:  # robosuite, where it has rendered as well, has closed the display already
        context._context = None
