from __future__ import annotations

from collections.abc import Mapping

import pytest
from msgspec import structs

from pytest_libero_max.errors import OtherRunError
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.runs.agreement import SamePlay
from tests.report.made_up import plan, record_of

PAIRS = plan()
GOAL, TEN = f"embedded/libero_goal/3 {'a' * 64}", f"embedded/libero_10/0 {'b' * 64}"


def played(number: int, **fingerprints: str) -> PairRecord:
    return record_of(PAIRS[number], True, True, fingerprints={"substrate": "embedded", **fingerprints})


def add(*prints: Mapping[str, str]) -> None:
    same = SamePlay()
    for number, fingerprints in enumerate(prints):
        same.add(played(number, **fingerprints))


def test_a_scene_is_compared_with_itself_and_starts_are_not() -> None:
    add({"scene": GOAL, "start": "1"}, {"scene": TEN, "start": "2"}, {"scene": GOAL, "start": "3"})


def test_a_scene_that_was_changed_within_a_run_is_named() -> None:
    with pytest.raises(OtherRunError, match=r"embedded/libero_goal/3 of .* \(digests cccccccccccc,"):
        add({"scene": TEN}, {"scene": GOAL}, {"scene": GOAL.replace("a" * 64, "c" * 64)})


def test_another_kind_of_processor_may_round_a_scene_differently() -> None:
    other = GOAL.replace("a" * 64, "c" * 64)
    add({"scene": GOAL, "blas": "Zen"}, {"scene": other, "blas": "Haswell"}, {"scene": GOAL, "blas": "Zen"})
    with pytest.raises(OtherRunError, match="Scene embedded/libero_goal/3"):
        add({"scene": GOAL, "blas": "Zen"}, {"blas": "Haswell"}, {"scene": other, "blas": "Zen"})


def test_pairs_of_other_renderers_and_of_records_without_one_are_of_one_measurement() -> None:
    old = {"gl": "egl", "gl_device": "software"}
    new = {**old, "gl_renderer": "llvmpipe", "gl_version": "4.5 Mesa 22.3.6"}
    add(new, new | {"gl_version": "4.5 Mesa 26.2.6"}, old, {"gl": "osmesa"})


def test_files_are_compared_with_those_of_all_pairs_before() -> None:
    digests = [{"sha256": letter * 64} for letter in "ab"]
    same = SamePlay()
    same.add(_with_file(0, {"written": "since loading began"}))
    same.add(_with_file(1, digests[0]))
    with pytest.raises(OtherRunError, match="the policy's file 'w'"):
        same.add(_with_file(2, digests[1]))


def _with_file(number: int, identity: Mapping[str, object]) -> PairRecord:
    pair = played(number)
    return structs.replace(pair, policy={**pair.policy, "files": {"w": identity}})
