"""Whole runs of the plugin on genuine scenes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.benchmark.tracks import track_path
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.substrates.embedded.catalogue.lookup import catalogue
from pytest_libero_max.substrates.libero.installation import Installation
from tests.short_episodes import short_episodes
from tests.substrates.libero.checkouts import SUITE, plus_checkout, pro_checkout
from tests.substrates.libero.data import DATA, needs_package
from tests.substrates.libero.made_up import case_of, manifest_of, pro_case

BUDGET = 80
"""Policy steps of an episode here; the events fire before."""

POLICY = Path(__file__).with_name("reach.py")


def play(
    pytester: pytest.Pytester, output: str, *arguments: str
) -> tuple[pytest.RunResult, list[dict[str, Any]]]:
    result = pytester.runpytest_subprocess(
        f"--libero-max-policy={POLICY}",
        "--libero-max-substrate=libero",
        f"--libero-max-libero-assets={DATA / 'assets'}",
        f"--libero-max-output={output}",
        "-p",
        "no:cacheprovider",
        *short_episodes(pytester, BUDGET),
        *arguments,
    )
    path = pytester.path / output / "pairs.jsonl"
    lines = path.read_text().splitlines() if path.exists() else []
    records = [record for record in map(json.loads, lines) if "item_id" in record]
    for record in records:
        del record["line"]
        if "timings" in record:
            record["timings"] = {}
    return result, sorted(records, key=lambda record: str(record.get("item_id")))


@needs_package
def test_fork_and_replay_give_the_same_records(pytester: pytest.Pytester) -> None:
    events = "camera_shift or sensor_noise_onset or target_relocation or distractor_burst"
    short = ("--libero-max-track=original", "--libero-max-limit=8", "-n", "2", "-k", events)
    forked, records = play(pytester, "fork", *short)
    forked.stdout.fnmatch_lines(["libero-max: *substrate libero (hf-libero 0.1.4, published events)*"])
    forked.assert_outcomes(passed=4)
    replayed, again = play(pytester, "replay", "--libero-max-prefix=replay", *short)
    replayed.assert_outcomes(passed=4)
    assert len({record["event"] for record in records}) == 4
    assert all(PairRecord.from_dict(record).triggered for record in records)
    assert records == again


@needs_package
def test_semantics_are_part_of_the_record_and_of_what_happens(pytester: pytest.Pytester) -> None:
    only = ("--libero-max-track=original", "-k", "distractor_burst", "--libero-max-limit=8")
    _, [first] = play(pytester, "published", *only)
    _, [second] = play(pytester, "corrected", "--libero-max-substrate=libero:semantics=corrected", *only)
    assert first["case_digest"] == second["case_digest"]
    assert first["fingerprints"]["semantics"] == "published"
    assert second["fingerprints"]["semantics"] == "corrected"
    assert PairRecord.from_dict(first).evidence != PairRecord.from_dict(second).evidence


@needs_package
def test_libero_plus_and_libero_pro_play_in_one_session(
    pytester: pytest.Pytester, installation: Installation, tmp_path: Path
) -> None:
    """Any worker plays any case: the installations take turns in each process."""
    plus = plus_checkout(installation, tmp_path / "plus")
    pro = pro_checkout(installation, tmp_path / "pro")
    manifest = manifest_of(
        tmp_path / "both.json",
        case_of(None, SUITE, 0),
        case_of("Background Textures", SUITE, 0),
        pro_case("task", SUITE, 0),
    )
    folders = [f"--libero-max-libero={root}" for root in (installation.root, plus.root, pro.root)]
    # Chosen by hand: the textures of that category are looked for, and this task of it needs none.
    chosen = ("-m", "libero_object", "-n", "2")
    result, records = play(pytester, "both", f"--libero-max-manifest={manifest}", *folders, *chosen)
    result.assert_outcomes(passed=3)
    result.stdout.fnmatch_lines(
        ["*substrate libero (hf-libero 0.1.4, LIBERO-Plus *, LIBERO-PRO *, published*"]
    )
    assert [record["source"] for record in records] == ["libero", "plus", "pro"]
    made_of = records[0]["fingerprints"]
    assert {"hf-libero", "LIBERO-Plus", "LIBERO-PRO"} <= set(made_of)


@needs_package
def test_own_variations_are_said_to_be_own(pytester: pytest.Pytester, tmp_path: Path) -> None:
    camera, background = (
        next(v for v in catalogue("plus") if (v.category, v.suite, v.base_index) == (category, SUITE, 0))
        for category in ("Camera Viewpoints", "Background Textures")
    )
    cases = [
        case_of(v.category, SUITE, v.index, task_name=v.name, substrate_difficulty=v.difficulty)
        for v in (camera, background)
    ]
    manifest = manifest_of(tmp_path / "own.json", *cases)
    own = (f"--libero-max-manifest={manifest}", "--libero-max-substrate=libero:variations=own")
    refused, _ = play(pytester, "refused", *own)
    assert refused.ret == pytest.ExitCode.USAGE_ERROR
    refused.stderr.fnmatch_lines(
        [
            "*1 of 2 cases of *own.json* cannot be played on substrate libero.",
            "1: Background Textures. They need scenes of their own, *at reset alone.",
            "*add --libero-max-only-installed to play the other 1,*",
        ]
    )
    chosen, _ = play(pytester, "chosen", *own, "-k", background.category.split()[0].lower())
    chosen.assert_outcomes(errors=1)
    chosen.stdout.fnmatch_lines(["*plus/libero_object/0000 needs a scene of its own (surfaces)*"])
    result, records = play(pytester, "own", *own, "--libero-max-only-installed")
    result.stdout.fnmatch_lines(["*published events, own source variations)*"])
    result.assert_outcomes(passed=1)
    [record] = [record for record in records if "fingerprints" in record]
    assert record["fingerprints"]["source_variations"] == "own"
    report = json.loads((pytester.path / "own" / "report.json").read_text())
    assert "own_variations" in [caveat["name"] for caveat in report["caveats"]]


def test_options_of_the_substrate_need_the_substrate(pytester: pytest.Pytester) -> None:
    result = pytester.runpytest_subprocess(
        f"--libero-max-policy={POLICY}",
        "--libero-max-substrate=embedded:semantics=corrected",
        "-p",
        "no:cacheprovider",
    )
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["*semantics is unknown. Known: images*"])


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


@needs_package
@pytest.mark.parametrize(
    ("case_set", "what", "lack", "of_object"),
    [
        ("--libero-max-track=lite", "track genuine/lite", 659, 16),
        (f"--libero-max-manifest={track_path('lite')}", "manifest lite.json.gz", 660, 17),
    ],
)
def test_libero_alone_refuses_a_case_set_with_its_variations(
    pytester: pytest.Pytester, case_set: str, what: str, lack: int, of_object: int
) -> None:
    result = pytester.runpytest_subprocess(
        "--libero-max-policy=noop",
        "--libero-max-substrate=libero",
        f"--libero-max-libero-assets={DATA / 'assets'}",
        case_set,
        "-p",
        "no:cacheprovider",
    )
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(
        [
            f"*{lack} of 800 cases of {what} cannot be played on substrate libero.",
            "560: LIBERO-Plus is not installed: `pip install *`.",
            f"{of_object}: object. Its objects are in LIBERO-PRO alone: `pip install *`.",
            f"Play --libero-max-track=original, which fits; * to play the other {800 - lack}, or choose *",
        ]
    )


@needs_package
def test_libero_alone_plays_the_original_track_by_default(pytester: pytest.Pytester) -> None:
    result = pytester.runpytest_subprocess(
        "--libero-max-policy=noop",
        "--libero-max-substrate=libero",
        f"--libero-max-libero-assets={DATA / 'assets'}",
        "--collect-only",
        "-p",
        "no:cacheprovider",
    )
    assert result.ret == pytest.ExitCode.OK
    result.stdout.fnmatch_lines(["libero-max: policy noop, track original (32 cases*"])
