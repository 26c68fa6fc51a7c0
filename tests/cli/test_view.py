"""``libero-max view``: the page and the parts of its films over HTTP."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.warm_processes import WarmProcess

PUBLISHED = Path(__file__).parents[2] / "reports" / "smoke" / "stale_expert" / "pairs.jsonl.gz"


@pytest.fixture
def address(tmp_path: Path) -> Iterator[str]:
    if not PUBLISHED.is_file():
        pytest.skip("the source distribution has no reports")
    shutil.copy(PUBLISHED, tmp_path)
    tmp_path.joinpath("film.mp4").write_bytes(bytes(range(100)))
    command = [sys.executable, "-m", "pytest_libero_max.cli", "view", str(tmp_path), "--no-browser"]
    with WarmProcess(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        found = re.match(r"(http://127\.0\.0\.1:\d+)/report\.html ", process.stdout.readline())
        assert found is not None
        assert process.stdout.readline() == "The page shows films of 0 pairs.\n"
        yield found[1]
        process.terminate()


def test_the_page_is_made_and_served_and_films_come_in_parts(address: str) -> None:
    with urllib.request.urlopen(f"{address}/report.html") as answer:
        assert b"stale-expert" in answer.read()
    for asked, got in (
        ("bytes=10-19", range(10, 20)),
        ("bytes=90-", range(90, 100)),
        ("bytes=98-500", (98, 99)),
    ):
        request = urllib.request.Request(f"{address}/film.mp4", headers={"Range": asked})
        with urllib.request.urlopen(request) as answer:
            assert (answer.status, answer.read()) == (206, bytes(got))
            assert answer.headers["Content-Range"] == f"bytes {min(got)}-{max(got)}/100"
    with pytest.raises(urllib.error.HTTPError, match="416"):
        urllib.request.urlopen(urllib.request.Request(f"{address}/film.mp4", headers={"Range": "bytes=100-"}))
