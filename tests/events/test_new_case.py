"""Cases made in Python, of LIBERO's tasks and of others."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from pytest_libero_max.benchmark.manifests import Manifest, decode_manifest
from pytest_libero_max.errors import ManifestError, SubstrateError
from pytest_libero_max.events import new_case
from pytest_libero_max.events.registry import BENCHMARK_EVENTS
from tests.plugin.conftest import TINY_TASK


def test_a_task_of_another_benchmark_hosts_the_events_that_its_contents_allow(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(new_case, "contents_of", lambda suite, index: TINY_TASK)
    cases = [new_case.make_case(event, "libero_goal", 77, 3) for event in BENCHMARK_EVENTS]
    assert {case.event.entity for case in cases} == {"box_1"}
    assert {case.task_index for case in cases} == {77}
    manifest = Manifest.of("boxes", cases)
    assert decode_manifest(manifest.to_json().encode(), Path("boxes.json")) == manifest


def test_a_task_that_nobody_knows_needs_its_contents() -> None:
    with pytest.raises(SubstrateError):
        new_case.make_case("camera_shift", "libero_goal", 77)


def test_a_task_without_spare_objects_hosts_no_obstacle(monkeypatch: pytest.MonkeyPatch) -> None:
    bare = replace(TINY_TASK, objects={"box_1": "box", "plate_1": "plate"})
    monkeypatch.setattr(new_case, "contents_of", lambda suite, index: bare)
    with pytest.raises(ManifestError, match="obstacle_insertion"):
        new_case.make_case("obstacle_insertion", "libero_goal", 0)
