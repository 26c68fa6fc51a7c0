from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.contract import SubstrateKind, SubstrateOptions
from pytest_libero_max.substrates.registry import (
    ENTRY_POINT_GROUP,
    SUBSTRATES,
    describe_substrate,
    open_substrate,
)

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
    (info / "entry_points.txt").write_text(f"[{ENTRY_POINT_GROUP}]\ntoy = toy_substrate:KIND\n")
    (tmp_path / "toy_substrate.py").write_text(MODULE)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(SUBSTRATES, "_loaders", None)
    yield
    SUBSTRATES._loaded.pop("toy", None)
    sys.modules.pop("toy_substrate", None)


def test_every_folder_with_a_kind_is_a_substrate() -> None:
    assert list(SUBSTRATES) == ["embedded", "libero", "tiny"]
    assert [kind.name for kind in SUBSTRATES.values()] == list(SUBSTRATES)


def test_another_package_adds_a_substrate(toy: None) -> None:
    assert list(SUBSTRATES) == ["embedded", "libero", "tiny", "toy"]
    substrate = open_substrate("toy", SubstrateOptions(semantics="corrected"))
    assert substrate.name == "tiny"  # the toy opens it
    asked = SubstrateOptions(semantics="corrected")
    assert describe_substrate("toy", asked) == {"name": "toy", "semantics": "corrected"}


def test_an_unknown_substrate_is_refused_with_the_closest_name() -> None:
    with pytest.raises(SubstrateError, match=r"substrate='embeded' is not a substrate.*'embedded'"):
        open_substrate("embeded")


def test_what_is_not_a_kind_of_that_name_is_refused(
    toy: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "toy_substrate.py").write_text(MODULE.replace('"toy"', '"other"'))
    with pytest.raises(SubstrateError, match="must be a SubstrateKind of that name"):
        open_substrate("toy")


def test_describing_a_substrate_imports_no_simulator() -> None:
    code = (
        "import sys\nfrom pytest_libero_max.substrates.registry import SUBSTRATES, describe_substrate\n"
        "print([describe_substrate(name) for name in ('embedded', 'tiny')], list(SUBSTRATES))\n"
        "assert not {'mujoco', 'robosuite', 'numpy', 'scipy', 'cv2'} & set(sys.modules)\n"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_kind_says_nothing_more_by_default() -> None:
    kind = SubstrateKind("bare", lambda options: open_substrate("tiny"))
    assert kind.describe(SubstrateOptions()) == {}
