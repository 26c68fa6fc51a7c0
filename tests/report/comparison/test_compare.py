from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import pytest
from msgspec import structs

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.selection import Selection
from pytest_libero_max.errors import ReportError
from pytest_libero_max.report.comparison.compare import common_cases, compare_runs, read_runs
from pytest_libero_max.report.comparison.compare_files import comparison_html, comparison_markdown
from pytest_libero_max.report.comparison.comparison_document import Comparison
from pytest_libero_max.report.comparison.comparison_sections import (
    comparison_lines,
    comparison_warnings,
    short_lines,
)
from pytest_libero_max.report.gate_results import decide
from pytest_libero_max.report.gate_text import gate_lines, github_annotations
from pytest_libero_max.report.gates import parse_gates
from pytest_libero_max.report.stopping_rule import BIAS
from pytest_libero_max.runs.plan import PlannedPair
from pytest_libero_max.runs.replay_command import replay_command
from pytest_libero_max.runs.stopped import Stopped
from pytest_libero_max.runs.store import StoredRun
from tests.report import made_up
from tests.report.made_up import PROVENANCE, plain, plan, record_of, write_run
from tests.report.test_stopped_report import numbers_of_intervals

PAIRS = plan()


def run_of(
    outcomes: list[tuple[bool, bool]], pairs: list[PlannedPair] = PAIRS, **provenance: Json
) -> StoredRun:
    records = [record_of(pair, *outcome) for pair, outcome in zip(pairs, outcomes, strict=False)]
    return made_up.run_of(pairs, records, {**PROVENANCE, **provenance})


def with_policy(run: StoredRun, **spec: object) -> StoredRun:
    """The run, played by a policy of which something else is known."""
    records = (structs.replace(record, policy={**record.policy, **spec}) for record in run.records)
    return replace(run, records=tuple(records))


ALWAYS = [(True, True)] * 32
"""Everything succeeds."""

MIXED = [(True, True)] * 28 + [(True, False)] * 4
"""The last four planned pairs (two events of the second source) regress."""


def test_a_comparison_finds_the_flips_and_ranks_the_runs() -> None:
    comparison = compare_runs({"old": run_of(ALWAYS), "new": run_of(MIXED)})
    assert plain(comparison)["pairs"] == {
        "common": 32,
        "restricted": False,
        "left_out": {"old": [], "new": []},
        "unsupported": {"old": 0, "new": 0},
    }
    assert [(row["name"], row["rank"]) for row in plain(comparison)["runs"]] == [("old", 1.0), ("new", 2.0)]
    (contrast,) = plain(comparison)["contrasts"]
    assert (contrast["first_only"], contrast["second_only"]) == (4, 0)
    assert contrast["difference"]["value"] == -0.125
    assert contrast["p_value"] == 0.125
    flips = plain(comparison)["flips"]
    assert sorted(flip["case_id"] for flip in flips) == sorted(pair.case_id for pair in PAIRS[28:])
    assert flips[0]["outcomes"] == {"old": "preserved_success", "new": "regression"}
    assert plain(comparison)["runs"][1]["replay"][-1] == "-k"
    assert plain(comparison)["substrate"]["scores_comparable_with_published"] is False


def test_a_run_that_a_rule_stopped_has_no_interval_in_a_comparison() -> None:
    stop = Stopped("it is a regression", len(PAIRS), "first_regression", 30)
    runs = {"old": run_of(ALWAYS), "new": run_of(MIXED), "stopped": replace(run_of(MIXED[:30]), stopped=stop)}
    comparison = compare_runs(runs, restrict=True)
    *whole, stopped = plain(comparison)["runs"]
    assert [*numbers_of_intervals(stopped)] == []
    assert all([*numbers_of_intervals(run)] for run in whole)
    assert {run["highest_rank"] for run in [*whole, stopped]} == {None}
    families = [*(plain(comparison)[f"{name}contrasts"] for name in ("", "base_", "change_"))]
    families += [family for event in plain(comparison)["by_event"].values() for family in event.values()]
    for family in families:
        for contrast in family:
            of_stopped = "stopped" in (contrast["first"], contrast["second"])
            assert bool([*numbers_of_intervals(contrast)]) is not of_stopped
    two = {name: runs[name] for name in ("old", "stopped")}
    comparison = compare_runs(two, restrict=True)
    texts = [comparison_markdown(comparison), *comparison_lines(comparison), *short_lines(comparison)]
    texts.append(comparison_html(comparison))
    lines = [line for text in texts for line in text.splitlines()]
    rows = [line for line in lines if "stopped against old" in line]
    assert rows
    assert not any(re.search(r"\[[+-]\d", row) for row in rows)


