from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.benchmark.cases import parse_case
from pytest_libero_max.benchmark.manifests import load_manifest, parse_manifest
from pytest_libero_max.benchmark.programs import (
    Program,
    find_program,
    load_program,
    parse_program,
    program_names,
    program_of_run,
)
from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.errors import ManifestError, OptionError

EVENT_THEN_BACK = [
    {"trigger": "event", "change": "event"},
    {"trigger": {"type": "steps_after", "steps": 5}, "reverts": 0},
]
TRANSIENT: dict[str, Any] = {"name": "transient", "arms": [{"name": "dynamic", "schedule": EVENT_THEN_BACK}]}


def with_program(**program: Any) -> dict[str, Any]:
    """The document of a manifest of one case with a program."""
    document = json.loads(load_track("smoke").to_json())
    document["cases"] = [{**document["cases"][0], "program": {**TRANSIENT, **program}}]
    return {**document, "manifest_format": 2}


def test_a_case_carries_its_program_and_is_named_after_it(tmp_path: Path) -> None:
    document = with_program()
    plain = load_track("smoke").cases[0]
    path = tmp_path / "transient.json"
    path.write_text(json.dumps(document, indent=2, sort_keys=True) + "\n")
    manifest = load_manifest(path)
    (case,) = manifest.cases
    assert case.program == Program("transient", tuple(TRANSIENT["arms"]))
    assert case.item_id == f"{plain.item_id}-transient"
    assert case.digest != plain.digest
    assert manifest.to_json() == path.read_text()
    assert parse_case(json.loads(json.dumps(case.record))) == case


def test_laid_over_a_case_it_gives_the_same_case() -> None:
    track = load_track("smoke")
    laid = track.playing(parse_program(TRANSIENT))
    assert laid.cases[0] == parse_manifest(with_program()).cases[0]
    assert laid.digest != track.digest
    with pytest.raises(ManifestError, match="program 'transient' already"):
        laid.playing(parse_program(TRANSIENT))


def test_a_manifest_says_that_it_needs_more_than_the_authors_format() -> None:
    document = with_program()
    del document["manifest_format"]
    with pytest.raises(ManifestError, match=r'a program, .* add "manifest_format": 2 beside'):
        parse_manifest(document)
    with pytest.raises(ManifestError, match="manifest_format=3, but this version"):
        parse_manifest({**document, "manifest_format": 3})


def test_a_later_trigger_needs_no_program() -> None:
    document = with_program()
    (case,) = document["cases"]
    del case["program"]
    case["scenario"]["trigger"] = {"type": "after_grasp", "value": "bowl_1"}
    (read,) = parse_manifest(document).cases
    assert (read.event.entity, read.event.trigger["type"]) == ("bowl_1", "after_grasp")
    case["scenario"]["trigger"] = {"type": "budget_fraction", "value": 0.5}
    with pytest.raises(ManifestError, match=r"scenario\.trigger\.value=0\.5, but"):
        parse_manifest(document)


def arm(**fields: Any) -> dict[str, Any]:
    return {"arms": [{"name": "late", "schedule": EVENT_THEN_BACK, **fields}]}


