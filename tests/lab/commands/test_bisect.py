"""``libero-max lab bisect`` on a repository with a toy policy, and the search alone."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import pytest

from pytest_libero_max.cli import main
from pytest_libero_max.lab import bisection
from pytest_libero_max.lab.bisection import Verdict, first_bad
from pytest_libero_max.runs.store import read_pairs
from tests.plugin.conftest import BUDGET, tiny_manifest
from tests.short_episodes import short_episodes
from tests.warm_processes import SUBPROCESS

POLICY = """
import numpy as np
from pytest_libero_max import PolicySpec

STUCK = {stuck!r}  # suites in which the hand does not move


class Toy:
    spec = PolicySpec(name="toy", horizon=8, query_interval=4, cameras=(), image_size=64)

    def reset(self, episode):
        self.stuck = episode.suite in STUCK

    def predict(self, observation, query):
        way = (np.array([0.1, -0.1, 0.5]) - observation["robot0_eef_pos"]) / 0.05
        action = np.zeros(7)
        # Stuck from the event on, which happens at the third step.
        action[:3] = 0 if self.stuck and query.step >= 4 else np.clip(way, -1, 1)
        return np.tile(action, (8, 1))


policy = Toy
"""

EASY = """
import numpy as np
from pytest_libero_max.substrates.tiny.world import TinyWorld

TinyWorld.succeeded = lambda world: bool(
    np.linalg.norm(world.end_effector() - [0.1, -0.1, 0.5]) < 0.02
)
"""
"""A task that the toy policy can complete: the hand comes to where the box begins."""

SUITES = ("libero_object", "libero_spatial")
EVENTS = (
    "camera_shift",
    "illumination_switch",
    "sensor_noise_onset",
    "target_relocation",
    "distractor_burst",
)
PLAYED = ("adapter.py", "--libero-max-manifest=tiny.json", "--libero-max-substrate=tiny")


@pytest.fixture
def repository(tmp_path: Path, pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A repository whose policy is in a folder below; pytest's sessions play short episodes."""
    folder = tmp_path / "repository" / "policy"
    folder.mkdir(parents=True)
    (folder / "tiny.json").write_text(json.dumps(tiny_manifest(suites=SUITES, events=EVENTS)))
    pytester.makepyfile(easy=EASY)
    options = ["-p", "no:cacheprovider", *short_episodes(pytester, BUDGET), "-p", "easy"]
    monkeypatch.setenv("PYTEST_ADDOPTS", " ".join(options))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(pytester.path), os.environ.get("PYTHONPATH", "")]))
    for name in ("AUTHOR", "COMMITTER"):
        monkeypatch.setenv(f"GIT_{name}_NAME", "toy")
        monkeypatch.setenv(f"GIT_{name}_EMAIL", "toy@example.org")
    monkeypatch.chdir(folder)
    git("init", "--quiet")
    monkeypatch.setattr(bisection, "subprocess", SUBPROCESS)
    return folder


def git(*words: str) -> str:
    return subprocess.run(["git", *words], check=True, capture_output=True, text=True).stdout.strip()


def commit(folder: Path, text: str, subject: str) -> str:
    (folder / "adapter.py").write_text(text)
    (folder / "notes").write_text(subject)
    git("add", "adapter.py", "notes")
    git("commit", "--quiet", "-m", subject)
    return git("rev-parse", "HEAD")


