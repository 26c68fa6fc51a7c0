from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator

import pytest

from pytest_libero_max.doctor import diagnose
from pytest_libero_max.errors import OptionError, SimulatorError
from pytest_libero_max.worlds.rendering import context, egl, gl, renderer
from pytest_libero_max.worlds.rendering.egl import Device, preferred

SOFTWARE = Device(2, "software", software=True)
SWAPPED = [Device(0, "NVIDIA A", cuda=1), Device(1, "NVIDIA B", cuda=0), SOFTWARE]
"""Two GPUs that EGL and CUDA count in opposite orders, and Mesa."""
HIDDEN = [Device(0, "NVIDIA A"), Device(1, "NVIDIA B", cuda=0), SOFTWARE]
"""The same with CUDA_VISIBLE_DEVICES=0: CUDA knows nothing of its second GPU."""
SILENT = [SOFTWARE, Device(3, "AMD C"), Device(4, "AMD D")]
"""Drivers that do not say what CUDA calls them."""


class FakeEgl:
    def __init__(self, devices: list[Device], broken: tuple[int, ...] = ()) -> None:
        self._devices, self._broken = devices, broken
        self.handles = tuple(devices)
        self.numbered: list[bool] = []

    def devices(self, numbered: bool) -> list[Device]:
        self.numbered.append(numbered)
        return self._devices

    def opens(self, number: int) -> bool:
        return number not in self._broken


@pytest.fixture(autouse=True)
def anew(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.delenv(egl.VARIABLE, raising=False)
    monkeypatch.delenv(egl.VISIBLE, raising=False)
    egl.chosen.cache_clear()
    yield
    egl.chosen.cache_clear()


def numbers(devices: list[Device]) -> list[int]:
    return [device.number for device in devices]


@pytest.mark.parametrize(
    ("devices", "visible", "expected"),
    [
        (SWAPPED, None, [1, 0, 2]),
        (SWAPPED, "1,0", [1, 0, 2]),
        (HIDDEN, "0", [1, 0, 2]),
        (HIDDEN, "", [2, 0, 1]),
        (HIDDEN, "-1", [2, 0, 1]),
        (SILENT, None, [3, 4, 2]),
        ([SOFTWARE], "0", [2]),
    ],
)
def test_the_first_gpu_that_cuda_shows_draws(
    devices: list[Device], visible: str | None, expected: list[int]
) -> None:
    assert numbers(preferred(devices, None, visible)) == expected


@pytest.mark.parametrize("visible", [None, "", "1"])
def test_a_device_that_is_asked_for_is_the_only_candidate(visible: str | None) -> None:
    assert numbers(preferred(SWAPPED, "0", visible)) == [0]
    assert numbers(preferred(SWAPPED, "", None)) == [1, 0, 2]  # set to nothing is not set


@pytest.mark.parametrize("asked", ["3", "-1", "cuda:0"])
def test_a_device_that_does_not_exist_is_refused(asked: str) -> None:
    with pytest.raises(OptionError, match=f"MUJOCO_EGL_DEVICE_ID='{asked}', .*0, 1, 2"):
        preferred(SWAPPED, asked, None)


def test_what_does_not_answer_is_passed_over_unless_it_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    fake = FakeEgl(SWAPPED, broken=(1,))
    monkeypatch.setattr(egl, "_loaded", lambda: fake)
    assert egl.chosen() == (SWAPPED[0], 3)
    egl.chosen.cache_clear()
    monkeypatch.setenv(egl.VARIABLE, "1")
    with pytest.raises(SimulatorError, match=r"device 1 \(NVIDIA B, "):
        egl.chosen()
    assert fake.numbered == [True, False]  # CUDA is not asked where its numbers do not matter


@pytest.mark.parametrize("before", [None, "0"])
def test_mujoco_is_told_the_device_and_robosuite_none(
    monkeypatch: pytest.MonkeyPatch, before: str | None
) -> None:
    monkeypatch.setattr(egl, "_loaded", lambda: FakeEgl(SWAPPED))
    if before is not None:
        monkeypatch.setenv(egl.VARIABLE, before)
    with egl.asked_for(str(egl.chosen()[0].number)):
        assert os.environ[egl.VARIABLE] == (before or "1")
        with egl.asked_for(None):
            assert egl.VARIABLE not in os.environ
    assert os.environ.get(egl.VARIABLE) == before


def test_the_record_and_the_doctor_name_the_device(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(egl, "_loaded", lambda: FakeEgl(SWAPPED))
    monkeypatch.setattr(gl, "prepare", lambda: "egl")
    monkeypatch.setattr(gl, "require", lambda: "egl")
    monkeypatch.setattr(renderer, "require_images", lambda: None)
    assert context.fingerprint() == {"gl": "egl", "gl_device": "NVIDIA B"}
    monkeypatch.setattr(context, "_renderer", lambda: {"gl_renderer": "NVIDIA B/PCIe", "gl_version": "4.6.0"})
    expected = "images with MUJOCO_GL=egl on EGL device 1 (NVIDIA B, CUDA's 0), of 3"
    found = [finding.text for finding in diagnose()]
    assert {expected, "images are drawn by NVIDIA B/PCIe, OpenGL 4.6.0"} <= {*found}


@pytest.mark.parametrize(
    ("asked", "broken", "message"),
    [("9", (), "EGL's devices are 0, 1, 2"), ("1", (1,), "No EGL device gives a display.*NVIDIA B")],
)
def test_a_device_that_cannot_draw_is_found_before_anything_is_played(
    monkeypatch: pytest.MonkeyPatch, asked: str, broken: tuple[int, ...], message: str
) -> None:
    monkeypatch.setattr(egl, "_loaded", lambda: FakeEgl(SWAPPED, broken))
    monkeypatch.delenv(gl.VARIABLE, raising=False)
    egl.check()
    monkeypatch.setenv(egl.VARIABLE, asked)
    with pytest.raises((OptionError, SimulatorError), match=message):
        gl.check()
    assert [text for level, text in _findings() if level == "missing" and text.startswith("images: ")]
    monkeypatch.setenv(gl.VARIABLE, "disable")
    gl.check()


def _findings() -> list[tuple[str, str]]:
    return [(finding.level, finding.text) for finding in diagnose()]


def test_robosuite_and_images_work_with_numbers_that_robosuite_takes_for_a_contradiction() -> None:
    """With one GPU shown, which CUDA's tools call 3, EGL's own number for it may well be 0."""
    if not gl.loads("egl"):
        pytest.skip("needs EGL: the Debian packages libegl1 libgl1-mesa-dri libopengl0")
    code = (
        "from pytest_libero_max.substrates.embedded.substrate import EmbeddedSubstrate\n"
        "from pytest_libero_max.substrates.tiny.world import TinyWorld\n"
        "print(TinyWorld().observe(['agentview'], 16)['agentview_image'].shape)\n"
    )
    environment = os.environ | {"MUJOCO_GL": "egl", egl.VARIABLE: "0", egl.VISIBLE: "3"}
    result = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=180
    )
    assert (result.returncode, result.stdout) == (0, "(16, 16, 3)\n"), result.stderr
