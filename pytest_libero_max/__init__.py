"""LIBERO-MAX as a pytest plugin: does a policy still finish when the world changes while it acts?

The names an adapter needs. They are imported on first use: pytest loads this package in every session of
everybody who has it installed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pytest_libero_max.policies.contract import Episode, Policy, PolicySpec, Query

__all__ = ["Episode", "Policy", "PolicySpec", "Query"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from pytest_libero_max.policies import contract

    return getattr(contract, name)
