"""``python -m pytest_libero_max.cli``: the same as ``libero-max``, with this Python."""

from pytest_libero_max.cli import main

if __name__ == "__main__":
    raise SystemExit(main())
