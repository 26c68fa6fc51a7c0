from __future__ import annotations

import pytest

from tests.plugin.test_run import Run

ADAPTER = """
import threading
from adapter import Reacher

class Leaver(Reacher):
    def reset(self, episode):
        threading.Thread(target=threading.main_thread().join, name="camera").start()

policy = Leaver
"""


def test_a_session_names_what_its_pairs_leave_running(run: Run, pytester: pytest.Pytester) -> None:
    pytester.makepyfile(leaver=ADAPTER)
    done = run("-n0", "-k", "camera_shift and v0", policy="leaver.py", subprocess=True)
    assert done.ret == 0
    assert "'camera'" in done.stderr.str()