def test_the_revision_that_broke_cases_is_found_with_a_part_of_the_pairs(
    repository: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    good = POLICY.format(stuck=())
    broken = POLICY.format(stuck=("libero_object",))
    texts = [good, broken, broken]
    names = [commit(repository, text, f"Change {number}") for number, text in enumerate(texts)]
    (repository / "adapter.py").write_text("raise RuntimeError('not committed')\n")
    command = ["lab", "bisect", "--good", names[0][:10], "--bad", "HEAD", "--", *PLAYED]

    assert main(command) == 0
    said = capsys.readouterr().out.splitlines()
    assert f"First bad revision: {names[1]} Change 1." in said
    rows = {line.split()[0]: line.split() for line in said if line[:12] in {name[:12] for name in names}}
    runs = repository / "libero-max-bisect"
    whole, some = (read_pairs(runs / names[number][:12]) for number in (0, 2))
    assert len(whole.records) == 4 * len(EVENTS)
    # Eight losses without a gain are enough to see that there is something to look for.
    assert some.stopped is not None
    assert "8 lost, 0 gained, p = 0.035" in some.stopped.reason
    lost = {record.case_id for record in some.records if not record.dynamic_success}
    assert {record.suite for record in some.records if record.case_id in lost} == {"libero_object"}
    assert json.loads((runs / "lost.json").read_text())["cases"].__len__() == len(lost)
    assert not list((runs / "trees").iterdir())
    assert rows[names[1][:12]][1:5] == [str(len(lost)), "0", "of", str(len(lost))]

    before = {path: path.stat().st_mtime_ns for path in runs.rglob("pairs.jsonl")}
    assert main(command) == 0
    again = capsys.readouterr()
    assert "playing" not in again.err
    assert again.out.splitlines()[-len(lost) - 1 :] == said[-len(lost) - 1 :]
    assert before == {path: path.stat().st_mtime_ns for path in runs.rglob("pairs.jsonl")}

    assert main([*command[:-3], "adapter.py", "--libero-max-track=smoke"]) == 1
    assert "bisect.json" in capsys.readouterr().err


def test_a_loss_that_is_not_shown_is_not_looked_for(
    repository: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = [f"step-{number}" for number in range(6)]
    seen = "import os\nassert os.environ['LIBERO_MAX_CHECKPOINT'] in __file__\n"
    for name in names:
        stuck = ("libero_object",) if name == "step-5" else ()
        (repository / f"{name}.py").write_text(seen + POLICY.format(stuck=stuck))
    command = ["lab", "bisect", "--checkpoints", *names, "--", "{}.py", *PLAYED[1:], "-k", "camera_shift"]
    assert main(command) == 10
    said = capsys.readouterr().out.splitlines()
    values = ("0.05", "step-5", "2 lost", "0 gained", "4 pairs", "0.75")
    assert [value for value in values if value not in said[0]] == []
    assert sorted(path.parent.name[:6] for path in repository.rglob("pairs.jsonl")) == ["step-0", "step-5"]


def test_what_cannot_be_bisected_is_refused_before_anything_plays(
    repository: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, last = (commit(repository, POLICY.format(stuck=()), name) for name in ("one", "two"))
    wrong = {
        ("--good", last, "--bad", first, "--", "adapter.py"): f"--good={last!r}",
        ("--good", first, "--", "adapter.py"): "--bad REV",
        ("--good", "nothing", "--bad", last, "--", "adapter.py"): "git rev-parse",
        ("--good", first, "--bad", last, "--", "/adapter.py"): "/adapter.py",
        ("--good", first, "--bad", last, "--", "adapter.py", "--libero-max-stop=errors"): "--libero-max-stop",
        ("--good", first, "--bad", last, "--level", "1", "--", "adapter.py"): "--level=1",
        ("--checkpoints", "a", "b", "a", "--", "{}.py"): "'a'",
        ("--checkpoints", "a", "b", "--good", "b", "--", "{}.py"): "--checkpoints",
    }
    for words, message in wrong.items():
        assert main(["lab", "bisect", *words]) == 1
        assert message in capsys.readouterr().err
    assert not (repository / "libero-max-bisect").exists()


@pytest.mark.parametrize("count", [2, 3, 6, 7, 33])
def test_the_first_bad_one_is_found_wherever_it_is(count: int) -> None:
    for bad in range(1, count):
        asked: list[int] = []

        def judge(number: int, bad: int = bad, asked: list[int] = asked) -> Verdict:
            asked.append(number)
            return "bad" if number >= bad else "good"

        assert first_bad(count, judge) == (bad - 1, bad)
        assert len(asked) == len(set(asked)) <= (count - 1).bit_length()


def test_revisions_that_cannot_be_played_are_left_between_the_ends() -> None:
    def judge(number: int) -> Verdict:
        return "cannot be played" if number in (3, 4) else "bad" if number >= 4 else "good"

    assert first_bad(8, judge) == (2, 5)
