"""Probes: what they may and may not do, and that nothing of a pair depends on them."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from pytest_libero_max.errors import AdapterError, OptionError, ProbeError
from pytest_libero_max.events.schedules import arms_of
from pytest_libero_max.pairing.probes.probe import Column, Probe, Probes, View, check_probe
from pytest_libero_max.pairing.probes.registry import PROBES, probes_called
from pytest_libero_max.pairing.probes.standard import STANDARD
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.pairing.rollout import Rollout
from pytest_libero_max.pairing.runner import Pair, PairSettings, measure_pair
from pytest_libero_max.pairing.stage import Stage
from pytest_libero_max.registry import Registry
from pytest_libero_max.substrates.tiny.world import TinyWorld
from pytest_libero_max.worlds.contract import on_mujoco

from .actors import Approaching, make_case

COUNT = (Column("number", "int", "a number"),)


class Counting(Probe[int]):
    """Number of the steps it was asked after, and what it saw of them."""

    name = "counting"
    schema = (
        *COUNT,
        Column("last_queue", "int", "actions queued after the last step"),
        Column("reached_m", "float", "height of the hand at the end", "m"),
    )
    cost = "nothing"

    def start(self, view: View) -> int:
        assert not view.trajectory.executed
        return 0

    def step(self, state: int, view: View) -> int:
        assert view.trajectory.step == state + 1
        last = view.trajectory.executed[-1]
        assert last.end_effector.tobytes() == view.world.end_effector().tobytes()
        return state + 1

    def columns(self, state: int, view: View) -> Mapping[str, Any]:
        hand = view.world.end_effector()
        return {"number": np.int64(state), "last_queue": len(view.trajectory.pending), "reached_m": hand[2]}


class Queries(Probe[tuple[int, ...]]):
    """Steps at which the policy was asked, as a query probe sees them."""

    name = "queries"
    schema = (Column("steps", "int", "steps before each query", many=True),)
    cost = "nothing"
    every = "query"

    def start(self, view: View) -> tuple[int, ...]:
        return ()

    def step(self, state: tuple[int, ...], view: View) -> tuple[int, ...]:
        assert view.trajectory.just_asked
        return (*state, view.trajectory.queries[-1].step)

    def columns(self, state: tuple[int, ...], view: View) -> Mapping[str, Any]:
        return {"steps": state}


class Breaking(Probe[Any]):
    """Does something that a probe must not do."""

    name = "breaking"
    schema: ClassVar[tuple[Column, ...]] = COUNT
    cost = "nothing"

    def columns(self, state: Any, view: View) -> Mapping[str, Any]:
        return {"number": 1}


NAMES = [name for name in PROBES if name not in ("first_goal", "motion")]
"""Some that can be asked for, those of installed packages among them."""

ALL = Probes(
    STANDARD.standard,
    (Counting(), Queries(), *(PROBES[name] for name in NAMES)),
)


@pytest.fixture
def world() -> Iterator[TinyWorld]:
    world = TinyWorld()
    yield world
    world.close()


def played(world: TinyWorld, probes: Probes, mode: Any = "fork", repeat: bool = False) -> Pair:
    case = make_case("target_relocation")
    policy = Approaching(wait=2, horizon=5, interval=4)
    pair = measure_pair(case, world, policy, PairSettings(mode, probes=probes), arms=arms_of(case, repeat))
    assert pair.record.triggered
    return pair


@pytest.mark.parametrize("mode", ["fork", "replay"])
def test_nothing_of_a_pair_depends_on_the_probes(world: TinyWorld, mode: str) -> None:
    plain, probed = (played(world, probes, mode, repeat=True) for probes in (STANDARD, ALL))
    for name, rollout in plain.rollouts.items():
        other = probed.rollouts[name]
        assert rollout.proof == other.proof
        assert rollout.success == other.success
        assert rollout.actions.tobytes() == other.actions.tobytes()
        assert {probe: other.probes[probe] for probe in rollout.probes} == rollout.probes
    assert without_probes(plain) == without_probes(probed)


def without_probes(pair: Pair) -> dict[str, Any]:
    identity = pair.record.identity()
    for arm in identity["arms"].values():
        arm.pop("probes", None)
    return identity


def test_a_rollout_without_any_probe_has_the_same_proof(world: TinyWorld) -> None:
    policy = Approaching(wait=2, horizon=5, interval=4)
    proofs = {
        Rollout.start(Stage(make_case(), world, policy, probes=probes)).advance_to_end().proof
        for probes in (Probes(), STANDARD, ALL)
    }
    assert len(proofs) == 1


def test_what_a_probe_saw_forks_with_the_arms_and_is_the_same_in_a_replay(world: TinyWorld) -> None:
    pairs = [played(world, ALL, mode) for mode in ("fork", "replay")]
    assert pairs[0].rollouts.keys() == pairs[1].rollouts.keys()
    for pair in pairs:
        for rollout in pair.rollouts.values():
            assert rollout.probes["counting"]["number"] == rollout.steps
            assert rollout.probes["queries"]["steps"] == [query.step for query in rollout.queries]
            assert rollout.probes["counting"]["last_queue"] == rollout.trajectory.queued
    assert [rollout.probes for rollout in pairs[0].rollouts.values()] == [
        rollout.probes for rollout in pairs[1].rollouts.values()
    ]


def test_the_probes_of_every_pair_are_the_records_own_fields(world: TinyWorld) -> None:
    pair = played(world, ALL)
    for name, arm in pair.record.arms.items():
        seen, rollout = pair.rollouts[name].probes, pair.rollouts[name]
        distances = np.linalg.norm(rollout.end_effector - rollout.entity, axis=1)
        assert arm.min_distance_m == seen["approach"]["min_distance_m"] == pytest.approx(distances.min())
        assert arm.clipped_components == seen["clipping"]["clipped_components"] == 0
        assert list(arm.contacts or ()) == seen["contacts"]["contacts"]
        assert arm.response_step == seen["response"]["response_step"]
        assert arm.stale_actions == seen["response"]["stale_actions"]


def test_contacts_over_time_end_with_the_contacts_at_the_end(world: TinyWorld) -> None:
    pair = played(world, ALL)
    for rollout in pair.rollouts.values():
        timeline = rollout.probes["contact_timeline"]
        steps, touching = timeline["step"], timeline["touching"]
        assert isinstance(steps, list)
        assert isinstance(touching, list)
        assert steps[0] == 0
        assert (np.diff(np.array(steps, dtype=int)) > 0).all()
        assert str(touching[-1]).split() == rollout.probes["contacts"]["contacts"]


def test_a_record_keeps_the_columns_of_the_probes_that_were_asked_for(world: TinyWorld) -> None:
    record = played(world, ALL).record
    for name, arm in record.arms.items():
        assert list(arm.probes) == ["stages", "counting", "queries", *NAMES]
        assert arm.probes["counting"]["number"] == arm.steps, name
    assert PairRecord.from_dict(json.loads(json.dumps(record.to_dict()))) == record
    assert list(played(world, STANDARD).record.to_dict()["arms"]["base"]["probes"]) == ["stages"]


# What a probe may not do.


@pytest.mark.parametrize("where", ["start", "step", "columns"])
def test_a_probe_that_writes_to_the_world_is_found_and_named(world: TinyWorld, where: str) -> None:
    class Writing(Breaking):
        def start(self, view: View) -> None:
            self.write(view, "start")

        def step(self, state: Any, view: View) -> None:
            self.write(view, "step")

        def columns(self, state: Any, view: View) -> Mapping[str, Any]:
            self.write(view, "columns")
            return {"number": 1}

        def write(self, view: View, now: str) -> None:
            if now == where:
                on_mujoco(view.world).data.qpos[0] += 1e-9

    message = f"probe 'breaking' altered the world in {'step 1' if where == 'step' else where}, "
    with pytest.raises(ProbeError, match=message):
        played(world, Probes(STANDARD.standard, (Counting(), Writing())))
    baseline = played(world, STANDARD).record.identity()
    assert played(world, STANDARD).record.identity() == baseline


def test_a_probe_that_writes_to_a_fixed_field_is_named_and_the_field_put_back(world: TinyWorld) -> None:
    class Writing(Breaking):
        def step(self, state: Any, view: View) -> None:
            if view.trajectory.step == 3:
                on_mujoco(view.world).model.opt.gravity[2] = -1.0

    with pytest.raises(ProbeError, match=r"'breaking' wrote opt\.gravity.*Repair"):
        played(world, Probes(STANDARD.standard, (Writing(),)))
    assert world.model.opt.gravity[2] == pytest.approx(-9.81)
    with pytest.raises(ProbeError, match=r"'counting' .*'breaking' wrote opt\.gravity"):
        played(world, Probes(STANDARD.standard, (Counting(), Writing())))


def test_what_a_probe_is_shown_cannot_be_written_to(world: TinyWorld) -> None:
    class Writing(Breaking):
        def step(self, state: Any, view: View) -> None:
            view.trajectory.pending[:] = 0.0

    with pytest.raises(ProbeError, match=r"'breaking' .*ValueError in step 1: .*read-only"):
        played(world, Probes(STANDARD.standard, (Writing(),)))


def test_a_state_that_arms_could_not_share_is_refused(world: TinyWorld) -> None:
    class Collecting(Breaking):
        def start(self, view: View) -> list[int]:
            return []

    with pytest.raises(ProbeError, match=r"'breaking' .*type list"):
        played(world, Probes(STANDARD.standard, (Collecting(),)))

    class Later(Breaking):
        def step(self, state: Any, view: View) -> list[int]:
            return []

    with pytest.raises(ProbeError, match=r"'breaking' .*type list"):
        played(world, Probes(STANDARD.standard, (Later(),)))


@pytest.mark.parametrize(
    ("yielded", "message"),
    [
        ({"other": 1}, r"yields the columns \['other'\], but declares \['number'\]"),
        ({"number": "1"}, r"number='1', but must be int"),
        ({"number": True}, r"number=True, but must be int"),
        ({"number": None}, r"number=None, but must be int"),
    ],
)
def test_columns_are_what_the_probe_declares(world: TinyWorld, yielded: Any, message: str) -> None:
    class Lying(Breaking):
        def columns(self, state: Any, view: View) -> Mapping[str, Any]:
            return dict(yielded)

    with pytest.raises(ProbeError, match=message):
        played(world, Probes(STANDARD.standard, (Lying(),)))


def test_columns_that_belong_together_have_as_many_values(world: TinyWorld) -> None:
    class Uneven(Breaking):
        schema = (
            Column("step", "int", "steps", many=True),
            Column("score", "float", "scores", many=True, along="step"),
        )

        def columns(self, state: Any, view: View) -> Mapping[str, Any]:
            return {"step": [1, 2], "score": [0.5]}

    with pytest.raises(ProbeError, match=r"score .*1 .*2 of step"):
        played(world, Probes(STANDARD.standard, (Uneven(),)))


def test_columns_keep_their_least_value_and_what_a_record_can_hold() -> None:
    count = Column("x", "int", "a number", least=0)
    assert count.checked(0) == 0
    for value in (-1, 2**63):
        with pytest.raises(ValueError, match=f"x={value}, .*int, at least 0"):
            count.checked(value)


def test_columns_take_numpys_scalars_and_nothing_that_is_not_finite() -> None:
    number = Column("x", "float", "a number", optional=True)
    assert number.checked(np.float32(0.5)) == 0.5
    assert number.checked(None) is None
    with pytest.raises(ValueError, match=r"x=nan, .*float"):
        number.checked(float("nan"))
    several = Column("x", "bool", "flags", many=True)
    assert several.checked(np.array([True, False])) == [True, False]
    with pytest.raises(ValueError, match="list of bool"):
        several.checked(True)


def test_an_error_of_the_policy_stays_its_own(world: TinyWorld) -> None:
    class Failing(Approaching):
        def predict(self, observation: Any, query: Any) -> Any:
            raise ValueError("no weights")

    with pytest.raises(AdapterError, match="no weights"):
        measure_pair(make_case(), world, Failing(), PairSettings(probes=ALL))


# By name.


def test_probes_are_found_by_name() -> None:
    assert [*PROBES][:3] == ["contact_timeline", "first_goal", "motion"]
    assert probes_called(()) == STANDARD
    assert probes_called(["contact_timeline", "contact_timeline"]).names == ("contact_timeline",)
    with pytest.raises(OptionError, match=r"'contact_time'.*'contact_timeline'"):
        probes_called(["contact_time"])


def test_another_package_adds_a_probe_with_an_entry_point(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, world: TinyWorld
) -> None:
    (tmp_path / "my_probe.py").write_text(
        "from pytest_libero_max.pairing.probes.probe import Column, Probe\n"
        "class Height(Probe[None]):\n"
        "    name = 'height'\n"
        "    schema = (Column('end_m', 'float', 'height of the hand at the end', 'm'),)\n"
        "    cost, every = 'nothing', 'end'\n"
        "    def columns(self, state, view):\n"
        "        return {'end_m': view.world.end_effector()[2]}\n"
    )
    info = tmp_path / "mine-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: mine\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[pytest_libero_max.probes]\nheight = my_probe:Height\ncontacts = my_probe:Height\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    registry: Registry[Any] = Registry("probe", PROBES.group, dict, PROBES._accept, OptionError)
    pair = played(world, Probes(STANDARD.standard, (registry["height"],)))
    assert pair.base.probes["height"] == {"end_m": pair.base.end_effector[-1][2]}
    with pytest.raises(OptionError, match="every pair"):
        registry["contacts"]


def test_a_probe_declares_itself() -> None:
    class Unnamed(Breaking):
        name = "Other"

    class Empty(Breaking):
        schema = ()

    class Alone(Breaking):
        schema = (Column("number", "int", "a number", along="others"),)

    class Odd(Breaking):
        every = "frame"  # type: ignore[assignment]

    assert isinstance(check_probe("breaking", Breaking), Breaking)
    for value, message in (
        (3, "3 is no subclass of Probe"),
        (Unnamed, "its name is 'Other', but must be 'breaking'"),
        (Empty, r"its columns are \[\]"),
        (Alone, "number is declared along 'others', but"),
        (Odd, "every='frame', but must be"),
    ):
        with pytest.raises(ValueError, match=message):
            check_probe("breaking", value)
