"""Commands of other packages and groups of commands: found by entry points, imported when needed."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from pytest_libero_max.cli import commands, main

Install = Callable[..., None]

ADDS = """
def add_command(commands):
    commands.add_parser("{name}", help="Say {text}").set_defaults(run=lambda options: print("{text}"))
"""


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Install:
    """Puts a distribution with commands on the path: a module for each, by the name of the command."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def put(package: str, **modules: str) -> None:
        info = tmp_path / f"{package}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
        names = [f"{name.replace('_in_', '.')} = {package}_{name}" for name in modules]
        (info / "entry_points.txt").write_text("\n".join(["[pytest_libero_max.commands]", *names]))
        for name, text in modules.items():
            monkeypatch.delitem(sys.modules, f"{package}_{name}", raising=False)  # of an earlier test
            (tmp_path / f"{package}_{name}.py").write_text(text)
        monkeypatch.setattr(commands, "COMMANDS", commands.registry())

    return put


def output_of(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    with pytest.raises(SystemExit, match="0"):
        main([*words, "--help"])
    return " ".join(capsys.readouterr().out.split())


def test_a_package_adds_a_command_and_one_to_a_group(
    install: Install, capsys: pytest.CaptureFixture[str]
) -> None:
    group = "def add_command(commands):\n    commands.add_group('weather', 'About weather')"
    rain = ADDS.format(name="rain", text="drop")
    install("skies", wave=ADDS.format(name="wave", text="hello"), weather=group, weather_in_rain=rain)
    assert main(["wave"]) == 0
    assert main(["weather", "rain"]) == 0
    assert capsys.readouterr().out == "hello\ndrop\n"
    assert "weather About weather:" in output_of(capsys)
    assert "rain Say drop" in output_of(capsys, "weather")


def test_a_command_that_went_into_a_group_names_it(
    install: Install, capsys: pytest.CaptureFixture[str]
) -> None:
    install("clouds", sky="def add_command(commands): commands.add_group('sky', 'High')", sky_in_hail="")
    with pytest.raises(SystemExit, match="2"):
        main(["hail"])
    assert "libero-max sky hail" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("module", "reason"),
    [
        ("raise RuntimeError('at import')", "RuntimeError: at import"),
        ("x = 1", "a module with a function add_command"),
        ("def add_command(commands): raise RuntimeError('when added')", "RuntimeError: when added"),
        ("def add_command(commands): pass", "adds no command 'broken'"),
    ],
)
def test_a_broken_command_is_an_error_of_itself_alone(
    module: str, reason: str, install: Install, capsys: pytest.CaptureFixture[str]
) -> None:
    install("shards", broken=module, wave=ADDS.format(name="wave", text="hello"))
    assert main(["broken"]) == 1
    assert reason in capsys.readouterr().err
    assert main(["wave"]) == 0
    listed = output_of(capsys)
    assert reason in listed
    assert "wave Say hello" in listed


@pytest.mark.parametrize("name", ["film", "wave"])
def test_a_name_that_two_packages_declare_is_refused(
    name: str, install: Install, capsys: pytest.CaptureFixture[str]
) -> None:
    install("tide", **{name: ""})
    install("surf", wave="")
    assert main(["list", "events"]) == 1
    error = capsys.readouterr().err
    assert "offered twice" in error
    assert all(
        word in error for word in (["tide", "pytest-libero-max"] if name == "film" else ["tide", "surf"])
    )


def test_help_imports_nothing_heavy() -> None:
    script = (
        "import sys; from pytest_libero_max.cli import parser; parser().format_help(); "
        "print(*{'mujoco', 'cv2', 'scipy', 'robosuite', 'numba'} & {*sys.modules})"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
