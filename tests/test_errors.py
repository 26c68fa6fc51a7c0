from __future__ import annotations

import difflib
import json
import pickle
from pathlib import Path

import pytest

from pytest_libero_max import load_manifest, load_policy, load_track, parse_gate
from pytest_libero_max.errors import (
    CLOSEST,
    MOST_NAMED,
    AdapterError,
    LiberoMaxError,
    ManifestError,
    OptionError,
    ServerError,
    did_you_mean,
)
from pytest_libero_max.policies.profile import load_profile


def test_an_error_carries_its_data_through_a_pickle() -> None:
    error = pickle.loads(
        pickle.dumps(ManifestError("a.json: n=0.", field="n", value=[0], path="a.json", line=3))
    )
    assert type(error) is ManifestError
    assert (str(error), error.field, error.value) == ("a.json: n=0.", "n", [0])
    assert (error.path, error.line) == (Path("a.json"), 3)


def test_a_value_without_a_pickle_arrives_as_text() -> None:
    error = LiberoMaxError("a generator", value=(_ for _ in ()))
    assert "generator" in pickle.loads(pickle.dumps(error)).value
    assert "generator" in repr(error.value)


def test_a_place_is_put_before_an_error_and_what_is_known_is_kept() -> None:
    inner = ManifestError("n=0, but must be at least 1.", field="n", value=0)
    outer = inner.within("a.json, line 2", field="cases[0]", path="a.json", line=2)
    assert type(outer) is ManifestError
    assert str(outer) == f"a.json, line 2: {inner}"
    assert (outer.field, outer.value, outer.path, outer.line) == ("n", 0, Path("a.json"), 2)
    assert LiberoMaxError().args == ("",)


def test_the_kinds_of_errors_carry_data_in_the_same_way(tmp_path: Path) -> None:
    for kind in (*_kinds(LiberoMaxError),):
        assert pickle.loads(pickle.dumps(kind("text", path=tmp_path))).path == tmp_path, kind
    assert ServerError in {*_kinds(LiberoMaxError)}


def _kinds(kind: type[LiberoMaxError]) -> list[type[LiberoMaxError]]:
    return [kind, *(below for child in kind.__subclasses__() for below in _kinds(child))]


def test_a_few_known_words_are_all_named() -> None:
    assert did_you_mean("frok", ["replay", "fork"]) == "Did you mean 'fork'? Known: fork, replay."
    assert did_you_mean("nothing like it", ["replay", "fork"]) == "Known: fork, replay."
    assert did_you_mean("anything", []) == ""


def test_of_many_known_words_the_closest_are_named() -> None:
    many = [f"libero-spatial-t{task:02}-i{init:02}" for task in range(100) for init in range(80)]
    hint = did_you_mean("libero-spatal-t03-i07", many)
    assert "mean 'libero-spatial-t03-i07'? Also close: libero-spatial-t" in hint
    assert "8000 in all" in hint
    assert hint.count("libero-spatial") == CLOSEST


def test_of_many_words_that_are_not_close_a_few_are_named() -> None:
    many = [f"word-{number:03}" for number in range(MOST_NAMED + 1)]
    hint = did_you_mean("?", many)
    assert hint.endswith(f"{len(many)} in all, for example word-000, word-001, word-002, word-003.")


def test_a_word_that_is_too_long_to_be_close_is_not_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    longest = "fork" + 8 * "x"
    assert "mean 'fork'?" in did_you_mean(longest, ["fork"])
    assert not difflib.get_close_matches(f"{longest}x", ["fork"], cutoff=0.5)
    monkeypatch.delattr(difflib, "get_close_matches")
    assert did_you_mean(f"{longest}x", ["fork"]) == "Known: fork."


def test_errors_of_what_people_write_carry_what_was_seen(tmp_path: Path) -> None:
    manifest = tmp_path / "cases.json"
    manifest.write_text('{"benchmark_id": "x",\n "cases": }')
    with pytest.raises(ManifestError) as damaged:
        load_manifest(manifest)
    assert (damaged.value.path, damaged.value.line) == (manifest, 2)
    record = json.loads(load_track("smoke").to_json())
    record["cases"][0]["scenario"]["severity"] = "huge"
    manifest.write_text(json.dumps(record))
    with pytest.raises(ManifestError) as wrong:
        load_manifest(manifest)
    assert wrong.value.path == manifest
    assert (wrong.value.field, wrong.value.value) == ("scenario.severity", "huge")

    profile = tmp_path / "mine.toml"
    profile.write_text('extends = "pi05_libero"\n[policy]\nhorizn = 3\n')
    with pytest.raises(AdapterError) as unknown:
        load_profile(str(profile))
    assert (unknown.value.field, unknown.value.value, unknown.value.path) == ("policy.horizn", 3, profile)

    with pytest.raises(OptionError) as gate:
        parse_gate("dynamic_sr > much")
    assert (gate.value.field, gate.value.value) == ("gate", "dynamic_sr > much")
    with pytest.raises(AdapterError) as policy:
        load_policy("no_such_adapter.py")
    assert (policy.value.field, policy.value.value) == ("policy", "no_such_adapter.py")