def test_an_event_is_named_where_chance_does_not_explain_its_loss() -> None:
    lost = [(True, pair.event != "camera_shift") for pair in PAIRS]
    old, new = plain(compare_runs({"old": run_of(ALWAYS), "new": run_of(lost)}))["runs"]
    assert old["lowest_event"] == {"event": None, "value": 0.0, "by_chance": 0.0}
    assert new["lowest_event"]["event"] == "camera_shift"
    assert new["lowest_event"]["value"] == -1.0
    assert -0.5 < new["lowest_event"]["by_chance"] < -0.25
    one = [pair for pair in PAIRS if pair.event == "camera_shift"]
    failed = [(True, False)] * len(one)
    (only, _) = plain(compare_runs({"a": run_of(failed, one), "b": run_of(failed, one)}))["runs"]
    assert only["lowest_event"]["event"] is None, "one event is no lowest of several"


def test_arms_that_were_added_are_no_difference_of_what_is_compared() -> None:
    protocol = PROVENANCE["protocol"]
    added = run_of(ALWAYS, protocol={**protocol, "noise_floor": 4, "sham": 2})
    assert compare_runs({"old": run_of(ALWAYS), "new": added}).differences == []
    other = run_of(ALWAYS, protocol={**protocol, "prefix": "replay"})
    (difference,) = compare_runs({"old": run_of(ALWAYS), "new": other}).differences
    assert difference.field == "protocol.prefix"


def test_the_replay_command_plays_one_case_of_that_run() -> None:
    run = run_of(ALWAYS, policy={"reference": "a.py", "horizon": None, "query_interval": 2})
    assert replay_command(run) == [
        "pytest",
        "--libero-max-policy=a.py",
        "--libero-max-track=smoke",
        "--libero-max-substrate=embedded",
        "--libero-max-prefix=fork",
        "--libero-max-query-interval=2",
        "--libero-max-output=libero-max-replay",
        "-k",
    ]


@pytest.mark.parametrize(
    ("study", "option"),
    [
        ({"name": "cadence", "settings": "2,4"}, "--libero-max-study=cadence:2,4"),
        ({"name": "latency", "settings": "2,4sync"}, "--libero-max-study=latency:2,4sync"),
    ],
)
def test_the_replay_command_names_latency_and_settings(study: Json, option: str) -> None:
    protocol = {"prefix": "fork", "noise_floor": None, "latency": "4steps,sync", "study": study}
    command = replay_command(run_of(ALWAYS, protocol=protocol))
    assert "--libero-max-latency=4steps,sync" in command
    assert option in command


def test_the_replay_command_of_a_policy_behind_a_server_names_its_profile() -> None:
    policy = {
        "reference": "openpi://host:8000",
        "profile": "mine.toml",
        "horizon": None,
        "query_interval": None,
    }
    command = replay_command(run_of(ALWAYS, policy=policy))
    assert command[1:3] == ["--libero-max-policy=openpi://host:8000", "--libero-max-profile=mine.toml"]


def test_the_replay_command_of_a_genuine_run_names_all_that_it_played_on() -> None:
    run = run_of(
        ALWAYS,
        substrate={
            "name": "libero",
            "installations": ["LIBERO abc", "LIBERO-plus def"],
            "roots": ["/srv/LIBERO", "/srv/LIBERO-plus"],
            "assets": "/srv/assets",
            "semantics": "corrected",
            "instruction_source": "clean",
            "source_variations": "own",
        },
        case_set={"name": "manifest mine.json", "path": "/srv/mine.json", "digest": "0", "limit": 8},
        protocol={"prefix": "replay", "noise_floor": 4},
        selection=Selection.choose(["a"], 8, [], (2, 3)).to_dict(),
    )
    assert replay_command(run) == [
        "pytest",
        "--libero-max-policy=scripted.py",
        "--libero-max-manifest=/srv/mine.json",
        "--libero-max-substrate=libero:semantics=corrected,instruction=clean,variations=own",
        "--libero-max-libero=/srv/LIBERO",
        "--libero-max-libero=/srv/LIBERO-plus",
        "--libero-max-libero-assets=/srv/assets",
        "--libero-max-prefix=replay",
        "--libero-max-noise=floor:4",
        "--libero-max-limit=8",
        "--libero-max-shard=2/3",
        "--libero-max-output=libero-max-replay",
        "-k",
    ]


