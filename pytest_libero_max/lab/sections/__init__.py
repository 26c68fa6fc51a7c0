"""Sections of the report beyond the paper; ``pyproject.toml`` declares them."""
