"""A published folder that names places: nothing outside of it is imported, run or opened for it."""

from __future__ import annotations

import gzip
import json
import shutil
import subprocess
from functools import partial
from http.client import HTTPConnection
from http.server import ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.cli import main, view
from pytest_libero_max.errors import ReportError
from pytest_libero_max.report.writers.report_files import write_text
from pytest_libero_max.runs.outside import outside_text, require_inside
from pytest_libero_max.runs.store import read_pairs
from pytest_libero_max.substrates.libero import importing

from .short_run import SIZE, Played, store

PAYLOAD = "from pathlib import Path\nPath({!r}).write_text('')\n"


def _fake_libero(root: Path, witness: Path) -> Path:
    """Write what is complete enough to be taken for a LIBERO; importing any of it leaves a witness."""
    package = root / "libero" / "libero"
    for part in (
        "envs",
        "utils",
        "benchmark",
        "bddl_files/libero_spatial",
        "init_files/libero_spatial",
        "assets",
    ):
        (package / part).mkdir(parents=True)
    for file in (package.parent, package, package / "envs", package / "utils", package / "benchmark"):
        (file / "__init__.py").write_text(PAYLOAD.format(str(witness)))
    tasks = {"libero_spatial": [f"task_{index}" for index in range(10)]}
    (package / "benchmark" / "libero_suite_task_map.py").write_text(f"libero_task_map = {tasks!r}")
    for name in tasks["libero_spatial"]:
        (package / "bddl_files" / "libero_spatial" / f"{name}.bddl").write_text("(define (problem x))")
        (package / "init_files" / "libero_spatial" / f"{name}.pruned_init").write_text("")
    return root


@pytest.fixture
def witness(tmp_path: Path) -> Path:
    return tmp_path / "it-was-run"


