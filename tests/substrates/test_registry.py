from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import pytest_libero_max
from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.contract import SubstrateKind, SubstrateOptions
from pytest_libero_max.substrates.registry import (
    SUBSTRATES,
    chosen_substrate,
    describe_substrate,
    described_substrate,
    images_of,
    open_substrate,
    scores_of,
)

PACKAGE = Path(pytest_libero_max.__file__).parent

MODULE = """
from pytest_libero_max.substrates.contract import SubstrateKind
from pytest_libero_max.substrates.tiny.kind import KIND as TINY

KIND = SubstrateKind("toy", TINY.open, lambda options: {"semantics": options.semantics})
"""


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Another package that adds a substrate."""
    info = tmp_path / "toy_substrate-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: toy-substrate\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[pytest_libero_max.substrates]\ntoy = toy_substrate:KIND\n")
    (tmp_path / "toy_substrate.py").write_text(MODULE)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(SUBSTRATES, "_loaders", None)
    yield
    SUBSTRATES._loaded.pop("toy", None)
    sys.modules.pop("toy_substrate", None)


def test_every_folder_with_a_kind_is_a_substrate() -> None:
    assert list(SUBSTRATES)[:3] == ["embedded", "libero", "tiny"]
    assert [kind.name for kind in SUBSTRATES.values()] == list(SUBSTRATES)


def test_another_package_adds_a_substrate(toy: None) -> None:
    assert [*SUBSTRATES][-1] == "toy"
    assert not SUBSTRATES.is_ours("toy")
    substrate = open_substrate("toy", SubstrateOptions(semantics="corrected"))
    assert substrate.name == "tiny"  # the toy opens it
    asked = SubstrateOptions(semantics="corrected")
    assert describe_substrate("toy", asked) == {"name": "toy", "semantics": "corrected"}


def test_a_kind_answers_for_what_it_leaves_out(toy: None) -> None:
    kind, options, case = SUBSTRATES["toy"], SubstrateOptions(), load_track("smoke").cases[0]
    assert kind.tracks(options).name("smoke") == "smoke"
    assert not kind.lacking(options, [case])
    assert case.suite in kind.scene_of(options, case)
    with pytest.raises(SubstrateError, match="no catalogue"):
        kind.catalogue(options)
    with pytest.raises(SubstrateError, match=f"{case.case_id}.*no source variations"):
        kind.variation_of(case)
    note = "Measured on the toy substrate: a dry run, not a score."
    assert scores_of("toy") == {"comparable_with_published": False, "note": note}


def _files(*below: str) -> Iterator[tuple[Path, ast.Module]]:
    for path in sorted((PACKAGE.joinpath(*below)).rglob("*.py")):
        yield path.relative_to(PACKAGE), ast.parse(path.read_text(encoding="utf-8"))


def _is_of_packages(comparison: str) -> bool:
    return comparison in ("{'mujoco', 'robosuite'} <= found.keys()", "'robosuite' in sys.modules")


def test_nothing_asks_for_a_substrate_by_its_name() -> None:
    """Sources and packages have the names of substrates too, so comparisons with these are left out."""
    found = []
    for path, tree in _files():
        for node in ast.walk(tree):
            if isinstance(node, ast.Compare) and "source" not in ast.unparse(node):
                constants = {one.value for one in ast.walk(node) if isinstance(one, ast.Constant)}
                asked = constants & set(SUBSTRATES)
                if asked and not (asked == {"robosuite"} and _is_of_packages(ast.unparse(node))):
                    found.append(f"{path}:{node.lineno}: {ast.unparse(node)}")
    assert not found


@pytest.mark.parametrize("name", SUBSTRATES)
def test_no_substrate_imports_another_one(name: str) -> None:
    others = tuple(f"pytest_libero_max.substrates.{other}" for other in SUBSTRATES if other != name)
    for path, tree in _files("substrates", name):
        for node in ast.walk(tree):
            module = (node.module or "") if isinstance(node, ast.ImportFrom) else ""
            assert not module.startswith(others), f"{path} imports {module}"


def test_an_unknown_substrate_is_refused_with_the_closest_name() -> None:
    with pytest.raises(SubstrateError, match=r"substrate='embeded' is not a substrate.*'embedded'"):
        open_substrate("embeded")


def test_what_is_not_a_kind_of_that_name_is_refused(
    toy: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "toy_substrate.py").write_text(MODULE.replace('"toy"', '"other"'))
    with pytest.raises(SubstrateError, match="registered as 'toy'"):
        open_substrate("toy")


def test_describing_a_substrate_imports_no_simulator() -> None:
    code = (
        "import sys\nfrom pytest_libero_max.substrates.registry import SUBSTRATES, describe_substrate\n"
        "print([describe_substrate(name) for name in ('embedded', 'tiny')], list(SUBSTRATES))\n"
        "assert not {'mujoco', 'robosuite', 'numpy', 'scipy', 'cv2'} & set(sys.modules)\n"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize(
    ("description", "text", "images"),
    [
        ({"name": "embedded"}, "embedded:images=1", "1"),  # a run from before images had versions
        ({"name": "embedded", "images": "1"}, "embedded:images=1", "1"),
        ({"name": "embedded", "images": "2"}, "embedded", "2"),
        ({"name": "libero", "semantics": "corrected"}, "libero:semantics=corrected", None),
        ({"name": "tiny"}, "tiny", None),
        ({"name": "gone"}, "gone", None),
    ],
)
def test_a_description_names_the_substrate_that_was_played(
    description: dict[str, str], text: str, images: str | None
) -> None:
    assert str(described_substrate(description)) == text
    assert images_of(description) == images
    if description["name"] in SUBSTRATES:
        assert chosen_substrate(text) == described_substrate(description)


def test_films_are_drawn_with_the_images_that_look_best() -> None:
    assert SubstrateOptions(semantics="corrected").for_people() == SubstrateOptions(
        semantics="corrected", images="1"
    )


def test_a_kind_says_nothing_more_by_default() -> None:
    kind = SubstrateKind("bare", lambda options: open_substrate("tiny"))
    assert kind.describe(SubstrateOptions()) == {}
