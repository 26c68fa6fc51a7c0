"""Studies beyond the paper; ``pyproject.toml`` declares them."""
