"""Write the reference pages: ``python -m tests.reference``."""

from __future__ import annotations

from tests.reference import ROOT, write_pages

for path in write_pages():
    print(f"Written: {path.relative_to(ROOT)}")
