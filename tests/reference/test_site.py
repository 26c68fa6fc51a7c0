"""The hook of MkDocs: links out of ``docs``. The build itself is a part of ``.ci/run``."""

from __future__ import annotations

import pytest

from tests.reference.site import DOCS, outside, rewritten

PAGE = DOCS / "how-to" / "page.md"
TEXT = """\
[a](../tutorial.md#b) [c](https://example.org) [d](#e) [`f`](../../setup.py) [g](../../cases/README.md#h)
![i](../../reports/scenes.png) [j](../../reports)
```md
[k](../../README.md)
```
"""


def test_links_out_of_the_pages_lead_to_the_repository() -> None:
    repository = "https://example.org/project"
    assert rewritten(TEXT, PAGE, repository).splitlines()[:2] == [
        f"[a](../tutorial.md#b) [c](https://example.org) [d](#e) [`f`]({repository}/blob/main/setup.py) "
        f"[g]({repository}/blob/main/cases/README.md#h)",
        f"![i](../reports/scenes.png) [j]({repository}/tree/main/reports)",
    ]


def test_without_an_address_their_text_stays_and_code_is_left_alone() -> None:
    lines = rewritten(TEXT, PAGE, "").splitlines()
    assert lines[0] == "[a](../tutorial.md#b) [c](https://example.org) [d](#e) `f` g"
    assert lines[3] == "[k](../../README.md)"


@pytest.mark.parametrize("target", ["https://x.y/z", "#a", "page.md", "../../../etc/passwd"])
def test_other_links_are_left_as_they_are(target: str) -> None:
    assert outside(PAGE, target) is None
