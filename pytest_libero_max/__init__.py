"""LIBERO-MAX as a pytest plugin: does a policy still finish when the world changes while it acts?"""

from __future__ import annotations
