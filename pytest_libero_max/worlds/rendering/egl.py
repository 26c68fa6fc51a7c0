"""EGL's devices, and the choice of the one that draws.

MuJoCo takes the first device that answers. EGL and CUDA count GPUs in different orders, and only CUDA heeds
``CUDA_VISIBLE_DEVICES``: on a machine with several GPUs the first one may be another than the policy's, or
somebody else's. Here the device is chosen, the same one in every process of a run, since pictures of
different GPUs need not be equal.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from pytest_libero_max.errors import OptionError, SimulatorError

VARIABLE = "MUJOCO_EGL_DEVICE_ID"
VISIBLE = "CUDA_VISIBLE_DEVICES"

_PLATFORM_DEVICE = 0x313F
_EXTENSIONS, _VENDOR, _RENDERER = 0x3055, 0x3053, 0x335F
_CUDA_DEVICE = 0x323A
_SOFTWARE = "EGL_MESA_device_software"
_MOST = 32


@dataclass(frozen=True)
class Device:
    """One device of EGL."""

    number: int
    """Its place in EGL's list, as ``MUJOCO_EGL_DEVICE_ID`` counts."""
    name: str
    """Its driver's name for it."""
    software: bool = False
    """True if the processor draws."""
    cuda: int | None = None
    """CUDA's number for it in this process, where 0 is the first that ``CUDA_VISIBLE_DEVICES`` shows; None
    for a device that CUDA does not know, or whose driver does not say."""

    def __str__(self) -> str:
        known = "" if self.cuda is None else f", CUDA's {self.cuda}"
        return f"EGL device {self.number} ({self.name}{known})"


def preferred(devices: Sequence[Device], wanted: str | None, visible: str | None) -> list[Device]:
    """Return the devices to try, best first, or raise OptionError.

    The device of ``MUJOCO_EGL_DEVICE_ID`` alone, if it is set. Otherwise the GPU that CUDA calls 0, which is
    the first of ``CUDA_VISIBLE_DEVICES``; where that shows none, the processor. Otherwise in EGL's order.

    Args:
        devices: All of them, in EGL's order.
        asked: ``MUJOCO_EGL_DEVICE_ID``, None where it is not set.
        visible: ``CUDA_VISIBLE_DEVICES``, likewise.
    """
    if wanted:
        named = [device for device in devices if str(device.number) == wanted.strip()]
        if named:
            return named
        numbers = ", ".join(str(device.number) for device in devices)
        raise OptionError(
            f"{VARIABLE}={wanted!r}, but EGL's devices are {numbers}. They are not counted as CUDA counts; "
            f"unset it to have the first GPU of {VISIBLE} chosen."
        )
    if visible is not None and visible.strip() in ("", "-1"):
        return sorted(devices, key=lambda device: not device.software)
    return sorted(devices, key=lambda device: (device.cuda is None, device.cuda or 0, device.software))


@cache
def chosen() -> tuple[Device, int]:
    """Return the device that draws in this process, and how many there are.

    Raises:
        OptionError: ``MUJOCO_EGL_DEVICE_ID`` names a device that does not exist.
        SimulatorError: None of those that may be used answers.
    """
    return _choose()


def listed() -> list[Device]:
    """Return all devices of EGL, whatever the environment asks for; none without EGL."""
    egl = _loaded()
    return [] if egl is None else egl.devices(numbered=True)


def check() -> None:
    """Check that the device that ``MUJOCO_EGL_DEVICE_ID`` names answers, where EGL has any.

    Raises:
        OptionError: There is no such device.
        SimulatorError: It does not answer.
    """
    if os.environ.get(VARIABLE) and answers():
        _choose()


