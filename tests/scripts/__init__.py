"""Scripts of the developers: they measure, damage and compare. Run as ``python -m tests.scripts.NAME``."""
