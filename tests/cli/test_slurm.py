"""Jobs for Slurm: read by bash, and run here by a made-up Slurm or a real one."""

from __future__ import annotations

import json
import os
import re
import shutil
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pytest_libero_max.cli import main
from pytest_libero_max.cli.slurm import slurm_script
from pytest_libero_max.runs.merge import merge_folders
from pytest_libero_max.runs.store import read_pairs
from tests.plugin.conftest import BUDGET, REACHER, tiny_manifest
from tests.short_episodes import short_episodes
from tests.warm_processes import python_program

SBATCH = """#!/bin/bash
# A made-up sbatch: keeps the job and what it was called with; plays the shards when the merge is submitted.
printf '%s\\n' "$*" >> "$FAKE_SLURM/calls"
cat > "$FAKE_SLURM/job"
case "$*" in
--parsable*--array=1-2*)
    cp "$FAKE_SLURM/job" "$FAKE_SLURM/shard"
    echo "7;here"
    ;;
*)
    for index in $FAKE_INDICES; do
        export SLURM_ARRAY_TASK_ID=$index SLURM_ARRAY_TASK_MIN=1 SLURM_ARRAY_TASK_MAX=2
        export SLURM_ARRAY_TASK_STEP=1 SLURM_ARRAY_TASK_COUNT=2 SLURM_JOB_ID=$index
        bash "$FAKE_SLURM/shard" > "$FAKE_SLURM/log$index" 2>&1
        echo "$?" >> "$FAKE_SLURM/statuses"
    done
    bash "$FAKE_SLURM/job" > "$FAKE_SLURM/merged" 2>&1
    echo "$?" >> "$FAKE_SLURM/statuses"
    echo 8
    ;;
esac
"""


@pytest.fixture
def folder(tmp_path: Path, pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where runs are launched: an adapter and a manifest of four pairs, in a folder with an awkward name."""
    folder = tmp_path / "it's 100% here"
    folder.mkdir()
    (folder / "adapter.py").write_text(REACHER)
    events = ("camera_shift", "illumination_switch")
    (folder / "tiny.json").write_text(json.dumps(tiny_manifest(events=events)))
    pytester.syspathinsert()
    monkeypatch.setenv(
        "PYTEST_ADDOPTS", " ".join(["-p", "no:cacheprovider", *short_episodes(pytester, BUDGET)])
    )
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(pytester.path), os.environ.get("PYTHONPATH", "")]))
    monkeypatch.setattr(sys, "executable", python_program(tmp_path / "python"))
    monkeypatch.chdir(folder)
    return folder


PLAYED = ("--libero-max-policy=adapter.py", "--libero-max-manifest=tiny.json", "--libero-max-substrate=tiny")


@pytest.fixture
def slurm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A made-up Slurm in the path; returns where it keeps what it is told."""
    folder = tmp_path / "slurm"
    folder.mkdir()
    sbatch = folder / "sbatch"
    sbatch.write_text(SBATCH)
    sbatch.chmod(sbatch.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("FAKE_SLURM", str(folder))
    monkeypatch.setenv("FAKE_INDICES", "1 2")
    monkeypatch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")
    return folder


def test_the_script_is_one_that_bash_reads(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["-k", "a and $(touch pwned) `b` \\ \"'", "--libero-max-policy=my adapter's.py", "#x", "a;b", "!"]
    arguments = ["shards", "slurm", "--shards=64", "--at-once=8", "--workers=4", "--sbatch=--time=04:00:00"]
    before = "module load 'cuda 12'"
    assert main([*arguments, "--before", before, "--output", str(tmp_path / "50%'s"), "--", *words]) == 0
    script = capsys.readouterr().out
    subprocess.run(["bash", "-n"], input=script, text=True, check=True)
    jobs = re.findall(r"<<'END_OF_JOB'\n(.*?)END_OF_JOB\n", script, re.S)
    for job in jobs:
        subprocess.run(["bash", "-n"], input=job, text=True, check=True)
        assert f"\n{before}\n" in job
    assert len(jobs) == 2
    for words_of_sbatch in ("--array=1-64%8", "--cpus-per-task=4", "--time=04:00:00", "--requeue", "50%%"):
        assert words_of_sbatch in script
    line = next(line for line in jobs[0].splitlines() if " -m pytest " in line).removesuffix(" \\")
    shown = subprocess.run(
        ["bash"], input=f"printf '%s\\n' {line}", text=True, capture_output=True, check=True
    )
    assert shown.stdout.splitlines()[-len(words) :] == words


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["slurm", "--shards=2", "--", "--libero-max-shard=1/2"], "shard=1/2: each job gives that"),
        (["slurm", "--shards=2", "--", "-k", "a\nEND_OF_JOB"], "several lines"),
    ],
)
def test_what_cannot_be_launched_is_said(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["shards", *arguments]) == 1
    assert message in capsys.readouterr().err