def entry(**fields: Any) -> dict[str, Any]:
    return arm(schedule=[{"trigger": "event", "change": "event", **fields}])


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"name": "Flash"}, r"program\.name='Flash', but must be lower-case letters"),
        ({"arms": []}, r"program\.arms=\[\], but must be a non-empty list of arms"),
        ({"arms": {}}, r"program\.arms={}, but must be a non-empty list"),
        ({"when": 3}, "program has the unknown field 'when'"),
        (arm(name="third-arm"), r"arms\[0\]\.name='third-arm', but must be"),
        (arm(name="base_again"), "'base_again' is the arm that --libero-max-noise=floor:PAIRS adds"),
        (arm(name="base"), "but nothing happens in Base"),
        (arm(name="dynamic", schedule=[]), "but something happens in Dynamic"),
        (arm(name="dynamic", repetition=1), "Base and Dynamic share their prefix"),
        ({"arms": [{"name": "late"}, {"name": "late"}]}, r"arms\[1\]\.name='late' of two arms"),
        (arm(repetition=-1), r"repetition=-1, but must be an integer of at least 0"),
        (arm(cadence={"query_interval": 0}), "query_interval=0 and horizon=0, but 1 <= Q <= H"),
        (arm(cadence={"query_interval": 4, "horizon": 2}), "but 1 <= Q <= H"),
        (arm(latency="200ms"), r"latency='200ms', but must be steps, for example 4steps"),
        (arm(name="dynamic", latency="4steps"), "Base and Dynamic share their prefix"),
        (arm(schedule={}), r"arms\[0\]\.schedule={}, but must be a list of entries"),
        (entry(trigger="evnt"), r"schedule\[0\]\.trigger must be a JSON object, not str"),
        (entry(trigger={"typ": "at_start"}), r"trigger\.type=None, but must be a non-empty string"),
        (entry(change={"operaton": "nothing"}), r"change\.operation=None, but must be"),
        (entry(reverts=0), "has the unknown field 'change'"),
        (entry(times=0), r"times=0, but must be an integer of at least 1"),
        ({"only": {"evnt": ["x"]}}, "only has the unknown field 'evnt'"),
        ({"without": {"suite": []}}, r"suite=\[\], but must be a non-empty list of patterns"),
        ({"only": {"event": ["camera_shift"]}}, "says which cases it fits, but not why. Add because"),
        (entry(strength=0), r"strength=0, but must be a number above 0, at most 1"),
        (entry(strength=True), "strength=True, but must be a number"),
    ],
)
def test_a_program_that_is_spelled_wrong_says_where(
    fields: dict[str, Any], message: str, tmp_path: Path
) -> None:
    with pytest.raises(ManifestError, match=message) as error:
        parse_manifest(with_program(**fields))
    assert str(error.value).startswith("case 'libero_10-")
    path = tmp_path / "program.json"
    path.write_text(json.dumps({**TRANSIENT, **fields}))
    with pytest.raises(OptionError, match=message) as refused:
        load_program(path)
    assert str(refused.value).startswith(f"{path}: program")


@pytest.mark.parametrize("content", [b"{", b"\xff", b'{"name": NaN}'])
def test_a_damaged_file_is_named(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "program.json"
    path.write_bytes(content)
    with pytest.raises(OptionError, match=r"program .*program\.json"):
        load_program(path)
    with pytest.raises(OptionError, match=r"program .*nowhere\.json"):
        load_program(tmp_path / "nowhere.json")


def test_a_run_says_which_program_it_played() -> None:
    program = parse_program(TRANSIENT)
    header = json.loads(json.dumps({"program": {**program.to_dict(), "digest": program.digest}}))
    assert program_of_run(header) == program
    assert program_of_run({}) is None


FITS = {"without": {"event": ["*_relocation"], "entity": ["*cabinet*"]}, "because": "Reasons."}


def test_a_program_is_laid_over_the_cases_that_it_fits_alone() -> None:
    track, program = load_track("lite"), parse_program({**TRANSIENT, **FITS})
    laid = track.playing(program)
    for before, after in zip(track, laid, strict=True):
        fits = "relocation" not in before.event.name and "cabinet" not in before.event.entity
        assert before.fits(program) == fits
        assert after == (before.playing(program) if fits else before)
    assert {case.event.name for case in laid if case.program is None} >= {"target_relocation"}
    nowhere = parse_program({**TRANSIENT, "only": {"suite": ["libero_90"]}, "because": "Reasons."})
    with pytest.raises(ManifestError, match=r"of 800 cases: Reasons\."):
        track.playing(nowhere)


def test_what_a_program_says_about_itself_is_no_part_of_what_is_played() -> None:
    plain, told = parse_program(TRANSIENT), parse_program({**TRANSIENT, **FITS, "about": "Words."})
    assert (plain, plain.digest, plain.to_dict()) == (told, told.digest, told.to_dict())


@pytest.mark.parametrize("name", program_names())
def test_a_program_of_the_package_is_called_like_its_file_and_says_what_it_plays(name: str) -> None:
    program = find_program(name)
    assert (program.name, program.source) == (name, name)
    assert program.about.endswith(".")
    assert bool(program.only or program.without) == program.because.endswith(".")


def test_a_program_is_found_by_name_or_by_path(tmp_path: Path) -> None:
    tmp_path.joinpath("mine.json").write_text(json.dumps(TRANSIENT))
    assert find_program("mine.json", tmp_path).source == str(tmp_path / "mine.json")
    with pytest.raises(OptionError, match=r"program='transent': .*'transient'"):
        find_program("transent", tmp_path)
    with pytest.raises(OptionError, match="Cannot read program"):
        find_program("transient.json", tmp_path)
