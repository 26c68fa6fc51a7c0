"""The package ``metaworld``, which is not installed with this one."""

from __future__ import annotations

from importlib.util import find_spec

PACKAGES = ("metaworld", "gymnasium", "imageio")
INSTALL = f"pip install --no-deps {' '.join(PACKAGES)}"


def lacking_packages() -> str:
    """Return the packages that are missing with the command that installs them; empty for none."""
    missing = [name for name in PACKAGES if find_spec(name) is None]
    if not missing:
        return ""
    return f"the package {' and '.join(missing)} is not installed: {INSTALL} (it pins another MuJoCo)"
