from __future__ import annotations

from functools import cache

pytest_plugins = ["pytester"]


def pytest_pycollect_makemodule() -> None:
    """Prepare with the first test module: whoever plays pairs in a clone loads this file alone."""
    _prepare()


@cache
def _prepare() -> None:
    from hypothesis import HealthCheck, settings

    from tests.warm_processes import use_server

    use_server()

    # A test fails for what it says, not because the machine was busy: no limit on the time of an example.
    settings.register_profile("untimed", deadline=None, suppress_health_check=[HealthCheck.too_slow])
    settings.load_profile("untimed")