def test_runs_with_other_cases_are_refused_or_restricted() -> None:
    runs = {"old": run_of(ALWAYS), "new": run_of(MIXED[:30])}
    with pytest.raises(ReportError, match="2 of 'old', 2 of 'new'"):
        compare_runs(runs)
    comparison = compare_runs(runs, restrict=True)
    assert plain(comparison)["pairs"]["restricted"] is True
    assert plain(comparison)["pairs"]["common"] == 30
    assert plain(comparison)["pairs"]["left_out"]["new"] == sorted(pair.case_id for pair in PAIRS[30:])
    assert plain(comparison)["runs"][0]["dynamic_success"]["of"] == 30


def test_what_cannot_be_compared_says_why() -> None:
    with pytest.raises(ReportError, match="two or more"):
        common_cases({"old": run_of(ALWAYS)})
    with pytest.raises(ReportError, match="embedded and libero"):
        common_cases({"old": run_of(ALWAYS), "new": run_of(ALWAYS, substrate={"name": "libero"})})
    with pytest.raises(ReportError, match="in common"):
        common_cases({"old": run_of(ALWAYS, PAIRS[:4]), "new": run_of(ALWAYS, PAIRS[4:])}, restrict=True)
    other = [PlannedPair(**{**structs.asdict(pair), "case_digest": "0" * 64}) for pair in PAIRS]
    with pytest.raises(ReportError, match="manifests differ"):
        common_cases({"old": run_of(ALWAYS), "new": run_of(ALWAYS, other)})


@pytest.mark.parametrize(
    ("gate", "reason"),
    [
        (
            "delta.lower >= -25%",
            "failed, it is -29.0%. Not shown: the upper end, 2.8%, meets it, and so does the estimate, "
            "-12.5%; at these rates of losses and gains, four of five runs of 100 pairs show it.",
        ),
        (
            "dynamic_sr_vs(old).lower >= -20%",
            "failed, it is -29.0%. Not shown: the upper end, 2.8%, meets it, and so does the estimate, "
            "-12.5%; at these rates of losses and gains, four of five runs of 400 pairs show it.",
        ),
        (
            "delta.lower >= -10%",
            "failed, it is -29.0%. Not shown: the upper end, 2.8%, meets it, but the estimate, "
            "-12.5%, does not.",
        ),
        (
            "delta.upper >= 5%",
            "failed, it is 2.8%. Violated: the lower end, -29.0%, does not meet it either.",
        ),
    ],
)
def test_an_end_of_an_interval_that_fails_a_gate_violates_it_or_does_not_show_it(
    tmp_path: Path, gate: str, reason: str
) -> None:
    write_run(tmp_path / "old", run_of(ALWAYS))
    new = write_run(tmp_path / "new", run_of(MIXED))
    (result,) = decide(parse_gates([gate]), new, start=tmp_path)
    assert result.reason == f"{gate}: {reason}"


def test_a_failed_equivalence_is_violated_where_its_whole_interval_is_beyond_the_margin(
    tmp_path: Path,
) -> None:
    write_run(tmp_path / "old", run_of(ALWAYS))
    worse = write_run(tmp_path / "worse", run_of([(True, False)] * len(PAIRS)))
    (far,) = decide(parse_gates(["equivalent_vs(old, 5%)"]), worse, start=tmp_path)
    assert (far.finding, far.value) == ("violated", 1.0)
    same = write_run(tmp_path / "same", run_of(ALWAYS))
    (near,) = decide(parse_gates(["equivalent_vs(old, 5%)"]), same, start=tmp_path)
    assert near.finding == "not shown"
    assert near.not_shown


