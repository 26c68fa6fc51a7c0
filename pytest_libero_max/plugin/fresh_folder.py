"""A plugin for a session that plays a pair again: it begins where it was told to, and plays in a new folder.

Options, ini file and conftest files are read where the session was started. Its policy is loaded and asked in
a folder in which nothing lies that an earlier process has written.
"""

from __future__ import annotations

import os
import tempfile

import pytest


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop() -> None:
    """Enter a new folder, in this process or in each worker, when everything is planned."""
    os.chdir(tempfile.mkdtemp(prefix="libero-max-"))
