"""From what a task contains to frozen cases. Policies are never consulted."""

from __future__ import annotations