def test_gates_against_a_baseline_are_decided_on_its_folder(tmp_path: Path) -> None:
    write_run(tmp_path / "old", run_of(ALWAYS))
    new = write_run(tmp_path / "new", run_of(MIXED))
    gates = parse_gates(
        [
            "regressions_vs(old) <= 3",
            "regressions_vs(old/report.json) <= 4",
            "gains_vs(lost) >= 1",
            "base_sr == 1",
        ]
    )
    results = decide(gates, new, start=tmp_path)
    assert [result.verdict for result in results] == ["failed", "passed", "undecidable", "passed"]
    lines = gate_lines(results, ["pytest", "-k"])
    lost = results[0].lost
    assert len(lost) == 4
    assert lines[0] == f"gate FAIL  {results[0].reason}"
    assert lines[1] == f"  lost: {', '.join(lost[:3])} and 1 more"
    assert lines[-1] == f"  again: pytest -k {lost[0]}"
    assert lines[3] == f"gate open  {results[2].reason}"
    assert "no run in 'lost'" in results[2].detail
    annotations = github_annotations(results)
    assert len(annotations) == 2
    assert annotations[0] == f"::error title=LIBERO-MAX gate failed::{results[0].reason}"
    assert results[0].value == 4


def test_a_run_like_its_baseline_has_the_p_value_one(tmp_path: Path) -> None:
    write_run(tmp_path / "old", run_of(ALWAYS))
    new = write_run(tmp_path / "new", run_of(ALWAYS))
    results = decide(parse_gates(["p_value_vs(old) == 1", "dynamic_sr_vs(old).lower >= -15%"]), new, tmp_path)
    assert all(result.passed for result in results)


def test_a_baseline_of_other_cases_decides_nothing(tmp_path: Path) -> None:
    write_run(tmp_path / "old", run_of(ALWAYS[:31]))
    new = write_run(tmp_path / "new", run_of(ALWAYS))
    (result,) = decide(parse_gates(["regressions_vs(old) <= 3"]), new, start=tmp_path)
    assert result.verdict == "undecidable"
    assert "--restrict" in result.reason


def test_six_runs_give_fifteen_contrasts() -> None:
    runs = {f"policy {n}": run_of([(True, index % (n + 2) > 0) for index in range(32)]) for n in range(6)}
    comparison = compare_runs(runs)
    assert len(plain(comparison)["contrasts"]) == 15
    holm = [row["log10_p_value_holm"] for row in plain(comparison)["contrasts"]]
    single = [row["log10_p_value"] for row in plain(comparison)["contrasts"]]
    assert all(h >= p for h, p in zip(holm, single, strict=True) if p is not None)


def test_a_comparison_is_said_in_a_few_lines() -> None:
    runs = {"old": run_of(ALWAYS), "new": run_of(MIXED)}
    assert "\n".join(comparison_lines(compare_runs(runs))) == COMPARISON
    restricted = compare_runs({**runs, "new": run_of(MIXED[:30])}, restrict=True)
    said = "Restricted to 30 common cases; left out: 2 of old, 2 of new."
    assert f"WARNING: {said}" in comparison_lines(restricted)
    assert comparison_warnings(restricted) == [said]


def _texts(comparison: Comparison) -> list[str]:
    return [
        " ".join(comparison_lines(comparison)),
        " ".join(short_lines(comparison)),
        comparison_markdown(comparison),
        comparison_html(comparison),
    ]


def test_what_belongs_to_the_numbers_of_a_run_is_said_wherever_they_are_printed() -> None:
    nothing = [(False, False)] * 32
    noisy = with_policy(run_of(ALWAYS), repeatable=False)
    comparison = compare_runs({"fails": run_of(nothing), "noisy": noisy})
    fails, second = comparison.runs
    assert len(fails.warnings) == 1
    assert second.warnings == []
    assert [(caveat.name, caveat.pairs) for caveat in second.caveats] == [("not_repeatable", 32)]
    for text in _texts(comparison):
        assert f"fails: {fails.warnings[0]}" in text
    full = f"32 of 32 pairs of noisy: {second.caveats[0].text}"
    assert [full in text for text in _texts(comparison)] == [False, False, True, True]
    assert all("not_repeatable 32" in text for text in _texts(comparison)[:2])


