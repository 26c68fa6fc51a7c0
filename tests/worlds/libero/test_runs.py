"""Whole runs of the plugin on genuine scenes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.worlds.libero.data import DATA, needs_package

POLICY = Path(__file__).with_name("reach.py")


def play(
    pytester: pytest.Pytester, output: str, *arguments: str
) -> tuple[pytest.RunResult, list[dict[str, object]]]:
    result = pytester.runpytest_subprocess(
        f"--libero-max-policy={POLICY}",
        "--libero-max-substrate=libero",
        f"--libero-max-libero-assets={DATA / 'assets'}",
        f"--libero-max-output={output}",
        "-p",
        "no:cacheprovider",
        *arguments,
    )
    path = pytester.path / output / "pairs.jsonl"
    lines = path.read_text().splitlines() if path.exists() else []
    records = [record for record in map(json.loads, lines) if "item_id" in record]
    for record in records:
        record.pop("timings", None)
    return result, sorted(records, key=lambda record: str(record.get("item_id")))


@needs_package
def test_fork_and_replay_give_the_same_records(pytester: pytest.Pytester) -> None:
    events = "camera_shift or sensor_noise_onset or target_relocation or distractor_burst"
    short = ("--libero-max-limit=8", "-n", "2", "-k", events)
    forked, records = play(pytester, "fork", *short)
    forked.stdout.fnmatch_lines(["libero-max: *substrate libero (hf-libero 0.1.4, published events)*"])
    forked.assert_outcomes(passed=4)
    replayed, again = play(pytester, "replay", "--libero-max-prefix=replay", *short)
    replayed.assert_outcomes(passed=4)
    assert len({record["event"] for record in records}) == 4
    assert all(record["trigger_step"] for record in records)
    assert records == again


@needs_package
def test_semantics_are_part_of_the_record_and_of_what_happens(pytester: pytest.Pytester) -> None:
    only = ("-k", "distractor_burst", "--libero-max-limit=8")
    _, [first] = play(pytester, "published", *only)
    _, [second] = play(pytester, "corrected", "--libero-max-semantics=corrected", *only)
    assert first["case_digest"] == second["case_digest"]
    assert first["fingerprints"]["semantics"] == "published"  # type: ignore[index]
    assert second["fingerprints"]["semantics"] == "corrected"  # type: ignore[index]
    assert first["evidence"] != second["evidence"]


def test_options_of_the_substrate_need_the_substrate(pytester: pytest.Pytester) -> None:
    result = pytester.runpytest_subprocess(
        f"--libero-max-policy={POLICY}", "--libero-max-semantics=corrected", "-p", "no:cacheprovider"
    )
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["*--libero-max-semantics is for the libero substrate*"])


def test_a_folder_without_libero_is_refused_before_anything_is_played(pytester: pytest.Pytester) -> None:
    result = pytester.runpytest_subprocess(
        f"--libero-max-policy={POLICY}",
        "--libero-max-substrate=libero",
        "--libero-max-libero=nowhere",
        "-p",
        "no:cacheprovider",
    )
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["*holds no LIBERO*"])
