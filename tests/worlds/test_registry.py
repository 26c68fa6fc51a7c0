from __future__ import annotations

import subprocess
import sys

import pytest

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.worlds.registry import SUBSTRATES, describe_substrate, open_substrate
from pytest_libero_max.worlds.tiny import TinySubstrate


def test_the_substrates_are_found_in_the_folder_of_worlds() -> None:
    assert tuple(SUBSTRATES) == ("embedded", "libero", "tiny")


def test_naming_the_substrates_imports_none_of_them() -> None:
    code = (
        "import sys\n"
        "from pytest_libero_max.worlds.registry import SUBSTRATES\n"
        "assert 'tiny' in SUBSTRATES\n"
        "assert not {'mujoco', 'numpy', 'pytest_libero_max.worlds.tiny'} & {*sys.modules}"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_substrate_is_opened_by_its_name() -> None:
    assert isinstance(open_substrate("tiny"), TinySubstrate)
    assert describe_substrate("tiny") == {"name": "tiny"}


def test_an_unknown_substrate_suggests_the_closest() -> None:
    with pytest.raises(SubstrateError, match=r"substrate='tinny' is not a substrate\. Did you mean 'tiny'"):
        open_substrate("tinny")


def test_own_variations_need_a_catalogue() -> None:
    from pytest_libero_max.worlds.registry import SubstrateOptions

    with pytest.raises(SubstrateError, match="variations='own', but no catalogue of them was given"):
        open_substrate("libero", SubstrateOptions(variations="own"))
