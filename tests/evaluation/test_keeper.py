"""The keeper of a run believes no record that contradicts its case."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec import structs

from pytest_libero_max.errors import LiberoMaxError
from pytest_libero_max.evaluation.keeper import RunKeeper
from pytest_libero_max.evaluation.policy_source import GivenPolicy, PolicySource
from pytest_libero_max.evaluation.resolving import resolve
from pytest_libero_max.evaluation.run_cases import RunCases
from pytest_libero_max.evaluation.settings import OPTIONS
from pytest_libero_max.evaluation.stopping import Stop
from pytest_libero_max.pairing.record import PairError
from pytest_libero_max.policies.contract import PolicySpec
from pytest_libero_max.runs.store import read_pairs

PUBLISHED = Path(__file__).parents[2] / "reports" / "smoke" / "stale_expert"


@pytest.fixture
def keeper(tmp_path: Path) -> RunKeeper:
    values = {option.field: option.default for option in OPTIONS} | {"policy": "stale_expert"}
    settings = resolve(values, tmp_path)
    return RunKeeper(settings, RunCases(settings), PolicySource(settings), Stop(settings), tmp_path)


def test_a_live_pair_is_of_its_case_and_has_its_length(keeper: RunKeeper) -> None:
    record = read_pairs(PUBLISHED).records[0]
    assert keeper.checked(record) is record
    other = next(pair for pair in read_pairs(PUBLISHED).records if pair.event != record.event)
    forged = keeper.checked(structs.replace(record, arms=other.arms))
    assert isinstance(forged, PairError)
    longer = keeper.checked(structs.replace(record, max_steps=record.max_steps + 1))
    assert isinstance(longer, PairError)
    assert (longer.phase, longer.kind) == ("record", "ReportError")


def test_results_count_once_and_records_after_faults(keeper: RunKeeper, tmp_path: Path) -> None:
    planned = [*keeper.cases.values()][:2]
    keeper.plan(planned, keeper.selection(planned, ["by hand"]), ["pytest"], tmp_path)
    case = planned[0]
    assert keeper.expects(case.item_id, is_fault=True)
    keeper.add(PairError.of(case, LiberoMaxError("broken"), "setup"))
    assert keeper.expects(case.item_id, is_fault=False)
    assert not keeper.expects("no pair", is_fault=False)
    record = next(pair for pair in read_pairs(PUBLISHED).records if pair.case_id == case.case_id)
    assert keeper.checked(record) is record
    keeper.end()
    assert keeper.report is not None
    ending = keeper.ending()
    assert ending is not None
    assert ending[0] == 11


class _Remembers:
    spec = PolicySpec("remembers", horizon=8, query_interval=4, history=True)

    def reset(self, episode: object) -> None: ...

    def predict(self, observation: object, query: object) -> None: ...


def test_the_spec_of_a_given_policy_is_known_as_its_records_will_have_it(tmp_path: Path) -> None:
    values = {option.field: option.default for option in OPTIONS} | {"policy": "x", "query_interval": 2}
    settings = resolve(values, tmp_path)
    spec = GivenPolicy(settings, _Remembers()).spec()
    assert spec == {**_Remembers.spec.to_dict(), "query_interval": 2, "memory": "queries"}
    assert GivenPolicy(settings, _Remembers).spec() is None  # what it makes may have another
