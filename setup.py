"""Build steps beyond pyproject.toml: frozen tracks, files to begin with, and the README of a package index.

The tracks lie in ``cases`` and are installed as ``pytest_libero_max/tracks``. A build in which one of them
is missing or altered fails. What ``libero-max init`` writes lies in ``fixtures``.
"""

from __future__ import annotations

import gzip
import hashlib
import os
import re
import shutil
import sys
import tomllib
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py
from setuptools.command.sdist import sdist

ROOT = Path(__file__).resolve().parent
CASES = ROOT / "cases"

STARTER = ("policies/vla.py", "github-action/workflow.yml")
"""Files of ``fixtures`` that are installed as ``pytest_libero_max/starter``."""

SOURCE = os.environ.get("LIBERO_MAX_SOURCE_URL", "").rstrip("/")
"""The address of the repository, which the release workflow knows. Without it there are no project URLs."""

UNSUPPORTED = """\
pytest-libero-max needs Python 3.11 to 3.14; this is {version}.
Robosuite 1.4 runs on MuJoCo up to 3.9, and MuJoCo 3.9 has no wheel for Python 3.15 and later.
Make the environment with another interpreter, which uv can bring:
  python3 -m venv .venv-uv && .venv-uv/bin/pip install uv
  .venv-uv/bin/uv venv --clear --seed --python 3.13 .venv
or use the container: see Containerfile."""


def check_python() -> None:
    """Refuse an interpreter for which there is no MuJoCo that plays, before pip looks for one in vain."""
    if sys.version_info >= (3, 15):
        sys.exit(UNSUPPORTED.format(version=sys.version.split()[0]))


def check_tracks() -> None:
    """Refuse to build when a frozen file is missing or differs from its checksum."""
    for checksums in (CASES / "SHA256SUMS", *sorted(CASES.glob("*/SHA256SUMS"))):
        for line in checksums.read_text(encoding="utf-8").splitlines():
            check_file(checksums, *line.split())


def check_file(checksums: Path, digest: str, name: str) -> None:
    """Refuse to build when a file that is listed is missing or altered."""
    plain = checksums.parent / name
    packed = checksums.parent / f"{name}.gz"
    named = checksums.relative_to(ROOT).as_posix()
    if not plain.exists() and not packed.exists():
        sys.exit(f"{plain} is missing, and {named} lists it. Restore it before building.")
    content = plain.read_bytes() if plain.exists() else gzip.decompress(packed.read_bytes())
    if hashlib.sha256(content).hexdigest() != digest:
        sys.exit(f"{plain}: the content differs from {named}. Restore it before building.")


class BuildWithTracks(build_py):
    """Copies ``cases`` into the package. An editable installation reads them where they are."""

    def run(self) -> None:
        super().run()
        if not self.editable_mode:
            check_tracks()
            target = Path(self.build_lib, "pytest_libero_max", "tracks")
            shutil.rmtree(target, ignore_errors=True)
            shutil.copytree(CASES, target, ignore=shutil.ignore_patterns("*.md"))
            for name in STARTER:
                copy = Path(self.build_lib, "pytest_libero_max", "starter", name)
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(ROOT / "fixtures" / name, copy)


class CheckedSource(sdist):
    """A source distribution with all tracks."""

    def run(self) -> None:
        check_tracks()
        super().run()


def readme_for_index(text: str, source: str, version: str) -> str:
    """Return the README with addresses that hold outside the repository.

    Args:
        text: Markdown with links relative to the repository's root.
        source: The repository's address. If empty, pictures are left out and links become plain text.
        version: The release, whose tag is ``v`` and the version.
    """

    def replace(match: re.Match[str]) -> str:
        picture, label, target = match.groups()
        if re.match(r"[a-z]+:|#", target):
            return match[0]
        if not source:
            return "" if picture else label
        return f"{picture}[{label}]({source}/{'raw' if picture else 'blob'}/v{version}/{target})"

    prose_and_code = re.split(r"(^```.*?^```)", text, flags=re.M | re.S)
    link = re.compile(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)")
    return "".join(part if part.startswith("```") else link.sub(replace, part) for part in prose_and_code)


def project_urls(source: str) -> dict[str, str]:
    """Return the addresses shown by a package index."""
    if not source:
        return {}
    return {
        "Source": source,
        "Issues": f"{source}/issues",
        "Changelog": f"{source}/blob/main/CHANGELOG.md",
    }


if __name__ == "__main__":
    check_python()
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    setup(
        cmdclass={"build_py": BuildWithTracks, "sdist": CheckedSource},
        long_description=readme_for_index((ROOT / "README.md").read_text(encoding="utf-8"), SOURCE, version),
        long_description_content_type="text/markdown",
        project_urls=project_urls(SOURCE),
    )
