"""The tutorial as its page prints it, in a bare clone, with the time that each command takes.

    python -m tests.scripts.tutorial [--folder FOLDER] [--no-system]

Each block of the page is played in its order: commands are run by a shell, files are written, and what a
reader looks at in a browser is fetched. It needs the package index.
"""

from __future__ import annotations

import argparse
import re
import resource
import signal
import subprocess
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "tutorial.md"

STATUS = {"libero-max gate first": 10}
"""Exit status of the commands that do not end with 0, by their beginnings; the page says it."""

_BLOCK = re.compile(r'^```(?:sh|python title="(?P<file>[\w.]+)")\n(?P<body>.*?)^```', re.M | re.S)


def steps() -> Iterator[tuple[str | None, str]]:
    """Yield each file of the page with its content, and each command with None, in the page's order."""
    for block in _BLOCK.finditer(PAGE.read_text(encoding="utf-8")):
        if block["file"]:
            yield block["file"], block["body"]
            continue
        for line in re.sub(r"\s*\\\n\s*", " ", block["body"]).splitlines():
            yield None, line.split("  #")[0].strip()


def view(command: str, folder: Path) -> None:
    """Fetch the page that ``libero-max view`` shows, and end it as a reader does.

    Raises:
        RuntimeError: The page is not that of a run.
    """
    shell = [*shell_of(f"exec {command} --no-browser")]
    with subprocess.Popen(shell, cwd=folder, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        address = next(match[0] for line in process.stdout if (match := re.search(r"http://\S+", line)))
        with urllib.request.urlopen(address, timeout=60) as answer:
            page = answer.read().decode()
        process.send_signal(signal.SIGINT)
        process.stdout.read()
    if "target_relocation" not in page:
        raise RuntimeError(f"{address} is not the page of the run.")


def shell_of(command: str) -> list[str]:
    """Return a call of the shell, in the environment where there is one by now."""
    return ["bash", "-c", f"[ ! -e .venv/bin/activate ] || . .venv/bin/activate; {command}"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, help="Where the clone is made (default: a temporary folder)")
    parser.add_argument("--no-system", action="store_true", help="Leave out what apt-get installs")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        clone = (options.folder or Path(temporary)) / "clone"
        subprocess.run(["git", "clone", "--quiet", str(ROOT), str(clone)], check=True)
        begin = _times()
        for file, text in steps():
            start = _times()
            if file is not None:
                (clone / file).write_text(text, encoding="utf-8")
                continue
            if text.startswith("apt-get") and options.no_system:
                continue
            print(f"$ {text}", flush=True)
            if text.startswith("libero-max view"):
                view(text, clone)
            else:
                wanted = next((status for begins, status in STATUS.items() if text.startswith(begins)), 0)
                status = subprocess.run(shell_of(text), cwd=clone).returncode
                if status != wanted:
                    raise SystemExit(f"{text}: exit status {status} instead of {wanted}")
            print(f"  {_since(start)}", flush=True)
        print(f"All: {_since(begin)}")


def _times() -> tuple[float, float]:
    """Return the time of the clock and that of all ended processes together, s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.perf_counter(), used.ru_utime + used.ru_stime


def _since(start: tuple[float, float]) -> str:
    clock, processors = (now - then for now, then in zip(_times(), start, strict=True))
    return f"{clock:.0f} s, {processors:.0f} s of processor time"


if __name__ == "__main__":
    main()
