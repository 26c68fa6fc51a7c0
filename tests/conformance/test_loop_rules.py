"""Loops with one mistake each: its rule finds it, and no other ``must``; sound ones keep all."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
import pytest

from pytest_libero_max.conformance.loop.subject import LoopSubject
from pytest_libero_max.conformance.registry import rules_for
from pytest_libero_max.conformance.rules import Examination, Outcome
from pytest_libero_max.conformance.subjects import Subject, examination
from pytest_libero_max.errors import OptionError
from tests.conformance import loops

GALLERY: list[tuple[type[loops.Loop], str, str]] = [
    (loops.Raising, "contract/plays", "KeyError"),
    (loops.Silent, "contract/plays", "returned None"),
    (loops.Late, "observations/fresh", "made after 0 steps"),
    (loops.OldState, "observations/state", "the state after 0 steps"),
    (loops.OneBuffer, "observations/overwritten", "written to later"),
    (loops.OldInstruction, "observations/instruction", "the bowl"),
    (loops.Waiting, "actions/waiting", "3 actions"),
    (loops.LeftOver, "actions/left-over", "2 actions of an episode before"),
    (loops.SkipsFirst, "actions/executed", "was action 1 of that answer"),
    (loops.Scaled, "actions/executed", "had 0.25 as component 3"),
    (loops.WholeChunk, "actions/interval", "8 actions"),
    (loops.Normalised, "actions/beyond", "1.5 was executed as 0.83"),
    (loops.NoPolicyReset, "episodes/policy", "was not reset"),
    (loops.ResetsEachQuery, "episodes/policy", "was reset after 1 query"),
    (loops.Restarts, "episodes/environment", "after 5 steps"),
    (loops.Short, "episodes/whole", "stopped after 20 steps"),
    (loops.ToTheEnd, "episodes/after", "executed after its end"),
    (loops.AfterReset, "episodes/success", "counts as a failure"),
    (loops.Done, "episodes/success", "counts as a success"),
    (loops.Counting, "pair/seeds", "seed=1 in Base and with seed=2 in Dynamic"),
    (loops.Noisy, "pair/prefix", "another observation in Dynamic than in Base"),
]
DRAWS = "pair/generators"
"""Broken by every loop that does not seed the global generators."""


def examined(loop: Any) -> dict[str, Outcome]:
    outcomes = Examination(lambda: LoopSubject(loop), rules_for("loop")).outcomes()
    return {outcome.rule.id.removeprefix("loop/"): outcome for outcome in outcomes}


def broken(outcomes: dict[str, Outcome]) -> list[str]:
    return [name for name, outcome in outcomes.items() if outcome.state == "broken" and name != DRAWS]


@pytest.mark.parametrize("loop", loops.SOUND, ids=lambda loop: loop.__name__)
def test_a_sound_loop_keeps_every_rule(loop: Any) -> None:
    if loop is loops.vla_eval:
        pytest.importorskip("vla_eval", reason="see .ci/peers.txt")
    outcomes = examined(loop)
    assert not broken(outcomes), outcomes
    assert {outcome.state for name, outcome in outcomes.items() if name != DRAWS} == {"kept"}


@pytest.mark.parametrize(("loop", "name", "observed"), GALLERY, ids=[each[0].__name__ for each in GALLERY])
def test_a_mistake_breaks_its_rule_and_no_other(loop: type[loops.Loop], name: str, observed: str) -> None:
    outcomes = examined(loop())
    assert observed in " ".join(finding.observed for finding in outcomes[name].findings)
    assert all(finding.expected and finding.cure for finding in outcomes[name].broken)
    assert broken(outcomes) == [name]


def test_every_rule_has_a_loop_that_breaks_it() -> None:
    assert {rule.id.removeprefix("loop/") for rule in rules_for("loop")} == {
        name for _, name, _ in GALLERY
    } | {DRAWS}


def test_a_loop_that_seeds_the_generators_begins_both_arms_alike_and_leaves_them_alone() -> None:
    def seeding(env: Any, policy: Any) -> bool:
        random.seed(3)
        np.random.seed(3)  # noqa: NPY002
        return loops.plain(env, policy)

    before = random.getstate()
    assert examined(seeding)[DRAWS].state == "kept"
    assert random.getstate() == before
    assert examined(loops.plain)[DRAWS].state == "broken"


def test_a_loop_is_named_by_its_package_or_its_file() -> None:
    subject = Subject.read("loop:tests.conformance.loops:plain")
    subject.check()
    assert examination(subject).outcome("loop/contract/plays").state == "kept"
    with pytest.raises(ValueError, match="names no function"):
        Subject.read("loop:tests.conformance.loops")
    with pytest.raises(OptionError, match="no such module"):
        Subject.read("loop:tests.conformance.lops:plain").check()
    outcome = examination(Subject.read("loop:tests.conformance.loops:plan")).outcome("loop/contract/plays")
    assert "Did you mean 'plain'" in outcome.findings[0].observed
