from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.reference.options import EXAMPLE

Run = Callable[..., pytest.RunResult]


def test_the_fixtures_serve_a_users_own_module(run: Run, pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        test_mine="""
        def test_the_event_finds_what_the_prefix_left(
            libero_max_case, libero_max_prefix, libero_max_inject, libero_max_world
        ):
            before = libero_max_world.digest()
            evidence = libero_max_inject()
            assert evidence["operation"] == libero_max_case.event.change["operation"]
            assert libero_max_world.digest() != before
            assert libero_max_prefix.step > 0

        def test_a_pair_of_my_own(libero_max_pair, libero_max_policy):
            assert libero_max_pair.policy["name"] == libero_max_policy.spec.name
        """
    )
    run("test_mine.py", "-k", "v0").assert_outcomes(passed=16, deselected=16)


def test_the_ini_file_can_name_the_policy(run: Run, pytester: pytest.Pytester) -> None:
    pytester.makeini("[pytest]\nlibero_max_policy = adapter.py\n")
    pytester.makepyfile(
        test_mine="def test_mine(libero_max_policy):\n    assert libero_max_policy.spec.name == 'reacher'"
    )
    run("test_mine.py", policy=None).assert_outcomes(passed=1)


def test_without_a_policy_the_message_says_how_to_give_one(run: Run, pytester: pytest.Pytester) -> None:
    pytester.makepyfile(test_mine="def test_mine(libero_max_policy): pass")
    result = run("test_mine.py", policy=None)
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["*give --libero-max-policy=adapter.py*"])


def test_a_prefix_that_never_reaches_the_trigger_skips(run: Run, pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        still="""
        from adapter import Reacher
        import numpy as np

        class Still(Reacher):
            def predict(self, observation, query):
                return np.zeros((8, 7))

        policy = Still
        """
    )
    pytester.makepyfile(test_mine="def test_mine(libero_max_prefix): pass")
    run("test_mine.py", "-k", "camera_shift", policy="still.py").assert_outcomes(skipped=2)


def test_the_example_of_the_reference_page_passes(run: Run, pytester: pytest.Pytester) -> None:
    pytester.makepyfile(test_mine=EXAMPLE)
    run("test_mine.py", "-k", "camera_shift").assert_outcomes(passed=2, deselected=14)
