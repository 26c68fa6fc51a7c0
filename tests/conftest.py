from __future__ import annotations

from functools import cache

pytest_plugins = ["pytester"]


def pytest_pycollect_makemodule() -> None:
    """Load the profile with the first test module: whoever plays pairs in a clone loads this file alone."""
    _load_profile()


@cache
def _load_profile() -> None:
    from hypothesis import HealthCheck, settings

    # A test fails for what it says, not because the machine was busy: no limit on the time of an example.
    settings.register_profile("untimed", deadline=None, suppress_health_check=[HealthCheck.too_slow])
    settings.load_profile("untimed")
