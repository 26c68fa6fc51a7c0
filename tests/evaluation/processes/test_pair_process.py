from __future__ import annotations

from pytest_libero_max.evaluation.processes.pair_process import memory_gib


def test_the_memory_of_the_machine_is_shared() -> None:
    whole = memory_gib(None, 1, 4.0)
    assert whole is not None
    assert memory_gib(None, 10_000, 4.0) == 4.0
    assert memory_gib(None, 2, 4.0) == max(4.0, whole / 2)
    assert memory_gib(0.0, 2, 4.0) is None
    assert memory_gib(3.5, 2, 4.0) == 3.5
