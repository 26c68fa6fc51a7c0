"""The Markdown files of the repository: no link, picture or heading that they name is missing."""

from __future__ import annotations

import ast
import importlib
import re
from pathlib import Path
from typing import Any

import pytest

import pytest_libero_max
from pytest_libero_max.benchmark.manifests import load_manifest
from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.pairing.runner import play_pair
from pytest_libero_max.policies.loading import forget_adapter, load_policy
from pytest_libero_max.substrates.tiny.world import TinyWorld
from tests.documented_commands import files_of_pages
from tests.pairing.actors import make_case, shorten

ROOT = Path(__file__).parents[1]
FOLDERS = ("docs", "pytest_libero_max", "cases", "fixtures", "reports", "tests", ".github")
DOCUMENTS = sorted({*ROOT.glob("*.md"), *(path for name in FOLDERS for path in (ROOT / name).rglob("*.md"))})

_FENCE = re.compile(r"^(```|~~~).*?^\1", re.M | re.S)
_LINK = re.compile(r"!?\[[^\]]*\]\((?P<target>[^)\s]+)\)")
_HEADING = re.compile(r"^#+ (?P<text>.+)$", re.M)


def _anchors(path: Path) -> set[str]:
    """The anchors of a file's headings, as code hosts spell them."""
    headings = _HEADING.findall(_FENCE.sub("", path.read_text(encoding="utf-8")))
    return {re.sub(r"[^\w\- ]", "", text.lower()).strip().replace(" ", "-") for text in headings}


def _dead_links(path: Path) -> list[str]:
    dead = []
    for match in _LINK.finditer(_FENCE.sub("", path.read_text(encoding="utf-8"))):
        target, _, anchor = match["target"].partition("#")
        if re.match(r"[a-z]+:", target):
            continue
        file = path.parent / target if target else path
        if not file.exists() or (anchor and file.suffix == ".md" and anchor not in _anchors(file)):
            dead.append(match["target"])
    return dead


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_relative_link_or_picture_is_dead(path: Path) -> None:
    assert not _dead_links(path)


def test_dead_links_are_found(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "# A head-line\n\n[a](page.md#a-head-line) [b](gone.md) ![c](gone.png) [d](#gone) [e](https://x.y)\n"
    )
    assert _dead_links(page) == ["gone.md", "gone.png", "#gone"]


def test_the_readme_counts_the_pairs_of_each_track() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    counts = dict(re.findall(r"`(\w+)`\s\(([\d,]+) pairs", text))
    assert {"smoke", "lite", "max"} <= {*counts}
    for track, count in counts.items():
        assert len(load_track(track).cases) == int(count.replace(",", "")), track


