"""Construction of the frozen cases from the contents of tasks. Policies are never consulted."""

from __future__ import annotations
