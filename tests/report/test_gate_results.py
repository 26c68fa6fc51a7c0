"""Gates against another run: the settings in which it may not differ, and the run that is the first one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.selection import Selection
from pytest_libero_max.errors import OptionError
from pytest_libero_max.plugin.junit_file import gate_case
from pytest_libero_max.report.comparison.compare import compare_runs, read_runs
from pytest_libero_max.report.comparison.comparison_sections import comparison_warnings
from pytest_libero_max.report.gate_results import decide, require_usable
from pytest_libero_max.report.gate_text import gate_lines, gate_rows, github_annotations
from pytest_libero_max.report.gates import GateResult, parse_gate, parse_gates
from pytest_libero_max.report.stopping_rule import CompletedPrefix, parse_rule
from pytest_libero_max.runs.store import read_pairs
from tests.report.made_up import POLICY, PROVENANCE, plan, record_of, run_of, write_run

PAIRS = plan()
GATES = ("regressions_vs(old) <= 0", "dynamic_sr_vs(old) >= -5%", "equivalent_vs(old, 20%)")

DIFFERENT: dict[str, Json] = {
    "strength": {"protocol": {"prefix": "fork", "strength": 0.05}},
    "latency": {"protocol": {"prefix": "fork", "latency": "4steps"}},
    "prefix": {"protocol": {"prefix": "replay"}},
    "wrappers": {
        "spec": {"wrappers": ["restore=gated"]},
        "policy": {**PROVENANCE["policy"], "wrap": {"restore": "gated"}},
    },
    "query_interval": {"spec": {"query_interval": 2}},
    "horizon": {"spec": {"horizon": 20}},
    "repeatable": {"spec": {"repeatable": False}},
    "semantics": {"substrate": {**PROVENANCE["substrate"], "semantics": "corrected"}},
    "images": {"substrate": {"name": "embedded"}},
    "versions": {"versions": {"python": "3.12.0", "pytest-libero-max": "0.1.0"}},
    "case_set": {"case_set": {"name": "manifest mine.json", "digest": "1" * 64}},
    "renderers": {"drawn": {"gl_renderer": "radeon", "gl_version": "4.6"}},
    "scenes": {"drawn": {"scene": f"embedded/a/0 {'b' * 64}"}},
}
"""What is different, by the name that accepts it."""

PRINTS = {
    "substrate": "embedded",
    "gl_renderer": "llvmpipe",
    "gl_version": "4.5",
    "scene": f"embedded/a/0 {'a' * 64}",
}


def store(
    folder: Path,
    *,
    dynamic: bool = True,
    spec: Json | None = None,
    drawn: Json | None = None,
    played: int = 32,
    **provenance: Any,
) -> Path:
    policy, prints = {**POLICY, **(spec or {})}, {**PRINTS, **(drawn or {})}
    protocol = provenance.get("protocol", {})
    prints |= {name: str(protocol[name]) for name in ("strength", "latency") if name in protocol}
    records = (record_of(pair, True, dynamic, policy=policy, fingerprints=prints) for pair in PAIRS[:played])
    return write_run(folder, run_of(PAIRS, records, {**PROVENANCE, **provenance}))


def verdicts(folder: Path, *gates: str) -> list[GateResult]:
    return list(decide(parse_gates(gates), folder, folder.parent))


@pytest.mark.parametrize(("name", "different"), DIFFERENT.items(), ids=DIFFERENT)
def test_a_gate_is_open_exactly_where_a_comparison_warns(tmp_path: Path, name: str, different: Json) -> None:
    old, new = store(tmp_path / "old"), store(tmp_path / "new", **different)
    warned = compare_runs(read_runs([old, new])).differences
    assert warned
    for result in verdicts(new, *GATES):
        assert result.verdict == "undecidable"
        assert all(one.field.removeprefix("protocol.") in result.detail for one in warned)
        assert f"allow={name} behind the folder" in result.detail
    allowed = [gate.replace("old", f"old, allow={name}", 1) for gate in GATES]
    allowed[2] = f"equivalent_vs(old, 20%, allow={name})"
    for result in verdicts(new, *allowed):
        assert result.passed
        assert "Accepted: " in result.differences
        assert result.differences in result.reason
        assert result.differences in gate_lines([result])[0]
        assert result.differences in gate_rows([result])[0].why
    assert all(result.passed and not result.differences for result in verdicts(store(tmp_path / "a"), *GATES))


def test_another_setting_than_the_one_that_is_accepted_keeps_a_gate_open(tmp_path: Path) -> None:
    store(tmp_path / "old")
    new = store(tmp_path / "new", **DIFFERENT["strength"], **DIFFERENT["query_interval"])
    (result,) = verdicts(new, "regressions_vs(old, allow=strength) <= 0")
    assert result.verdict == "undecidable"
    assert "query_interval (5 there, 2 here)" in result.detail
    assert "allow=strength+query_interval" in result.detail
    (result,) = verdicts(new, "regressions_vs(old, allow=strength+query_interval) <= 0")
    assert result.passed
    assert "strength (1.0 there, 0.05 here)" in result.differences


def test_a_gate_names_the_files_in_which_policies_of_one_name_differ(tmp_path: Path) -> None:
    one, other = ({"w.npy": {"bytes": 4, "sha256": digit * 64}} for digit in "01")
    old, new = store(tmp_path / "old", spec={"files": one}), store(tmp_path / "new", spec={"files": other})
    for result in verdicts(new, *GATES):
        assert result.passed
        assert "file w.npy." in result.reason
    comparison = compare_runs(read_runs([old, new]))
    assert [one.field for one in comparison.policies] == ["policy.files.w.npy"]
    assert any("the file w.npy" in text for text in comparison_warnings(comparison))


def test_policies_that_differ_are_what_a_gate_compares(tmp_path: Path) -> None:
    policy = {"reference": "other.py", "horizon": None, "query_interval": None, "revision": "v2"}
    spec = {"name": "other", "revision": "v2", "cameras": [], "privileged": True}
    store(tmp_path / "old")
    new = store(tmp_path / "new", policy=policy, spec=spec)
    assert all(result.passed and not result.differences for result in verdicts(new, *GATES))


@pytest.mark.parametrize(
    ("gate", "words"),
    [
        ("regressions_vs(old, allow=strenght) <= 0", "Did you mean 'strength'?"),
        ("regressions_vs(old, alow=strength) <= 0", "unknown argument alow=strength"),
        ("regressions_vs(old, allow=) <= 0", "is no setting"),
        ("regressions_vs(old, first=fail) <= 0", "first=fail"),
        ("regressions_vs(old, 5%) <= 0", "unknown argument '5%'"),
        ("equivalent_vs(old, allow=strength)", "has no margin"),
        ("equivalent_vs(old, 5%, more)", "unknown argument 'more'"),
    ],
)
def test_arguments_that_are_spelled_wrong_are_refused(gate: str, words: str) -> None:
    with pytest.raises(OptionError) as caught:
        parse_gate(gate)
    assert words in str(caught.value)


def test_arguments_are_read_in_any_order_and_a_folder_may_have_quotes() -> None:
    gate = parse_gate("dynamic_sr_vs('a, b', first=pass, allow=strength+versions.numpy).lower >= -5%")
    assert (gate.run, gate.allow, gate.first, gate.end) == (
        "a, b",
        ("strength", "versions.numpy"),
        True,
        "lower",
    )
    gate = parse_gate('equivalent_vs("a", 5%, allow=latency, first=pass)')
    assert (gate.run, gate.allow, gate.first, gate.percent) == ("a", ("latency",), True, True)


# The first run.

FIRST = ("regressions_vs(none, first=pass) <= 0", "equivalent_vs(none, 20%, first=pass)")


@pytest.mark.parametrize("made", [False, True], ids=["missing", "empty"])
def test_a_first_run_passes_and_says_that_nothing_was_compared(tmp_path: Path, made: bool) -> None:
    new = store(tmp_path / "new")
    if made:
        (tmp_path / "none").mkdir()
    require_usable(parse_gates(FIRST), PAIRS, PAIRS, new, tmp_path)
    results = verdicts(new, *FIRST)
    for result in results:
        assert result.passed
        assert result.finding == "no baseline yet"
        assert gate_lines([result])[0].startswith("gate first ")
        assert gate_case(result.gate.text, result).outcome == "skipped"
        assert gate_rows([result])[0].finding == "no baseline yet"
    assert all(line.startswith("::notice title=") for line in github_annotations(results))


def test_a_first_run_without_first_is_refused(tmp_path: Path) -> None:
    new = store(tmp_path / "new")
    with pytest.raises(OptionError, match="cannot be read"):
        require_usable(parse_gates(["regressions_vs(none) <= 0"]), PAIRS, PAIRS, new, tmp_path)


def test_a_folder_that_has_lost_its_pairs_is_no_first_run(tmp_path: Path) -> None:
    old, new = store(tmp_path / "none"), store(tmp_path / "new")
    (old / "report.json").write_text("{}")
    (old / "pairs.jsonl").unlink()
    with pytest.raises(OptionError, match="cannot be read"):
        require_usable(parse_gates(FIRST), PAIRS, PAIRS, new, tmp_path)
    assert all(result.verdict == "undecidable" for result in verdicts(new, *FIRST))


@pytest.mark.parametrize("name", ["dangling", "old/pairs.jsonll", "file/deeper"])
def test_a_lost_link_and_a_name_below_a_run_or_a_file_are_no_first_run(tmp_path: Path, name: str) -> None:
    store(tmp_path / "old")
    (tmp_path / "dangling").symlink_to(tmp_path / "lost")
    (tmp_path / "file").touch()
    gates = parse_gates([f"regressions_vs({name}, first=pass) <= 0"])
    with pytest.raises(OptionError, match="cannot be read"):
        require_usable(gates, PAIRS, PAIRS, store(tmp_path / "new"), tmp_path)


@pytest.mark.parametrize(
    ("changes", "words"),
    [({"played": 31}, "31 of 32 planned pairs"), ({"dynamic": False}, "can never fail")],
    ids=["incomplete", "nothing to lose"],
)
def test_a_first_run_that_cannot_be_the_other_one_next_time_is_open(
    tmp_path: Path, changes: Json, words: str
) -> None:
    (result,) = verdicts(store(tmp_path / "new", **changes), FIRST[0])
    assert result.verdict == "undecidable"
    assert words in result.detail


# Shards, and rules that know another run.


def test_gates_of_a_shard_wait_for_all_of_them_wherever_they_are_asked_for(tmp_path: Path) -> None:
    selection = Selection.choose((pair.case_id for pair in PAIRS), 64, (), (1, 2))
    shard = store(tmp_path / "1", selection=selection.to_dict())
    (result,) = verdicts(shard, "dynamic_sr >= 50%")
    assert (result.verdict, result.waits) == ("undecidable", True)
    assert gate_lines([result])[0].startswith("gate wait")


def test_a_rule_that_knows_another_run_decides_nothing_on_a_different_one(tmp_path: Path) -> None:
    old = store(tmp_path / "old")
    other = store(tmp_path / "other", dynamic=False, **DIFFERENT["strength"])
    rule = parse_rule(f"worse_than:{old}").rule
    with pytest.raises(OptionError, match=r"strength \(1\.0 there, 0\.05 here\)"):
        rule.check_run(read_pairs(other).run)
    stops = {}
    for name, spec in (("alike", {}), ("faster", {"query_interval": 2})):
        run = read_pairs(store(tmp_path / name, dynamic=False, spec=spec))
        named = parse_rule(f"worse_than:{old}")
        named.rule.check_run(run.run)
        prefix = CompletedPrefix(named, run.run.planned, ())
        stops[name] = any(prefix.add(record.item_id, record) for record in run.records)
    assert stops == {"alike": True, "faster": False}
