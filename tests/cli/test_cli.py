from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from pytest_libero_max.cli import main
from pytest_libero_max.cli.commands import COMMANDS


@pytest.mark.parametrize("words", ["list cases max", "--help"])
def test_a_reader_that_goes_away_is_left_in_peace(words: str) -> None:
    command = words.split()
    script = "import sys; from pytest_libero_max.cli import main; sys.exit(main(sys.argv[1:]))"
    with subprocess.Popen(
        [sys.executable, "-c", script, *command], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == b""
    # argparse itself passes over a pipe that is closed while it writes.
    assert process.returncode in ((0, 141) if command == ["--help"] else (141,))


def test_an_error_is_one_line_and_a_status(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", str(tmp_path)]) == 1
    assert capsys.readouterr().err.startswith("libero-max: Cannot read")


def test_everything_has_help(capsys: pytest.CaptureFixture[str]) -> None:
    for command in ([], *(name.split(".") for name in COMMANDS)):
        with pytest.raises(SystemExit, match="0"):
            main([*command, "--help"])
    assert "usage: libero-max" in capsys.readouterr().out


def test_a_command_that_is_mistyped_is_suggested(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["chek"])
    assert "mean 'check'?" in capsys.readouterr().err
    for name in COMMANDS:
        *group, own = name.split(".")
        with pytest.raises(SystemExit, match="2"):
            main([*group, f"{own}x"])
        assert f"Did you mean {own!r}?" in capsys.readouterr().err


def test_help_names_every_command_once_and_what_it_does(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="0"):
        main(["--help"])
    listed = capsys.readouterr().out
    for name in (name for name in COMMANDS if "." not in name):
        assert len(re.findall(rf"^  {name} +[A-Z]", listed, re.MULTILINE)) == 1, name
    with pytest.raises(SystemExit, match="0"):
        main(["gate", "--help"])
    assert "Decide gates on a" in capsys.readouterr().out


def test_an_error_names_options_as_the_command_does(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "openpi://localhost:1"]) == 1
    assert "Add --profile=NAME" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["certify", "freeze", "verify"])
def test_a_folder_without_tracks_is_named(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["dev", command, "nope"]) == 1
    assert capsys.readouterr().err.startswith("libero-max: nope has no tracks.")


def test_a_case_is_found_by_the_beginning_of_its_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "cases", "smoke", "pro-object_shape-spatial"]) == 0
    assert capsys.readouterr().out.startswith("pro-object-shape-spatial-t01-i08-target_relocation-d1-p195")
    assert main(["list", "cases", "smoke", "pro-object"]) == 1
    assert "not in libero-max-embedded-smoke" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("dev bench pairs --steps 0", "argument --steps: '0', but must be a whole number of at least 1"),
        ("dev bench pairs --scene libero_spatial/x", "argument --scene: 'libero_spatial/x' is no scene"),
        ("serve noop --port 70000", "argument --port: '70000', but must be a whole number from 0 to 65535"),
        ("view run --port one", "argument --port: 'one', but must be a whole number from 0 to 65535"),
        ("dev preflight smoke --jobs 0", "argument --jobs: '0', but must be a whole number of at least 1"),
        (
            "dev bench device --seconds -1",
            "argument --seconds: '-1', but must be a number from 0.001 to 3600",
        ),
        ("runs run --interval nan", "argument --interval: 'nan', but must be a number from 0.01 to 3600"),
        ("shards slurm --shards 1 -- -q", "argument --shards: '1', but must be a whole number of at least 2"),
        ("film run --size 31", "argument --size: '31', but must be a whole number of at least 32"),
    ],
)
def test_a_number_out_of_range_names_the_command_the_argument_and_the_rule(
    arguments: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    require_refusal(arguments, message, capsys)


def require_refusal(arguments: str, message: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Give a command arguments that its parser refuses with a message."""
    with pytest.raises(SystemExit, match="2"):
        main(arguments.split())
    error = capsys.readouterr().err
    assert error.startswith(f"usage: libero-max {arguments.split()[0]}")
    assert f": error: {message}" in error
