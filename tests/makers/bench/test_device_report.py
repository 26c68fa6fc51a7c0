"""The report of a device: what it holds, and which device draws; the measurements have tests of their own."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.cli import main
from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.makers.bench import device_report as module
from pytest_libero_max.makers.bench.images import ImageRate, SameImages, compare_images
from pytest_libero_max.makers.bench.serving import ServingRate
from pytest_libero_max.substrates.contract import SubstrateOptions
from pytest_libero_max.worlds.rendering import egl, gl

GPU, PROCESSOR = egl.Device(0, "a GPU", cuda=0), egl.Device(1, "a processor", software=True)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, str | None]]:
    """Substrate and device number of each measurement of rates; nothing is measured."""
    found: list[tuple[str, str | None]] = []

    def rates(name: str, *_: Any, **__: Any) -> Iterator[ImageRate]:
        found.append((name, os.environ.get(egl.VARIABLE)))
        yield ImageRate("libero_goal/3", 2, 100, 5.0)

    monkeypatch.setattr(module, "measure_rates", rates)
    monkeypatch.setattr(
        module, "compare_images", lambda *_, **__: [SameImages("libero_goal/3", 12, 0, repeated=True)]
    )
    monkeypatch.setattr(module, "measure_serving", lambda *_, **__: [ServingRate(4, 500, 5.0, 40.0, 80.0)])
    monkeypatch.setattr(gl, "require", lambda: "egl")
    monkeypatch.setattr(egl, "chosen", lambda: (GPU, 2))
    monkeypatch.setattr(egl, "listed", lambda: [GPU, PROCESSOR])
    monkeypatch.delenv(egl.VARIABLE, raising=False)
    return found


def test_a_gpu_is_measured_beside_the_processor_on_both_kinds_of_scenes(
    asked: list[tuple[str, str | None]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(module, "describe_substrate", lambda *_: {})
    assert main(["dev", "bench", "device", f"--output={tmp_path / 'sent.md'}"]) == 0
    assert asked == [("embedded", None), ("libero", None), ("embedded", "1"), ("libero", "1")]
    assert egl.VARIABLE not in os.environ
    text = (tmp_path / "sent.md").read_text()
    titles = [line for line in text.splitlines() if line.startswith("## ") and "scenes" in line]
    assert [("libero" in title, "device 1" in title) for title in titles] == [
        *((False, False), (True, False)),
        *((False, True), (True, True)),
    ]
    assert "| libero_goal/3 | 2 | 20 | 100.0 |" in text
    assert "| libero_goal/3 | 12 | 0 | yes |" in text
    assert "| 4 | 100 | 40.0 | 80.0 |" in text


def test_where_the_processor_draws_it_is_measured_once_and_a_missing_libero_is_said(
    asked: list[tuple[str, str | None]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def lacks(*_: Any) -> None:
        raise SubstrateError("No LIBERO is installed.")

    monkeypatch.setattr(module, "describe_substrate", lacks)
    monkeypatch.setattr(egl, "chosen", lambda: (PROCESSOR, 2))
    assert main(["dev", "bench", "device", f"--output={tmp_path / 'sent.md'}"]) == 0
    assert asked == [("embedded", None)]
    assert "not measured: No LIBERO" in (tmp_path / "sent.md").read_text()


def test_images_are_the_same_in_another_process() -> None:
    (found,) = compare_images("embedded", SubstrateOptions(), [("libero_object", 0)], size=32)
    assert found == SameImages("libero_object/0", 12, 0, repeated=True)
