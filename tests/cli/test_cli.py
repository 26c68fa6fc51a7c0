from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from pytest_libero_max.cli import COMMANDS, main


@pytest.mark.parametrize("command", [["show", "max"], ["--help"], ["show", "smoke", "--json"]])
def test_a_reader_that_goes_away_is_left_in_peace(command: list[str]) -> None:
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
    for command in ([], *([name] for name in COMMANDS)):
        with pytest.raises(SystemExit, match="0"):
            main([*command, "--help"])
    assert "usage: libero-max" in capsys.readouterr().out