def test_a_stopped_run_is_called_so_beside_its_numbers() -> None:
    stop = Stopped("losses and gains are not equally likely", 32, "anytime:0.05", 30)
    stopped = replace(run_of(MIXED[:30]), stopped=stop)
    comparison = compare_runs({"old": run_of(ALWAYS), "new": stopped}, restrict=True)
    for text in _texts(comparison):
        assert f"new: {stop.text}" in text
        assert f"new: {BIAS}" in text


COMPARISON = """\
old and new on 32 common cases
Scores on embedded scenes are not comparable with published ones.

Run  Rank  Possible ranks (95%)    Base  Dynamic         Change [95%]  95% by task  Lost
old     1                   1-2  100.0%   100.0%  +0.0 [-10.9, +10.9]          n/a  0/32
new     2                   1-2  100.0%    87.5%  -12.5 [-29.0, +2.8]          n/a  4/32

Dynamic success, contrasts
Second against first  Difference, pp            95%  95% by task  Holm p    Verdict
new against old                -12.5  [-29.0, +2.8]          n/a   0.125  powerless

Base success, contrasts
Second against first  Difference, pp             95%  95% by task  Holm p    Verdict
new against old                 +0.0  [-10.9, +10.9]          n/a   1.000  powerless

Paired change, contrasts
Second against first  Difference, pp             95%  95% by task  Holm p        Verdict
new against old                -12.5  [-36.4, +12.5]          n/a   0.125  uninformative
The test of a paired change assumes exchangeable runs. Its interval does not, so it may hold 0 where
p is small. Verdicts: significant, a difference is shown; bounded null, no difference is shown, and
5 points or more are excluded; uninformative, no difference is shown, and 5 points or more are
possible; powerless, too few pairs differ for any result to be significant.

Dynamic success by event, contrasts
Event                  Difference, pp  Simultaneous 95%  Holm p
illumination_switch              +0.0    [-76.4, +76.4]   1.000
camera_shift                     +0.0    [-76.4, +76.4]   1.000
visual_theme_switch              +0.0    [-76.4, +76.4]   1.000
sensor_noise_onset               +0.0    [-76.4, +76.4]   1.000
target_relocation                +0.0    [-76.4, +76.4]   1.000
receptacle_relocation            +0.0    [-76.4, +76.4]   1.000
distractor_burst                -50.0    [-97.7, +66.6]   1.000
obstacle_insertion              -50.0    [-97.7, +66.6]   1.000
Holm's correction and the simultaneous intervals cover all events and pairs of runs.

Paired change by event, contrasts
Event                  Difference, pp  Simultaneous 95%  Holm p
illumination_switch              +0.0  [-152.7, +152.7]   1.000
camera_shift                     +0.0  [-152.7, +152.7]   1.000
visual_theme_switch              +0.0  [-152.7, +152.7]   1.000
sensor_noise_onset               +0.0  [-152.7, +152.7]   1.000
target_relocation                +0.0  [-152.7, +152.7]   1.000
receptacle_relocation            +0.0  [-152.7, +152.7]   1.000
distractor_burst                -50.0  [-166.6, +142.1]   1.000
obstacle_insertion              -50.0  [-166.6, +142.1]   1.000
Holm's correction and the simultaneous intervals cover all events and pairs of runs.

Lowest paired change of an event
Run  Value, pp  By chance, pp            Event
old       +0.0           +0.0  none stands out
new      -50.0          -38.1  none stands out
Agreement of the event profiles: n/a, because no two runs have profiles that vary.

4 cases changed, (Base, Dynamic) in old, new:
(1,1) (1,0)  pro-spatial-t00-distractor_burst-v0
(1,1) (1,0)  pro-spatial-t00-distractor_burst-v1
(1,1) (1,0)  pro-spatial-t00-obstacle_insertion-v0
(1,1) (1,0)  pro-spatial-t00-obstacle_insertion-v1
To play one again, append its name to the command of a run:
  old: pytest --libero-max-policy=scripted.py --libero-max-track=smoke --libero-max-substrate=embedded --libero-max-prefix=fork --libero-max-output=libero-max-replay -k
  new: pytest --libero-max-policy=scripted.py --libero-max-track=smoke --libero-max-substrate=embedded --libero-max-prefix=fork --libero-max-output=libero-max-replay -k

The interval of a paired change is for these tasks, played again with other initial states and
seeds. The interval by task is for other tasks of the same kind; it needs 30 tasks, 15 of them with
a changed pair.
An interval shows how precisely these cases measure this policy. It does not cover how much the
policy would differ if it were trained again.
Policies differ in size, training data and serving at once. A difference between policies, or
between families of policies, does not show which architecture or design is more robust.
Success at the end of an episode and queries after the event are observable behaviour. They show
sensitivity to the event, not whether the policy detected it or planned anew."""  # noqa: E501


