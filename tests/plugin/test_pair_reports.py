from __future__ import annotations

import pytest

from tests.plugin.test_run import Results, Run


def test_episodes_of_another_length_are_not_stored(
    run: Run, results: Results, pytester: pytest.Pytester
) -> None:
    pytester.makepyfile(
        longer="""
        from adapter import Reacher
        from pytest_libero_max.benchmark.cases import SUITE_BUDGETS

        class policy(Reacher):
            def reset(self, episode):
                SUITE_BUDGETS["libero_spatial"] = 35
        """
    )
    result = run("-k", "camera_shift and v0", "-n1", policy="longer.py", subprocess=True)
    (error,) = [line for line in results()[0] if line["line"] == "error"]
    assert "max_steps=35" in error["message"]
    assert "its episodes have 30" in error["message"]
    assert result.ret == 11
