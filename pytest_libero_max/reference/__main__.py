"""Write the reference pages: ``python -m pytest_libero_max.reference``."""

from __future__ import annotations

from pytest_libero_max.reference import PACKAGE, write_pages

for path in write_pages():
    print(f"Written: {path.relative_to(PACKAGE.parent)}")