def test_folders_are_compared_under_their_names(tmp_path: Path) -> None:
    old, new = write_run(tmp_path / "old", run_of(ALWAYS)), write_run(tmp_path / "new", run_of(MIXED))
    comparison = compare_runs(read_runs([old, new / "pairs.jsonl"]))
    assert [run["name"] for run in plain(comparison)["runs"]] == [str(old), str(new / "pairs.jsonl")]
    assert len(plain(comparison)["flips"]) == 4
    with pytest.raises(ReportError, match="given twice"):
        compare_runs(read_runs([old, old]))


@pytest.mark.parametrize(("field", "value"), [("horizon", 16), ("query_interval", 4), ("repeatable", False)])
def test_policies_that_ask_in_other_ways_are_warned_of(field: str, value: object) -> None:
    run = run_of(ALWAYS)
    comparison = compare_runs({"old": run, "new": with_policy(run, **{field: value})})
    (difference,) = comparison.differences
    assert (difference.field, difference.values["new"]) == (f"policy.{field}", value)
    assert any(f"differ in policy.{field}: old " in line for line in comparison_lines(comparison))


def test_a_policy_that_plays_a_part_of_the_suites_is_said_to_do_so_everywhere() -> None:
    planned = [structs.replace(pair, suite="libero_goal") for pair in PAIRS[:12]] + PAIRS[12:]
    run = run_of(ALWAYS, planned)
    half = with_policy(run, suites=["libero_spatial"])
    runs = {"all": run, "half": replace(half, records=half.records[12:])}
    said = "Unsupported cases: 12 by half. Runs that do not support all cases have no rank."
    comparison = compare_runs(runs)
    assert f"WARNING: {said}" in comparison_lines(comparison)
    assert said in comparison_html(comparison, common_cases(runs))


def test_runs_that_differ_in_more_than_their_policy_are_warned_of() -> None:
    other = run_of(
        MIXED, substrate={**PROVENANCE["substrate"], "semantics": "corrected"}, versions={"mujoco": "3.4.0"}
    )
    runs = {"old": run_of(ALWAYS, versions={"mujoco": "3.3.7"}), "new": other}
    comparison = compare_runs(runs)
    assert plain(comparison)["differences"] == [
        {"field": "substrate.semantics", "values": {"old": None, "new": "corrected"}},
        {"field": "versions.mujoco", "values": {"old": "3.3.7", "new": "3.4.0"}},
    ]
    lines = comparison_lines(comparison)
    warnings = comparison_warnings(comparison)
    assert [len(warnings), "versions.mujoco: old 3.3.7, new 3.4.0." in warnings[1]] == [3, True]
    page = comparison_html(comparison, common_cases(runs))
    assert all(f"WARNING: {said}" in lines and said in page for said in warnings)
    assert not any("WARNING" in line for line in comparison_lines(compare_runs({"a": other, "b": other})))


