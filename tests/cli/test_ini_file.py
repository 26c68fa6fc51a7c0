from __future__ import annotations

from pathlib import Path

import pytest

from pytest_libero_max.cli.ini_file import ini_lines
from pytest_libero_max.errors import OptionError

GATES = ["dynamic_sr >= 0.6", "missing == 0"]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("pytest.ini", "[pytest]\nlibero_max_gate =\n    dynamic_sr >= 0.6\n    missing == 0\n"),
        ("tox.ini", "[pytest]\nlibero_max_gate =\n    dynamic_sr >= 0.6\n    missing == 0\n"),
        ("setup.cfg", "[tool:pytest]\nlibero_max_gate =\n    dynamic_sr >= 0.6\n    missing == 0\n"),
        (
            "pyproject.toml",
            '[tool.pytest.ini_options]\nlibero_max_gate = ["dynamic_sr >= 0.6", "missing == 0"]\n',
        ),
    ],
)
def test_an_option_is_found_in_every_file_that_pytest_reads(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text)
    below = tmp_path / "a" / "b"
    below.mkdir(parents=True)
    for folder in (tmp_path, below):
        assert [line for line in ini_lines("libero_max_gate", folder)[0] if line] == GATES


def test_the_first_file_with_settings_for_pytest_counts(tmp_path: Path) -> None:
    (tmp_path / "tox.ini").write_text("[pytest]\nlibero_max_gate = missing == 0\n")
    (tmp_path / "pyproject.toml").write_text("[project]\nname = 'x'\n")
    assert ini_lines("libero_max_gate", tmp_path) == (["missing == 0"], tmp_path)
    (tmp_path / "pytest.ini").write_text("")
    assert ini_lines("libero_max_gate", tmp_path)[0] == []


def test_a_broken_file_is_named(tmp_path: Path) -> None:
    (tmp_path / "pytest.ini").write_text("no section\n")
    with pytest.raises(OptionError, match=r"Cannot read .*pytest\.ini"):
        ini_lines("libero_max_gate", tmp_path)


def test_a_file_that_is_nested_too_deeply_is_named(tmp_path: Path) -> None:
    (tmp_path / "pyproject.toml").write_text("x = " + "[" * 9999)
    with pytest.raises(OptionError, match=r"Cannot read .*pyproject\.toml"):
        ini_lines("libero_max_gate", tmp_path)
