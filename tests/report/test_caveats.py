from __future__ import annotations

from typing import Any

import pytest
from markupsafe import escape
from msgspec.structs import replace

from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.caveats import RULES, caveat_text, caveats_of
from pytest_libero_max.report.page.report_page import html
from pytest_libero_max.report.report_document import Caveat
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.writers.summary import summary_lines
from pytest_libero_max.runs.outcomes import Played
from tests.report.made_up import NEVER_TRIGGERED, POLICY, PROVENANCE, plain, plan, record_of

PROMPT = "pick up the black bowl on the stove and place it on the plate"


def pair(semantics: str | None = None, **changes: Any) -> PairRecord:
    """A pair on the embedded substrate, or on the genuine one with events of a kind."""
    substrate = {"substrate": "embedded"}
    if semantics is not None:
        substrate = {"substrate": "libero", "semantics": semantics}
    values = {"instruction": PROMPT, "event": "camera_shift", "fingerprints": substrate}
    return record_of(plan()[0], True, True, **values | changes)


def names(*records: PairRecord) -> dict[str, int]:
    return {caveat.name: caveat.pairs for caveat in caveats_of(map(Played.of, records))}


@pytest.mark.parametrize(
    "ending",
    [
        "view 0 0 100 0 0 initstate 4",
        "view 350 15 130 7 2 initstate 0",
        "view 0 0 100 0 0 initstate 0 noise 12",
        "table 1",
        "tb 3",
        "light 117",
        "add 2",
        "level2 sample3",
        "moved level1 sample4",
    ],
)
def test_a_prompt_with_the_variations_name_in_it_is_found(ending: str) -> None:
    assert names(pair(instruction=f"{PROMPT} {ending}")) == {"contaminated_prompt": 1}
    assert names(pair(instruction=f"{PROMPT} {ending}", source="libero")) == {}


@pytest.mark.parametrize("words", [PROMPT, "put both moka pots on the stove", "clear table 1 and view it"])
def test_a_prompt_that_people_would_say_is_none(words: str) -> None:
    assert names(pair(instruction=words)) == {}


@pytest.mark.parametrize(
    ("event", "expected"),
    [
        ("camera_shift", {"shifted_observations": 1}),
        ("target_relocation", {"shifted_observations": 1}),
        ("sensor_noise_onset", {"one_noise_stream": 1, "shifted_observations": 1}),
        ("distractor_burst", {"tumbled_insertions": 1, "shifted_observations": 1}),
        ("obstacle_insertion", {"tumbled_insertions": 1, "shifted_observations": 1}),
    ],
)
def test_events_differ_where_the_world_was_genuine_and_the_event_came(
    event: str, expected: dict[str, int]
) -> None:
    assert names(pair("published", event=event)) == expected
    assert names(pair("corrected", event=event)) == {"corrected_events": 1}
    assert names(pair(event=event)) == {}
    assert names(pair("published", **NEVER_TRIGGERED | {"event": event})) == {}


@pytest.mark.parametrize(
    ("source", "category", "expected"),
    [
        ("plus", "Robot Initial States", "erased_robot_pose"),
        ("plus", "Sensor Noise", "reseeded_noise"),
        ("pro", "object_shape", "inert_shape"),
        ("pro", "object_texture", "tint_for_texture"),
        ("pro", "view_occlusion", "small_occluder"),
    ],
)
def test_variations_that_do_not_do_what_they_are_called(source: str, category: str, expected: str) -> None:
    varied = {"source": source, "source_category": category}
    assert names(pair("corrected", **NEVER_TRIGGERED | varied)) == {expected: 1}
    assert names(pair(**varied)) == {}


def test_pairs_are_counted_in_the_order_of_the_rules() -> None:
    records = [pair("published", event="distractor_burst") for _ in range(3)] + [pair("published"), pair()]
    found = caveats_of(map(Played.of, records))
    assert [(caveat.name, caveat.pairs, caveat.played) for caveat in found] == [
        ("tumbled_insertions", 3, 5),
        ("shifted_observations", 4, 5),
    ]
    assert len({rule.name for rule in RULES}) == len(RULES)