def test_contrasts_are_of_base_dynamic_and_the_change_and_by_event() -> None:
    lost_base = [(False, False)] * 8 + MIXED[8:]
    comparison = compare_runs({"old": run_of(ALWAYS), "new": run_of(lost_base)})
    (dynamic,), (base,), (change,) = (
        plain(comparison)[key] for key in ("contrasts", "base_contrasts", "change_contrasts")
    )
    assert [row["difference"]["value"] for row in (dynamic, base, change)] == [-0.375, -0.25, -0.125]
    assert (change["second_lower"], change["second_higher"]) == (4, 0)
    assert change["log10_p_value"] == pytest.approx(math.log10(2 * 0.5**4))
    by_event = plain(comparison)["by_event"]
    assert sum(rows["dynamic_success"][0]["cases"] for rows in by_event.values()) == 32
    assert by_event["illumination_switch"]["dynamic_success"][0]["difference"]["value"] == -0.5
    assert by_event["obstacle_insertion"]["paired_change"][0]["difference"]["value"] == -0.5


def test_a_simultaneous_interval_is_as_wide_as_its_family_is_large() -> None:
    two = plain(compare_runs({"a": run_of(ALWAYS), "b": run_of(MIXED)}))["contrasts"][0]["difference"]
    assert two["simultaneous"] == {"lower": two["lower"], "upper": two["upper"]}
    three = plain(compare_runs({"a": run_of(ALWAYS), "b": run_of(MIXED), "c": run_of(ALWAYS)}))["contrasts"][
        0
    ]["difference"]
    assert three["lower"] == two["lower"]
    assert three["simultaneous"]["lower"] < three["lower"] < three["upper"] < three["simultaneous"]["upper"]


def test_many_runs_count_their_contrasts_by_event() -> None:
    runs = {name: run_of(outcomes) for name, outcomes in (("a", ALWAYS), ("b", MIXED), ("c", MIXED[::-1]))}
    lines = comparison_lines(compare_runs(runs))
    cells = [line.split() for line in lines]
    assert cells.count(["Event", "Contrasts", "with", "Holm", "p", "<", "0.05"]) == 2
    assert cells.count(["camera_shift", "0", "of", "3"]) == 2


def test_runs_that_were_drawn_by_other_renderers_are_named() -> None:
    run = run_of(ALWAYS)

    def drawn(**prints: str) -> StoredRun:
        records = (
            structs.replace(one, fingerprints={"substrate": "embedded", **prints}) for one in run.records
        )
        return replace(run, records=tuple(records))

    old, new = drawn(gl_device="software"), drawn(gl_renderer="llvmpipe", gl_version="4.5 Mesa 22.3.6")
    other = drawn(gl_renderer="llvmpipe", gl_version="4.5 Mesa 26.2.6")
    [difference] = plain(compare_runs({"old": old, "new": new, "other": other}))["differences"]
    assert difference == {
        "field": "renderers",
        "values": {
            "old": None,
            "new": "llvmpipe, OpenGL 4.5 Mesa 22.3.6",
            "other": "llvmpipe, OpenGL 4.5 Mesa 26.2.6",
        },
    }
    for pair in ({"old": old, "new": new}, {"one": new, "two": new}):
        assert plain(compare_runs(pair))["differences"] == []  # not recorded is not another one


def _with_scenes(*scenes: str) -> StoredRun:
    run = run_of(ALWAYS)
    prints = [{"scene": scene, "start": "1"} if scene else {"assets": "1"} for scene in scenes]
    prints += prints[-1:] * (len(run.records) - len(prints))
    records = zip(run.records, prints, strict=True)
    return replace(
        run, records=tuple(structs.replace(record, fingerprints=known) for record, known in records)
    )


def test_cases_that_were_played_in_other_scenes_are_counted_and_named() -> None:
    runs = {
        "old": _with_scenes("embedded/a/0 1", "embedded/a/1 1"),
        "same": _with_scenes("embedded/a/0 1", "embedded/a/1 1"),
        "new": _with_scenes("embedded/a/0 2", "embedded/a/1 1"),
        "code": _with_scenes(""),
    }
    [difference] = plain(compare_runs(runs))["differences"]
    assert difference == {
        "field": "scenes",
        "values": {
            "old": "recorded",
            "same": "recorded",
            "new": difference["values"]["new"],
            "code": None,
        },
    }
    assert re.findall(r"\d+ of \d+|'\w+'|embedded\S+", difference["values"]["new"]) == [
        "1 of 32",
        "'old'",
        "embedded/a/0",
    ]
    for name in ("same", "code"):
        assert plain(compare_runs({"one": runs[name], "two": runs[name]}))["differences"] == []
