"""Studies and programs that a file spells: arms of another cadence, latency and policy, and their report."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from msgspec import structs

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.programs import parse_program
from pytest_libero_max.errors import AdapterError, ManifestError, OptionError, OtherRunError, ReportError
from pytest_libero_max.events.schedules import BASE, DYNAMIC, Arm, Cadence, arms_of
from pytest_libero_max.pairing.environment import ArmEnv
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.pairing.runner import PairSettings, measure_pair
from pytest_libero_max.policies.loading import installed_policy
from pytest_libero_max.report.document import Table
from pytest_libero_max.report.studies.study_results import study_of
from pytest_libero_max.report.studies.study_tables import study_tables
from pytest_libero_max.runs.agreement import Agreement
from pytest_libero_max.runs.plan import PlannedPair, Run
from pytest_libero_max.runs.replay_command import Places, replay_of
from pytest_libero_max.studies.registry import find_study, study_from_dict
from pytest_libero_max.substrates.tiny.world import TinyWorld
from tests.pairing.actors import BUDGET, Approaching, make_case
from tests.report.made_up import PROVENANCE

STUDY = """
name = "who_and_when"
title = "Who goes on"
track = "lite"
about = "The event at the start; and answers late, asked for more often, and from another policy."

[[arms]]
name = "reset"
schedule = [{ trigger = { type = "at_start" }, change = "event" }]

[[arms]]
name = "base_late"
latency = "2steps"

[[arms]]
name = "dynamic_late"
latency = "2steps"
schedule = [{ trigger = "event", change = "event" }]

[[arms]]
name = "base_often"
cadence = { query_interval = 2 }

[[arms]]
name = "dynamic_often"
cadence = { query_interval = 2 }
schedule = [{ trigger = "event", change = "event" }]

