"""Worlds with one mistake each: its rule finds it, and no other ``must``; the tiny world keeps all."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from pytest_libero_max.benchmark.manifests import decode_manifest
from pytest_libero_max.conformance.registry import rules_for
from pytest_libero_max.conformance.rules import Examination, Outcome, Rule
from pytest_libero_max.conformance.substrate.subject import SubstrateSubject
from pytest_libero_max.events.registry import BENCHMARK_EVENTS
from pytest_libero_max.substrates.tiny.world import TinyWorld
from tests.conformance import worlds
from tests.plugin.conftest import tiny_manifest

RULES = rules_for("substrate")
CASES = decode_manifest(json.dumps(tiny_manifest()).encode(), Path("tiny.json")).cases

GALLERY: list[tuple[type[TinyWorld], str, str]] = [
    (worlds.AcceptingAnything, "contract/actions", "was played"),
    (worlds.WrappingInits, "contract/inits", "was played"),
    (worlds.TwiceAsFast, "contract/rate", "take 2.000 s"),
    (worlds.Mirrored, "contract/directions", "in y move the hand"),
    (worlds.ClosingAtMinusOne, "contract/gripper", "openings after -1, +1, -1"),
    (worlds.Growing, "states/steps", "another digest"),
    (worlds.FromTheLast, "states/index", "begins elsewhere"),
    (worlds.Drifting, "states/restore", "lead elsewhere"),
    (worlds.Aliasing, "states/aliases", "changed while the world went on"),
    (worlds.PositionsAlone, "states/complete", "does not cover"),
    (worlds.LettingWritesBe, "states/writes", "names none, and they stay"),
    (worlds.Done, "states/success", "holds at the beginning"),
    (worlds.Renamed, "images/keys", "robot0_eef_pos missing"),
    (worlds.Upright, "images/rows", "top row first"),
    (worlds.Rotated, "images/rows", "top row first and mirrored"),
    (worlds.Flickering, "images/same", "drawn twice differs"),
    (worlds.StirringWhenDrawn, "images/physics", "digest changed"),
    (worlds.Jostling, "events/target_relocation", "plate_1 moved as well"),
    (worlds.Shaking, "events/illumination_switch", "lead elsewhere"),
]


def examine(world: TinyWorld, rules: tuple[Rule, ...] = RULES) -> dict[str, Outcome]:
    outcomes = Examination(lambda: SubstrateSubject(worlds.OneWorld(world), CASES), rules).outcomes()
    world.close()
    return {outcome.rule.id.removeprefix("substrate/"): outcome for outcome in outcomes}


def broken(outcomes: dict[str, Outcome]) -> list[str]:
    return [name for name, outcome in outcomes.items() if outcome.state == "broken"]


def test_the_tiny_world_keeps_every_rule() -> None:
    outcomes = examine(TinyWorld())
    assert not broken(outcomes)
    unexamined = [name for name, outcome in outcomes.items() if outcome.state == "unexamined"]
    assert unexamined == ["states/process"]  # the substrate is an object of this process
    assert {f"events/{event}" for event in BENCHMARK_EVENTS} <= {*outcomes}


def test_a_gripper_may_open_with_plus_one() -> None:
    rules = tuple(rule for rule in RULES if rule.area == "contract")
    assert examine(worlds.OpeningAtPlusOne(), rules)["contract/gripper"].state == "kept"


@pytest.mark.parametrize(("world", "name", "observed"), GALLERY, ids=[each[0].__name__ for each in GALLERY])
def test_a_mistake_breaks_its_rule_and_no_other_must(
    world: type[TinyWorld], name: str, observed: str
) -> None:
    # Those of images open a GL context, and those of events take as long as all others together.
    own = name.partition("/")[0]
    rules = tuple(rule for rule in RULES if rule.area == own or rule.area not in ("images", "events"))
    outcomes = examine(world(), rules)
    assert observed in " ".join(finding.observed for finding in outcomes[name].findings)
    assert all(finding.expected and finding.cure for finding in outcomes[name].broken)
    assert broken(outcomes) == [name]
