"""A policy at another cadence than its own: Q (execution horizon, replan steps) and H (chunk size)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.events.schedules import Cadence

if TYPE_CHECKING:
    from pytest_libero_max.policies.contract import Policy, PolicySpec


def at_cadence(spec: PolicySpec, cadence: Cadence) -> PolicySpec:
    """Return the spec with another Q, and another H where the cadence has one."""
    horizon = spec.horizon if cadence.horizon is None else cadence.horizon
    return replace(spec, horizon=horizon, query_interval=cadence.query_interval)


def declare(policy: Policy, spec: PolicySpec) -> None:
    """Let a policy declare another spec. One that reads ``self.spec.horizon`` follows it."""
    try:
        policy.spec = spec
    except AttributeError as error:
        raise AdapterError(
            f"The spec of policy {policy.spec.name!r} cannot be assigned ({error}), but another H or Q "
            "replaces it. Make `spec` a plain attribute."
        ) from error


@contextmanager
def played_at(policy: Policy, cadence: Cadence | None) -> Iterator[PolicySpec]:
    """Let the policy's spec declare a cadence within the block; afterwards it declares its own again."""
    own = policy.spec
    declared = own if cadence is None else at_cadence(own, cadence)
    if declared == own:
        yield own
        return
    declare(policy, declared)
    try:
        yield declared
    finally:
        policy.spec = own