def _choose() -> tuple[Device, int]:
    egl = _loaded()
    wanted, visible = os.environ.get(VARIABLE), os.environ.get(VISIBLE)
    devices = [] if egl is None else egl.devices(numbered=not wanted)
    order = preferred(devices, wanted, visible) if devices else []
    device_chosen = next((device for device in order if egl and egl.opens(device.number)), None)
    if device_chosen is None:
        tried = ", ".join(map(str, order)) or "none"
        raise SimulatorError(
            f"No EGL device gives a display (tried: {tried}; {VARIABLE}={wanted!r}). Unset {VARIABLE} to "
            "have all of them tried, or set MUJOCO_GL=osmesa to draw with the processor."
        )
    return device_chosen, len(devices)


@contextlib.contextmanager
def asked_for(number: str | None) -> Iterator[None]:
    """Set the variable in the block, for MuJoCo and for processes that are started; None hides it.

    MuJoCo reads it when it makes a context. Robosuite fails to import where its number is not CUDA's as well.
    """
    before = os.environ.pop(VARIABLE, None)
    if number is not None:
        os.environ[VARIABLE] = number
    try:
        yield
    finally:
        os.environ.pop(VARIABLE, None)
        if before is not None:
            os.environ[VARIABLE] = before


def answers() -> bool:
    """Return True if some device gives a display: libEGL alone is not a driver."""
    egl = _loaded()
    return egl is not None and any(egl.opens(number) for number in range(len(egl.handles)))


class _Egl:
    """The few functions of libEGL that are needed, for this process."""

    def __init__(self, library: ctypes.CDLL) -> None:
        pointer, integer, word = ctypes.c_void_p, ctypes.c_int32, ctypes.c_ssize_t
        self._address = library.eglGetProcAddress
        self._address.restype, self._address.argtypes = pointer, [ctypes.c_char_p]
        many, count = ctypes.POINTER(pointer), ctypes.POINTER(integer)
        query = self._function(b"eglQueryDevicesEXT", ctypes.c_uint, integer, many, count)
        self._text = self._function(b"eglQueryDeviceStringEXT", ctypes.c_char_p, pointer, integer)
        attribute = (ctypes.c_uint, pointer, integer, ctypes.POINTER(word))
        self._attribute = self._function(b"eglQueryDeviceAttribEXT", *attribute)
        self._display = self._function(b"eglGetPlatformDisplayEXT", pointer, ctypes.c_uint, pointer, count)
        self._initialize = library.eglInitialize
        self._initialize.argtypes = [pointer, count, count]
        handles, count_found = (pointer * _MOST)(), integer(0)
        known = bool(query and query(_MOST, handles, ctypes.byref(count_found)))
        self.handles: tuple[Any, ...] = tuple(handles[: count_found.value]) if known else ()

    def _function(self, name: bytes, *types: Any) -> Callable[..., Any] | None:
        address = self._address(name)
        return ctypes.CFUNCTYPE(*types)(address) if address else None

    def opens(self, number: int) -> bool:
        """Return True if a device gives a display that initialises."""
        shown = self._display and self._display(_PLATFORM_DEVICE, self.handles[number], None)
        return bool(shown and self._initialize(shown, None, None))

    def devices(self, numbered: bool) -> list[Device]:
        """Return all devices; with CUDA's numbers only if they can matter: asking initialises CUDA."""
        devices = []
        for number, handle in enumerate(self.handles):
            software = _SOFTWARE in self._string(handle, _EXTENSIONS).split()
            name = self._string(handle, _RENDERER) or self._string(handle, _VENDOR)
            cuda = self._cuda(handle) if numbered and len(self.handles) > 1 and not software else None
            devices.append(Device(number, name or ("software" if software else "unnamed"), software, cuda))
        return devices

    def _string(self, handle: Any, name: int) -> str:
        value = self._text(handle, name) if self._text else None
        return value.decode(errors="replace") if value else ""

    def _cuda(self, handle: Any) -> int | None:
        value = ctypes.c_ssize_t(-1)
        known = self._attribute and self._attribute(handle, _CUDA_DEVICE, ctypes.byref(value))
        return value.value if known and value.value >= 0 else None


@cache
def _loaded() -> _Egl | None:
    for name in ("libEGL.so.1", "libEGL.so"):
        with contextlib.suppress(OSError):
            return _Egl(ctypes.CDLL(name))
    return None
