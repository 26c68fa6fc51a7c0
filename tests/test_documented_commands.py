"""Every command in a document is one that the program accepts; some are run as they are printed."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from pytest_libero_max.cli import main
from pytest_libero_max.policies.loading import forget_adapter
from tests.documented_commands import NOT_YET, ROOT, Documented, documented, fault_of, unproved
from tests.plugin.conftest import REACHER, short_sessions, tiny_manifest

__all__ = ["short_sessions"]  # a fixture


def test_every_documented_command_is_accepted(pytestconfig: pytest.Config) -> None:
    faults = [
        f"{command.document}: {command.text}\n    {fault}"
        for command in dict.fromkeys(documented())
        if (fault := fault_of(command, pytestconfig)) is not None
    ]
    assert not faults, "\n" + "\n".join(faults)
    texts = {command.text for command in documented()}
    assert len(texts) > 300
    assert {*NOT_YET} <= texts


def test_each_command_of_the_tutorial_and_the_how_tos_is_played_or_needs_what_is_not_here() -> None:
    pages = [each for each in documented() if each.document.startswith(("docs/tutorial", "docs/how-to"))]
    commands = [each for each in pages if not each.mention]
    assert len(commands) > 100
    assert {each.text: parts for each in commands if (parts := unproved(each))} == {}
    assert unproved(Documented("page.md", "libero-max nowhere && pytest && curl example.org")) == [
        "libero-max nowhere",
        "curl example.org",
    ]


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("libero-max powr --base 0.8", "there is no command"),
        ("libero-max plan gates --gate", "expected one argument"),
        ("libero-max plan pairs --base", "expected one argument"),
        ("libero-max dev bench pairs --repeats -1", "whole number"),
        ("libero-max film RUN --select=some", "invalid choice"),
        ("pytest --libero-max-policy=expert --libero-max-trak=lite", "unrecognized arguments"),
        ("pytest --libero-max-policy=expert --libero-max-track=light", "light"),
        ("pytest --libero-max-policy=expert --libero-max-strict=gain", "gain"),
        ('pytest --libero-max-policy=expert -k "camera_shift and nowhere"', "selects no case"),
        ("pytest tests/nowhere", "there is no tests/nowhere"),
        ("python -m tests.nowhere", "there is no module"),
        ("python -m tests.scripts.profile_pairs --pears 8", "has no --pears"),
        ("python fixtures/nowhere.py", "there is no nowhere.py"),
        ("pip install 'pytest-libero-max[gym]'", "on no index"),
        ("pip install -e '.[gim]'", "no extra"),
        ("pip install -r .ci/nowhere.txt", "there is no .ci/nowhere.txt"),
        ("curl example.org", "nobody says why"),
    ],
)
def test_a_command_that_is_not_accepted_is_found(text: str, fault: str, pytestconfig: pytest.Config) -> None:
    assert fault in str(fault_of(Documented("page.md", text), pytestconfig))


def test_a_sentence_may_leave_out_what_has_to_be_given(pytestconfig: pytest.Config) -> None:
    assert (
        fault_of(Documented("page.md", "libero-max film --view=policy", mention=True), pytestconfig) is None
    )
    assert fault_of(Documented("page.md", "libero-max film --view=policy"), pytestconfig) is not None


READ_ALONE = (
    "libero-max lab claim --csv reports/claims.csv",
    "libero-max lab claim 78/100 vs 74/100",
    "libero-max lab claim 97.1% vs 96.9% --n 2000",
    "libero-max lab claim 78/100 vs 70/100 --only-first 8 --only-second 0",
    'libero-max plan gates --base 0.84 --gate "delta >= -15%"',
    "libero-max compare --published --tables published",
    "libero-max list programs",
    "libero-max list profiles",
    "libero-max list events",
    "libero-max list published",
    "libero-max list words",
    "python -m tests.scripts.interaction reports/beyond/compound-servo",
)
"""Commands that read what is in the repository, and need no simulator."""


@pytest.mark.parametrize("text", READ_ALONE)
def test_what_reads_the_repository_runs_as_it_is_printed(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert text in {command.text.partition("#")[0].strip() for command in documented()}
    (tmp_path / "reports").symlink_to(ROOT / "reports")
    monkeypatch.chdir(tmp_path)
    program, *words = shlex.split(text)
    if program == "libero-max":
        assert main(words) == 0
        assert capsys.readouterr().out
    else:
        subprocess.run([sys.executable, *words], check=True, capture_output=True, cwd=ROOT)


ON_THE_TINY_SUBSTRATE = {
    "docs/how-to/films.md": ("pytest ", "libero-max film", "libero-max report"),
    "AGENTS.md": ("libero-max check", "pytest ", "libero-max film"),
}
"""Documents whose commands are run, and the beginnings of those that need no scene of the tracks."""

NEEDED_HERE = {
    "libero-max check": ["--substrate=tiny"],
    "libero-max film": ["--size=32", "--every=8", "--cases=tiny.json"],
    "pytest ": ["--libero-max-substrate=tiny", "--libero-max-manifest=tiny.json", "-p", "no:cacheprovider"],
}
"""What a command is given beside what is printed, by its beginning: another substrate, smaller pictures."""

SEEING = REACHER.replace("cameras=(), image_size=64", "cameras=('agentview',), image_size=32").replace(
    "    def reset",
    """
    def model_inputs(self, observation, query):
        return {"image": observation["agentview_image"][::-1, ::-1]}

    def reset""",
)


@pytest.mark.usefixtures("short_sessions")
@pytest.mark.parametrize("document", ON_THE_TINY_SUBSTRATE)
def test_what_plays_and_looks_runs_as_it_is_printed(
    document: str, pytester: pytest.Pytester, capsys: pytest.CaptureFixture[str]
) -> None:
    pytester.makepyfile(adapter=SEEING)
    manifest = tiny_manifest(events=("camera_shift",))
    pytester.path.joinpath("tiny.json").write_text(json.dumps(manifest))
    played = [
        command.text
        for command in documented()
        if command.document == document
        and not command.mention
        and command.text.startswith(ON_THE_TINY_SUBSTRATE[document])
    ]
    assert len(played) > 2
    for text in played:
        line = text.replace("NAME", manifest["cases"][0]["case_id"])
        program, *words = shlex.split(line, comments=True)
        words += [word for begin, more in NEEDED_HERE.items() if line.startswith(begin) for word in more]
        status = main(words) if program == "libero-max" else pytester.runpytest_subprocess(*words).ret
        # `check` names the stand-in for a model, which looks at nothing.
        assert status == int(line.startswith("libero-max check")), capsys.readouterr()
        forget_adapter()


def test_a_policy_is_served_with_what_the_page_names() -> None:
    page = " ".join((ROOT / "docs" / "how-to" / "served-policy.md").read_text(encoding="utf-8").split())
    needed = re.search(r"environment only has to have ([^:]*): install", page)
    assert needed is not None
    assert [name.strip("`") for name in re.split(r", | and ", needed[1])] == [
        "NumPy",
        "Pillow",
        "msgpack",
        "msgspec",
        "websockets",
    ]
    absent = (
        "cv2",
        "hypothesis",
        "jinja2",
        "mujoco",
        "numba",
        "pytest",
        "robosuite",
        "scipy",
        "termcolor",
        "xdist",
    )
    blocked = f"import sys; sys.modules.update(dict.fromkeys({absent!r}))"
    serve = "from pytest_libero_max.cli import main; sys.exit(main(['serve', 'nowhere.py', '--port', '0']))"
    result = subprocess.run([sys.executable, "-c", f"{blocked}; {serve}"], capture_output=True, text=True)
    assert (result.returncode, "nowhere.py" in result.stderr) == (1, True), result.stderr
