"""The fixtures of the sessions, with which runs from Python are compared."""

from __future__ import annotations

from tests.plugin.conftest import run, short_sessions

__all__ = ["run", "short_sessions"]