@pytest.fixture
def evil(played: Played, tmp_path: Path, witness: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A published folder with an installation, an adapter, a manifest and a profile of its author's."""
    run = store(played, tmp_path / "run", tmp_path / "tiny.json")
    assert main(["publish", "pack", str(run), str(tmp_path / "published"), "--actions"]) == 0
    folder = tmp_path / "published"
    _fake_libero(folder / "installation", witness)
    for name in ("adapter.py", "conftest.py", "numpy.py", "mujoco.py"):
        (folder / name).write_text(PAYLOAD.format(str(witness)))
    shutil.copy(tmp_path / "tiny.json", folder / "tiny.json")
    (folder / "profile.toml").write_text("[policy]\n")
    _renamed(
        folder,
        substrate={
            "name": "libero",
            "roots": [str(folder / "installation")],
            "assets": str(folder / "installation"),
        },
        policy={
            "reference": f"{folder}/adapter.py",
            "profile": f"{folder}/profile.toml",
            "horizon": None,
            "query_interval": None,
        },
        case_set={"name": "manifest tiny.json", "digest": "0" * 64, "path": str(folder / "tiny.json")},
    )
    monkeypatch.setattr(importing, "missing_requirements", lambda module: ())
    monkeypatch.chdir(folder)
    return folder


def _renamed(folder: Path, **parts: Json) -> None:
    """Write other parts of the provenance, and the reports that follow from them."""
    path = folder / "pairs.jsonl.gz"
    first, *rest = map(json.loads, gzip.decompress(path.read_bytes()).decode().splitlines())
    first["provenance"] |= parts
    for line in rest:
        line["fingerprints"]["substrate"] = first["provenance"]["substrate"]["name"]
    content = "".join(json.dumps(line) + "\n" for line in (first, *rest))
    path.write_bytes(gzip.compress(content.encode()))
    assert main(["publish", "pack", str(folder), str(folder)]) == 0


COMMANDS: tuple[tuple[str, ...], ...] = (
    ("publish", "verify", ".", "--pairs=1", "--seed=1"),
    ("publish", "verify", ".", "--pairs=1", "--seed=1", "--actions"),
    ("film", ".", "--select=all", f"--size={SIZE}", "--format=webp"),
    ("film", ".", "--select=all", f"--size={SIZE}", "--format=webp", "--view=policy"),
)
"""Commands that play pairs again, all of which take ``--cases``."""

READERS: tuple[tuple[str, ...], ...] = (
    ("report", "."),
    ("compare", ".", "../run"),
    ("gate", ".", "--gate=base_sr >= 0"),
    ("publish", "pack", ".", "again"),
    ("publish", "index", ".", "--output=index.html"),
)


@pytest.mark.parametrize("policy", ["noop", "its own"])
def test_no_command_runs_what_a_folder_names(
    policy: str, evil: Path, witness: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With the manifest of the machine that reads it, so that each command goes as far as it can."""
    commands = COMMANDS + READERS
    if policy == "noop":
        _renamed(evil, policy={"reference": "noop", "horizon": None, "query_interval": None})
        commands = ()
    cases = f"--cases={tmp_path / 'tiny.json'}"
    for arguments in (*commands, *((*command, cases) for command in COMMANDS)):
        main([*arguments])
        assert not witness.exists(), arguments
    assert "Nothing that a" in capsys.readouterr().out


def test_a_pair_is_played_again_with_the_options_of_this_machine_alone(
    evil: Path,
    witness: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    _renamed(evil, policy={"reference": "noop", "horizon": None, "query_interval": None})
    given: list[list[str]] = []
    play = subprocess.run

    def listed(command: list[str], **how: Any) -> subprocess.CompletedProcess[Any]:
        if "pytest" in command:
            given.append(command)
        return play(command, **how)

    monkeypatch.setattr("pytest_libero_max.runs.run_verification.subprocess.run", listed)
    cases = f"--cases={tmp_path / 'tiny.json'}"
    main(["publish", "verify", ".", "--pairs=1", cases])
    assert main(["publish", "verify", ".", "--pairs=1", cases, f"--libero={tmp_path}"]) == 1
    first, second = ([word for word in command if "libero-max-libero" in word] for command in given)
    assert first == []
    assert second == [f"--libero-max-libero={tmp_path}"]
    assert not [word for command in given for word in command if str(evil) in word]
    out = capsys.readouterr().out
    assert f"substrate.roots={evil}/installation" in out
    assert "Nothing that a" in out
    assert not witness.exists()


def test_what_only_an_option_may_name_is_asked_for(
    evil: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["publish", "verify", ".", "--pairs=1"]) == 1
    assert "--policy=" in capsys.readouterr().err
    assert main(["publish", "verify", ".", "--pairs=1", "--policy=noop"]) == 1
    assert "--cases=" in capsys.readouterr().err
    assert main(["publish", "verify", ".", "--pairs=1", "--policy=openpi://here:1"]) == 1
    assert "--profile" in capsys.readouterr().err
    assert main(["film", "."]) == 1
    assert "--cases=" in capsys.readouterr().err


def test_a_run_that_names_no_place_says_nothing_of_it() -> None:
    assert (
        outside_text({"policy": {"profile": "openpi"}, "case_set": {"program": "transient"}, "substrate": {}})
        is None
    )


def test_links_out_of_a_folder_are_not_followed(evil: Path, tmp_path: Path, played: Played) -> None:
    (trace,) = (evil / "traces").iterdir()
    trace.rename(tmp_path / "elsewhere.npz")
    trace.symlink_to(tmp_path / "elsewhere.npz")
    with pytest.raises(ReportError, match="leads out of"):
        require_inside(evil, trace)
    assert require_inside(evil, evil / "report.md") == evil / "report.md"
    with pytest.raises(ReportError, match="leads out of"):
        require_inside(evil, evil / ".." / "run" / "pairs.jsonl")
    (evil / "pairs.jsonl.gz").rename(tmp_path / "pairs.jsonl.gz")
    (evil / "pairs.jsonl.gz").symlink_to(tmp_path / "pairs.jsonl.gz")
    with pytest.raises(ReportError, match="leads out of"):
        read_pairs(evil)


def test_films_are_not_written_through_a_link(
    evil: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "outside").mkdir()
    (evil / "films").symlink_to(tmp_path / "outside")
    _renamed(evil, substrate={"name": "tiny"})
    film = [
        "film",
        ".",
        "--select=all",
        f"--size={SIZE}",
        "--format=webp",
        f"--cases={tmp_path / 'tiny.json'}",
    ]
    assert main(film) == 1
    assert "leads out of" in capsys.readouterr().err
    assert list((tmp_path / "outside").iterdir()) == []


def test_a_report_does_not_write_through_a_link(tmp_path: Path) -> None:
    kept = tmp_path / "kept"
    kept.write_text("mine")
    for name in ("report.json", "report.json.partial"):
        (tmp_path / name).symlink_to(kept)
    write_text(tmp_path / "report.json", "theirs")
    assert kept.read_text() == "mine"
    assert (tmp_path / "report.json").read_text() == "theirs"


@pytest.mark.parametrize("headers", [{}, {"Range": "bytes=0-3"}])
def test_a_page_is_served_without_what_links_lead_to(tmp_path: Path, headers: dict[str, str]) -> None:
    folder, secret = tmp_path / "run", tmp_path / "secret"
    folder.mkdir()
    secret.write_text("secret")
    (folder / "open").write_text("open")
    (folder / "link").symlink_to(secret)
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(view._Files, directory=str(folder)))
    thread = Thread(target=server.serve_forever)
    thread.start()
    try:
        found = {}
        for name in ("open", "link", "../secret"):
            connection = HTTPConnection("127.0.0.1", server.server_port, timeout=10)
            connection.request("GET", f"/{name}", headers=headers)
            answer = connection.getresponse()
            found[name] = answer.status, b"secret" in answer.read()
            connection.close()
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
    assert found["open"][0] in (200, 206)
    assert found["link"] == found["../secret"] == (404, False)