[[arms]]
name = "dynamic_other"
policy = "other"
schedule = [{ trigger = "event", change = "event" }]
"""
LABELS = [
    "approaching d=0 (0 ms) H=8 Q=2",
    "approaching d=0 (0 ms) H=8 Q=4 (own)",
    "approaching d=2 (100 ms) H=8 Q=4",
    "other after approaching d=0 (0 ms) H=6 Q=3",
]


@pytest.fixture(scope="module")
def world() -> Iterator[TinyWorld]:
    world = TinyWorld()
    yield world
    world.close()


@pytest.fixture(scope="module")
def header(tmp_path_factory: pytest.TempPathFactory) -> Json:
    """What the header of a run of the study says of it."""
    path = tmp_path_factory.mktemp("mine") / "mine.toml"
    path.write_text(STUDY)
    study = find_study("mine.toml", path.parent)
    assert (study.source, study.track) == (str(path), "lite")
    values: Json = json.loads(json.dumps(study.to_dict()))
    return values


@pytest.fixture(scope="module")
def record(world: TinyWorld, header: Json) -> PairRecord:
    """A case in all arms of the study."""
    case, policy = make_case(distance_m=0.25), Approaching(wait=2, horizon=8, interval=4)
    arms = (*arms_of(case), *study_from_dict(header).arms(case, policy.spec))
    how = PairSettings(policies={"other": Approaching(wait=0, horizon=6, interval=3)})
    return measure_pair(case, world, policy, how, arms=arms).record


def tables_of(protocol: Json, records: list[PairRecord]) -> dict[str, Table]:
    study = study_of(records, ["libero_spatial/0"] * len(records), protocol)
    assert study is not None
    return {table.title: table for table in study_tables(study)}


def test_a_file_spells_a_study_and_its_part_of_the_report(header: Json, record: PairRecord) -> None:
    assert header["name"] == "who-and-when"
    tables = tables_of({"study": header}, [record])
    rows = {row[0]: row for row in tables["Settings"].texts()}
    assert list(rows) == LABELS
    assert [row[0] for row in tables["Success by arm"].texts()] == ["base", "dynamic", "reset"]
    assert [*tables["Contrasts of arms"].head][1:] == ["reset - base", "dynamic - reset"]
    own, other = rows[LABELS[1]], rows[LABELS[3]]
    assert other[1] == own[1]  # it goes on from the same Base
    less_own = [one.title for one in tables["Settings"].head[1:]].index("Base less own") + 1
    assert [row[less_own] == "reference" for row in rows.values()] == [False, True, False, True]
    assert (own[less_own + 1], other[less_own + 1] == "reference") == ("reference", False)
    study = study_of([record], ["libero_spatial/0"], {"study": header})
    assert study is not None
    assert (study.title, study.about) == ("Who goes on", study_from_dict(header).program.about)  # type: ignore[union-attr]
    assert [setting.policy for setting in study.settings] == [None, None, None, "other"]
    compared = {part: {best.setting, *best.differences} for part, best in study.best.items()}
    labels = [label.removesuffix(" (own)") for label in LABELS]
    assert compared == {"base_success": {*labels[:3]}, "dynamic_success": {*labels}}  # one Base for two


def test_a_program_with_these_arms_is_reported_in_the_same_tables(header: Json, record: PairRecord) -> None:
    program = parse_program({key: header["document"][key] for key in ("name", "arms")})
    laid = tables_of({"program": {**program.to_dict(), "digest": program.digest}}, [record])
    studied = tables_of({"study": header}, [record])
    assert {title: table.texts() for title, table in laid.items()} == {
        title: table.texts() for title, table in studied.items()
    }
    from_records = [row[0] for row in tables_of({}, [record])["Success by arm"].texts()]
    assert from_records[-1] == "dynamic_other (policy approaching, H=6 Q=3)"
    assert "dynamic_late (d=2 (100 ms))" in from_records


def test_an_arm_with_a_policy_or_cadence_of_its_own_says_so_in_every_table(
    header: Json, record: PairRecord
) -> None:
    program = parse_program({key: header["document"][key] for key in ("name", "arms")})
    document = program.to_dict()
    for arm in document["arms"]:
        if arm["name"] in ("dynamic_other", "dynamic_often"):
            arm["schedule"] = [{"trigger": {"type": "at_start"}, "change": "event"}]  # no setting then
    tables = tables_of({"program": {**document, "digest": ""}}, [record])
    names = [row[0] for row in tables["Success by arm"].texts()]
    assert {"dynamic_often (Q=2)", "dynamic_other (policy other, H=6 Q=3)"} <= {*names}
    assert set(names) <= set(tables["Success by arm and event"].headings())
    contrasts = tables["Contrasts of arms"].headings()
    assert "dynamic_other (policy other, H=6 Q=3) - base" in contrasts


def test_a_default_that_is_spelled_out_changes_nothing(
    world: TinyWorld, header: Json, record: PairRecord
) -> None:
    document = json.loads(json.dumps(header["document"]))
    for arm in document["arms"]:
        own = {"query_interval": 3, "horizon": 6} if "policy" in arm else {"query_interval": 4}
        arm |= {"repetition": 0, "cadence": own, "schedule": []} | arm
        for entry in arm["schedule"]:
            entry |= {"strength": 1.0, "times": 1}
    spelled = {**header, "document": document}
    case, policy = make_case(distance_m=0.25), Approaching(wait=2, horizon=8, interval=4)
    arms = (*arms_of(case), *study_from_dict(spelled).arms(case, policy.spec))
    how = PairSettings(policies={"other": Approaching(wait=0, horizon=6, interval=3)})
    again = measure_pair(case, world, policy, how, arms=arms).record
    assert again.identity() == record.identity()
    assert tables_of({"study": spelled}, [again]) == tables_of({"study": header}, [record])


@pytest.mark.parametrize("prefix", ["fork", "replay"])
def test_another_policy_goes_on_from_the_state_that_the_event_finds(world: TinyWorld, prefix: Any) -> None:
    case, first = make_case(distance_m=0.25), Approaching(wait=3, horizon=8, interval=4)
    base, dynamic = arms_of(case)
    named = replace(dynamic, name="taken_over", policy="other")
    slower = replace(named, name="slower", cadence=Cadence(6))
    how = PairSettings(prefix, policies={"other": Approaching(wait=0, horizon=6, interval=3)})
    plain = measure_pair(case, world, first, PairSettings(prefix)).record
    pair = measure_pair(case, world, first, how, arms=(base, named, dynamic, slower))
    arms = pair.record.arms
    assert {name: arms[name] for name in (BASE, DYNAMIC)} == dict(plain.arms)
    event = arms[DYNAMIC].firings[0]
    for name, interval in (("taken_over", 3), ("slower", 6)):
        assert arms[name].firings[0].prefix_proof == event.prefix_proof
        assert arms[name].firings[0].evidence == event.evidence
        spec = arms[name].policy or {}
        assert (spec["reference"], spec["query_interval"]) == ("other", interval)
        asked = [query.step for query in pair.rollouts[name].queries if query.step >= event.step]
        assert asked == list(range(arms[name].response_step or 0, BUDGET, interval))
        assert arms[name].response_step == arms[DYNAMIC].response_step
        assert arms[name].stale_actions == arms[DYNAMIC].stale_actions != 0  # what is queued stays
    assert PairRecord.from_dict(json.loads(json.dumps(pair.record.to_dict()))) == pair.record
    assert how.policies["other"].spec.query_interval == 3


def test_what_cannot_go_on_is_refused(world: TinyWorld) -> None:
    case, policy = make_case(distance_m=0.25), Approaching()
    base, dynamic = arms_of(case)
    named = replace(dynamic, name="other", policy="other")
    with pytest.raises(AdapterError, match="among the policies"):
        measure_pair(case, world, policy, arms=(base, named))
    absolute = Approaching()
    absolute.spec = replace(absolute.spec, control="absolute")
    with pytest.raises(AdapterError, match="one control"):
        measure_pair(case, world, policy, PairSettings(policies={"other": absolute}), arms=(base, named))
    for arms in ((dynamic, named), (base, replace(named, schedule=()))):
        with pytest.raises(ManifestError, match="goes on where"):
            measure_pair(case, world, policy, PairSettings(policies={"other": absolute}), arms=arms)
    with pytest.raises(AdapterError, match="has a policy"):
        ArmEnv(case, world, named)
    with pytest.raises(AdapterError, match="name is installed"):
        installed_policy("os")  # a module, which data must not name


@pytest.mark.parametrize(
    ("arm", "message"),
    [
        (
            {"name": "a", "policy": "my/adapter.py", "schedule": [{"trigger": "event", "change": "event"}]},
            "no file",
        ),
        ({"name": "a", "policy": "expert"}, "an empty schedule"),
        (
            {"name": "dynamic", "policy": "expert", "schedule": [{"trigger": "event", "change": "event"}]},
            "share their prefix",
        ),
    ],
)
def test_a_policy_in_a_program_is_a_name(arm: Json, message: str) -> None:
    with pytest.raises(ManifestError, match=message):
        parse_program({"name": "mine", "arms": [arm]})


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ({"name": "mine", "arms": [{"name": "reset"}]}, "title"),
        ({"name": "mine", "title": "Mine", "arms": [{"name": "base"}]}, "beside Base and Dynamic"),
        ({"name": "mine", "title": "Mine", "arms": [{"name": "reset"}], "more": 1}, "more"),
    ],
)
def test_a_file_of_another_form_is_named(tmp_path: Path, document: Json, message: str) -> None:
    tmp_path.joinpath("mine.json").write_text(json.dumps(document))
    with pytest.raises(OptionError, match=message):
        find_study("mine.json", tmp_path)
    with pytest.raises(ReportError, match="this version knows"):
        study_from_dict({"name": "mine", "document": document})


def test_a_study_from_a_file_is_replayed_from_it(header: Json) -> None:
    provenance = {**PROVENANCE, "protocol": {"study": header}}
    assert "--libero-max-study=who-and-when.json" in replay_of(provenance, Places("expert"))
    assert "--libero-max-study=mine.toml" in replay_of(provenance, Places("expert", study="mine.toml"))


def test_pairs_whose_arms_were_played_by_other_policies_are_not_mixed(record: PairRecord) -> None:
    planned = [PlannedPair.of(make_case(case_id=name, distance_m=0.25)) for name in ("one", "two")]
    first, second = (
        structs.replace(record, case_id=pair.case_id, item_id=pair.item_id, case_digest=pair.case_digest)
        for pair in planned
    )
    agreement = Agreement(Run(tuple(planned), {**PROVENANCE, "policy": {}}))
    agreement.add(first, "first")
    arm = second.arms["dynamic_other"]
    changed = structs.replace(arm, policy={**(arm.policy or {}), "code": "another"})
    with pytest.raises(OtherRunError, match="Arm 'dynamic_other'"):
        agreement.add(structs.replace(second, arms={**second.arms, "dynamic_other": changed}), "second")


def test_a_name_alone_stands_for_a_study_of_the_package() -> None:
    assert find_study("event-timing").to_dict() == {"name": "event-timing"}
    case, spec = make_case(), Approaching(horizon=8, interval=4).spec
    assert all(isinstance(arm, Arm) for arm in find_study("event-timing").arms(case, spec))


def test_a_file_does_not_take_the_name_of_an_installed_study(tmp_path: Path) -> None:
    arm = {"name": "a", "schedule": [{"trigger": "event", "change": "event"}]}
    (tmp_path / "mine.json").write_text(json.dumps({"name": "event_timing", "title": "Mine", "arms": [arm]}))
    with pytest.raises(OptionError, match="'event-timing', as one"):
        find_study("mine.json", tmp_path)
