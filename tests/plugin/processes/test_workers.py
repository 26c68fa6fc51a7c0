from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from pytest_libero_max.plugin.processes.workers import started_again


@pytest.mark.parametrize(
    "error", [EOFError("expected 1 bytes, got 0"), OSError("cannot send (already closed?)")]
)
def test_a_worker_that_dies_while_it_is_started_is_started_again(error: Exception) -> None:
    spec = SimpleNamespace(id="gw0")
    seen: list[str | None] = []

    def setup_node(spec: Any, putevent: Any) -> str:
        seen.append(spec.id)
        if len(seen) < 3:
            raise error
        return f"node {spec.id}"

    def allocate_id(spec: Any) -> None:
        assert spec.id is None
        spec.id = f"gw{len(seen)}"

    assert started_again(setup_node, allocate_id)(spec, None) == "node gw2"
    assert seen == ["gw0", "gw1", "gw2"]


def test_a_worker_that_never_starts_is_an_error() -> None:
    def setup_node(spec: Any, putevent: Any) -> None:
        raise EOFError

    with pytest.raises(EOFError):
        started_again(setup_node, lambda spec: None)(SimpleNamespace(id="gw0"), None)