@pytest.mark.parametrize(
    ("mujoco", "noted"), [("3.3.7", False), ("3.4.0", True), ("3.9.0", True), ("4.0.0", True)]
)
def test_a_later_mujoco_is_noted(mujoco: str, noted: bool) -> None:
    record = pair(fingerprints={"substrate": "embedded", "mujoco": mujoco})
    assert names(record) == ({"later_mujoco": 1} if noted else {})


def test_every_form_of_the_report_says_so() -> None:
    pairs = plan()[:2]
    records = [
        record_of(planned, True, True, instruction=f"{PROMPT} table 1" if planned is pairs[0] else PROMPT)
        for planned in pairs
    ]
    report = build_report(records, [], pairs, PROVENANCE)
    assert [caveat["name"] for caveat in plain(report)["caveats"]] == ["contaminated_prompt"]
    text = caveat_text(report.caveats[0])
    assert text.startswith("1 of 2 pairs: ")
    assert f"\n\n{text}\n" in markdown(report)
    assert escape(text) in html(report, [], [])
    assert any("contaminated prompt 1." in line for line in summary_lines(report))
    many = replace(
        report, caveats=[Caveat(name=rule.name, pairs=12, played=12, text=rule.text) for rule in RULES]
    )
    assert max(map(len, summary_lines(many))) <= 100
    assert not any("Notes on pairs" in line for line in summary_lines(replace(report, caveats=[])))


def test_own_variations_are_told_from_those_of_libero_pro() -> None:
    """A defect of LIBERO-PRO in a category is no defect of the package's own variations in its place."""
    where = {"source": "plus", "source_category": "Robot Initial States", "event": "nothing"}
    genuine = {"substrate": "libero", "semantics": "published"}
    theirs = pair(fingerprints=genuine | {"source_variations": "installed"}, **where)
    own = pair(fingerprints=genuine | {"source_variations": "own"}, **where)
    plain = pair(fingerprints=genuine | {"source_variations": "own"}, source="libero")
    assert names(theirs, own, plain)["erased_robot_pose"] == 1
    assert names(theirs, own, plain)["own_variations"] == 1
    assert "own_variations" not in names(theirs)


def test_a_program_is_found_by_its_record_and_not_by_the_name_of_the_pair() -> None:
    named = pair(item_id="libero-object-t00-i00-camera_shift-v0-transient")
    played = pair(fingerprints={"substrate": "embedded", "program": "transient ab12"})
    assert names(named) == {}
    assert names(named, played) == {"program": 1}


def starting(base_digest: str, event: str = "camera_shift", **changes: Any) -> PairRecord:
    """A pair that says in which state it begins."""
    start = {"substrate": "embedded", "scene": "embedded/libero_goal/1 ab", "start": "cd"}
    return pair(event=event, base_digest=base_digest, fingerprints=start, **changes)


def test_pairs_with_equal_starts_have_equal_bases() -> None:
    one, same, other = (
        starting("aa"),
        starting("aa", "sensor_noise_onset"),
        starting("bb", "target_relocation"),
    )
    assert names(one, same) == {}
    assert names(one, same, other) == {"unequal_bases": 1}
    assert names(one, starting("bb", policy_seed=196)) == {}
    assert names(one, starting("bb", "obstacle_insertion")) == {}, "taken out before Base"
    noisy = {**POLICY, "repeatable": False}
    assert names(one, starting("bb", policy=noisy)) == {"not_repeatable": 1}
    assert names(pair(base_digest="aa"), pair(base_digest="bb")) == {}, "records of earlier versions"


def test_pairs_that_another_renderer_drew_than_most_are_counted() -> None:
    def drawn(mesa: str) -> PairRecord:
        return pair(fingerprints={"gl_renderer": "llvmpipe", "gl_version": f"4.5 Mesa {mesa}"})

    most, other, unknown = drawn("22.3.6"), drawn("26.2.6"), pair()
    assert names(most, most, other, unknown) == {"other_renderers": 1}
    assert names(most, unknown) == names(unknown) == names() == {}