def test_the_readme_and_those_of_rooms_are_short() -> None:
    assert (ROOT / "README.md").stat().st_size <= 8_000
    rooms = [*(ROOT / "pytest_libero_max").rglob("*/README.md"), *(ROOT / "fixtures").rglob("README.md")]
    assert len(rooms) > 10
    lines = {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8").count("\n") for path in rooms}
    assert {name: number for name, number in lines.items() if number > 60} == {}


MOST_WORDS = 45_000
"""Words of all pages that are neither written from the code nor evidence."""


def test_the_pages_stay_short_together() -> None:
    written = (ROOT / "reports", ROOT / "docs" / "reference")
    pages = [path for path in DOCUMENTS if not any(path.is_relative_to(folder) for folder in written)]
    assert sum(len(path.read_text(encoding="utf-8").split()) for path in pages) <= MOST_WORDS


_PLACE = re.compile(r"`(?P<path>(?:\w+/)+(?:\w+\.py)?|\w+/\w+\.py)(?:: (?P<name>[\w.]+))?`")


def test_the_map_names_files_and_functions_that_exist() -> None:
    package = ROOT / "pytest_libero_max"
    places = list(_PLACE.finditer((package / "README.md").read_text(encoding="utf-8")))
    assert len(places) > 30
    for place in places:
        file = next(
            (base / place["path"] for base in (package, ROOT) if (base / place["path"]).exists()), None
        )
        assert file is not None, place[0]
        for name in (place["name"] or "").split("."):
            assert not name or re.search(rf"\b(def|class) {name}\b|^{name}\b", file.read_text(), re.M), place[
                0
            ]


FOR_DEVELOPERS = "For developers of the package: it imports internal modules."
"""Sentence that allows a file for users to import what is not public."""

SOURCES = [
    path for name in ("fixtures", "tests/plugin/example_package") for path in (ROOT / name).rglob("*.py")
]


def _examples() -> list[tuple[Path, str]]:
    """The Python in the Markdown files, less the sources of files of the package itself."""
    found = []
    for path in DOCUMENTS:
        text = path.read_text(encoding="utf-8")
        for match in re.finditer(r"^```python[^\n]*\n(.*?)^```", text, re.M | re.S):
            before = text[: match.start()].rstrip().rsplit("\n\n", maxsplit=1)[-1]
            if "`pytest_libero_max/" not in before:
                found.append((path, match[1]))
    return found


def test_what_users_copy_imports_public_names_alone() -> None:
    sources = [(path, path.read_text(encoding="utf-8")) for path in SOURCES] + _examples()
    private = {
        f"{path.relative_to(ROOT)}: {name}"
        for path, source in sources
        if FOR_DEVELOPERS not in source
        for name in _imported(source)
        if not _is_public(name)
    }
    assert len(sources) > 10
    assert not private


def _imported(source: str) -> list[str]:
    """The names that a source imports from the package."""
    nodes = [*ast.walk(ast.parse(source))]
    plain = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    named = [
        f"{node.module}.{alias.name}"
        for node in nodes
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    ]
    return [name for name in (*plain, *named) if name.split(".")[0] == "pytest_libero_max"]


def _is_public(name: str) -> bool:
    """True for a name of the façade, and for one of a module that is such a name or needs an extra."""
    _, *path = name.split(".")
    if path[0] == "lab":  # what it needs may not be installed
        return path[-1] in _all_of(ROOT / Path("pytest_libero_max", *path[:-1]))
    if path[0] == "gym":
        pytest.importorskip("gymnasium", reason="the extra gym")
        return path[1] in importlib.import_module("pytest_libero_max.gym").__all__
    value: object = pytest_libero_max
    for part in path:
        if part not in getattr(value, "__all__", ()):
            return False
        value = getattr(value, part)
    return True


def _all_of(module: Path) -> list[str]:
    """The names in ``__all__`` of a module that is not imported; none where it has none."""
    file = module / "__init__.py" if module.is_dir() else module.with_suffix(".py")
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            return list(ast.literal_eval(node.value))
    return []


def test_the_adapter_of_the_readme_plays_a_pair(tmp_path: Path) -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (source,) = (block for block in re.findall(r"```python\n(.*?)```", text, re.S) if "PolicySpec" in block)
    assert len([line for line in source.splitlines() if line.strip()]) <= 15
    (tmp_path / "adapter.py").write_text(source)
    (tmp_path / "my_model.py").write_text(MODEL)
    policy = load_policy(str(tmp_path / "adapter.py"))
    record = play_pair(shorten(make_case(distance_m=1.0)), TinyWorld(), policy)
    forget_adapter()  # sessions in this process have an adapter.py of their own
    assert record.triggered
    assert record.policy["name"] == "my-vla"


def test_the_mended_policy_of_the_tutorial_is_an_adapter(tmp_path: Path) -> None:
    (tmp_path / "mended.py").write_text(files_of_pages()["mended.py"])
    policy = load_policy(str(tmp_path / "mended.py"))
    assert (policy.spec.name, policy.spec.cameras) == ("mended", ())


def test_the_event_of_the_how_to_has_two_variants() -> None:
    names: dict[str, Any] = {}
    exec(files_of_pages()["dim/libero_max_dim.py"], names)
    kind = names["IlluminationDim"]()
    assert len(kind.severities) == 2
    assert [kind.resolve(variant, None, None).change["scale"] for variant in (0, 1)] == [0.6, 1.4]


def test_the_script_of_the_how_to_writes_a_manifest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    exec(files_of_pages()["make_cases.py"].replace("illumination_dim", "illumination_switch"), {})
    assert len(load_manifest(tmp_path / "dim.json").cases) == 2


MODEL = """
import numpy as np


class Model:
    def act(self, image, position, instruction, seed):
        assert image.shape == (256, 256, 3) and image.dtype == np.uint8 and position.shape == (3,)
        return np.tile((0.1, 0.0, -0.2, 0.0, 0.0, 0.0, -1.0), (16, 1))

    def forget(self):
        pass


def load():
    return Model()
"""
