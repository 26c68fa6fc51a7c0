"""Exceptions of an adapter that are no ``Exception``: they end a pair, and an interrupt ends the session."""

from __future__ import annotations

import pytest

from tests.plugin.test_run import Results, Run

RAISING = """
import asyncio
from adapter import Reacher

class Raising(Reacher):
    episodes = 0

    def reset(self, episode):
        type(self).episodes += 1
        if type(self).episodes == 5:  # a pair begins four: two arms, and a late query of each asked again
            raise {what}

policy = Raising
"""


@pytest.mark.parametrize(
    ("what", "name", "workers"),
    [
        ("asyncio.CancelledError()", "CancelledError", ()),
        ("SystemExit(0)", "SystemExit", ("-n1",)),
        ("GeneratorExit()", "GeneratorExit", ()),
    ],
)
def test_an_exit_of_an_adapter_ends_its_pair_alone(
    run: Run, results: Results, pytester: pytest.Pytester, what: str, name: str, workers: tuple[str, ...]
) -> None:
    pytester.makepyfile(raising=RAISING.format(what=what))
    result = run(
        "-k", "camera_shift or illumination", *workers, policy="raising.py", subprocess=bool(workers)
    )
    result.assert_outcomes(passed=3, errors=1)
    lines, report = results()
    (error,) = [line for line in lines if line["line"] == "error"]
    assert (error["kind"], error["phase"]) == ("AdapterError", "base")
    assert f"policy 'reacher' raised {name} in reset (raising.py, line 10)" in error["message"]
    assert report["pairs"]["invalid"] == 1
    assert result.ret == 11


def test_an_exit_of_the_simulator_ends_its_pair_alone(
    run: Run, results: Results, pytester: pytest.Pytester
) -> None:
    pytester.makeconftest(
        """
        from pytest_libero_max.substrates.tiny.world import TinyWorld

        class World(TinyWorld):
            resets = 0

            def reset(self, init):
                self.resets += 1
                if self.resets == 3:  # one by the constructor, one a pair
                    raise SystemExit("no more worlds")
                super().reset(init)

        import pytest_libero_max.substrates.tiny.world as tiny
        tiny.TinyWorld = World
        """
    )
    result = run("-k", "camera_shift or illumination", subprocess=True)
    result.assert_outcomes(passed=3, errors=1)
    (error,) = [line for line in results()[0] if line["line"] == "error"]
    assert (error["kind"], error["phase"], error["message"]) == ("SystemExit", "setup", "no more worlds")


def test_an_exit_while_the_policy_is_constructed_is_one_error(
    run: Run, results: Results, pytester: pytest.Pytester
) -> None:
    pytester.makepyfile(
        leaving="""
        import asyncio
        from adapter import Reacher

        def policy():
            raise asyncio.CancelledError
        """
    )
    result = run("-k", "camera_shift", policy="leaving.py")
    result.assert_outcomes(errors=1)
    errors = [line for line in results()[0] if line["line"] == "error"]
    assert {error["kind"] for error in errors} == {"AdapterError"}
    assert {error["message"] for error in errors} == {
        "policy 'leaving.py' raised CancelledError while it was loaded: . Repair the adapter."
    }


@pytest.mark.parametrize("workers", [(), ("-n1",)], ids=["plain", "distributed"])
def test_an_interrupt_stops_the_session_and_keeps_what_was_measured(
    run: Run, results: Results, pytester: pytest.Pytester, workers: tuple[str, ...]
) -> None:
    pytester.makepyfile(raising=RAISING.format(what="KeyboardInterrupt()"))
    result = run("-k", "camera_shift or illumination", *workers, policy="raising.py", subprocess=True)
    lines, report = results()
    assert [line["phase"] for line in lines if line["line"] == "error"] == ["crash"] * len(workers)
    assert (report["pairs"]["played"], report["pairs"]["missing"]) == (1, 3 - len(workers))
    assert result.ret == pytest.ExitCode.INTERRUPTED
    result.stdout.no_fnmatch_line("*INTERNALERROR*")


def test_a_spec_that_changes_between_pairs_is_an_error(
    run: Run, results: Results, pytester: pytest.Pytester
) -> None:
    pytester.makeconftest(
        """
        import pytest
        from dataclasses import replace

        @pytest.fixture(autouse=True)
        def meddling(libero_max_policy):
            yield
            libero_max_policy.spec = replace(libero_max_policy.spec, query_interval=2)
        """
    )
    result = run("-k", "camera_shift")
    result.assert_outcomes(passed=1, errors=1)
    (error,) = [line for line in results()[0] if line["line"] == "error"]
    assert "earlier pair: query_interval=4 became 2" in error["message"]
