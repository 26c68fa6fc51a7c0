"""Readers of results that other runners wrote; ``pyproject.toml`` declares them."""