def test_a_scheduler_that_is_not_here_is_said(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    assert main(["shards", "slurm", "--shards=2", "--submit", "--", "-q"]) == 1
    assert "Cannot run bash: " in capsys.readouterr().err


def test_shards_are_played_merged_and_gone_on_with(
    folder: Path, slurm: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    launch = ["shards", "slurm", "--shards=2", "--output=out", "--submit", "--", *PLAYED]
    monkeypatch.setenv("FAKE_INDICES", "2")
    assert main(launch) == 0
    assert "2 shards, and 8, which" in capfd.readouterr().out
    calls = (slurm / "calls").read_text().splitlines()
    assert f"--output={str(folder).replace('%', '%%')}/out/logs/%A_%a.log" in calls[0]
    assert "--dependency=afterany:7 " in calls[1]
    said = (slurm / "merged").read_text()
    assert f"Left out {folder}/out/shard-1: no run has begun there." in said
    assert "shard 1/2 not among" in said
    assert (slurm / "statuses").read_text().split() == ["0", "11"]
    assert len(read_pairs(folder / "out").records) == 2

    # The first shard follows; the second one goes on where it was, which is at its end.
    monkeypatch.setenv("FAKE_INDICES", "1 2")
    assert main(launch) == 0
    assert (slurm / "statuses").read_text().split() == ["0", "11", "0", "0", "0"]
    assert "2 measured before" in (slurm / "log2").read_text()
    whole = read_pairs(folder / "out")
    assert len(whole.records) == 4
    assert whole.run.provenance["selection"]["shards"] is None

    # A shard whose run was killed is left out, and kept.
    killed = folder / "out/shard-2"
    before = (killed / "pairs.jsonl").read_bytes()
    (killed / "in-progress").write_text("process 1 on another-machine\n")
    merge = ["shards", "merge", "--finished", "out/shard-1", "out/shard-2", "--output", "again"]
    assert main(merge) == 11
    assert "Left out out/shard-2:" in capfd.readouterr().out
    assert (killed / "pairs.jsonl").read_bytes() == before
    (killed / "in-progress").unlink()
    assert main(merge) == 0
    assert main(["shards", "merge", "--finished", "nowhere", "--output", "again"]) == 1
    assert "nothing to merge" in capfd.readouterr().err


@pytest.mark.skipif(
    shutil.which("sinfo") is None, reason="Slurm is not installed (slurm-client, slurmctld, slurmd)"
)
def test_a_real_slurm_plays_and_merges_shards(folder: Path) -> None:
    asked = subprocess.run(["sinfo", "--noheader"], capture_output=True, text=True, check=False)
    if asked.returncode or not asked.stdout:
        pytest.skip("Slurm is installed here, but no controller answers")
    script = slurm_script(PLAYED, 2, folder / "out")
    subprocess.run(["bash"], input=script, text=True, check=True)
    until = time.monotonic() + 240
    while not (folder / "out/report.json").exists() and time.monotonic() < until:
        time.sleep(0.5)
    assert len(read_pairs(folder / "out").records) == 4
    merge_folders([folder / "out/shard-1", folder / "out/shard-2"], folder / "again")
    assert read_pairs(folder / "again").run == read_pairs(folder / "out").run


BROKEN = """

class Broken(Reacher):
    queries = 0

    def predict(self, observation, query):
        type(self).queries += 1
        if self.queries == 1:
            raise ConnectionError("the model is not there")
        return super().predict(observation, query)


import os

policy = Broken if "BROKEN" in os.environ else Reacher
"""
"""Behind REACHER: with BROKEN in the environment, the first pair cannot be measured."""
