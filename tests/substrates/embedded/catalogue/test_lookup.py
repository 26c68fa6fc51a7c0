from __future__ import annotations

import pytest

from pytest_libero_max.benchmark.cases import Case, parse_case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.identity import Identity
from pytest_libero_max.benchmark.records import case_record
from pytest_libero_max.errors import ManifestError, SubstrateError
from pytest_libero_max.events.registry import eligible, resolve_event
from pytest_libero_max.pairing.runner import PairSettings, play_pair
from pytest_libero_max.policies.contract import PolicySpec
from pytest_libero_max.strategies import ScriptedPolicy
from pytest_libero_max.substrates.embedded.catalogue.lookup import catalogue, variation_of
from pytest_libero_max.substrates.registry import open_substrate
from pytest_libero_max.substrates.variation import Variation, share, some, variation_metadata


def case_of(variation: Variation, event: str = "camera_shift", init: int = 0, **record: object) -> Case:
    category = variation.category if variation.source == "pro" else ""
    identity = Identity(variation.source, variation.suite, variation.index, init, category)
    raw = case_record(
        identity, resolve_event(event, 0, variation_metadata(variation), identity), variation.name
    )
    prefix = "LIBERO-PRO/" if variation.source == "pro" else ""
    raw["substrate_category"] = prefix + variation.category
    raw["substrate_difficulty"] = variation.difficulty
    return parse_case({**raw, **record})


@pytest.mark.parametrize(("source", "step"), [("plus", 997), ("pro", 41)])
def test_a_case_names_its_variation(source: str, step: int) -> None:
    for variation in catalogue(source)[::step]:
        assert variation_of(case_of(variation)) is variation


@pytest.mark.parametrize(
    ("record", "message"),
    [
        (
            {"task_name": "something_view_0_0_100_0_0_initstate_4"},
            "LIBERO-PRO are played on substrate libero, with their source variations as inst",
        ),
        ({"substrate_difficulty": 5, "task_index": 3}, "number 3 of the embedded catalogue is"),
        ({"task_index": 2402}, "has 2402 variations"),
        ({"substrate_category": "LIBERO-PRO/environment"}, "there is no LIBERO-PRO variation 'environment'"),
        ({"substrate_category": "Sensor Nose"}, "Sensor Nose"),
    ],
)
def test_a_case_of_another_catalogue_is_refused(record: Json, message: str) -> None:
    with pytest.raises(SubstrateError, match=message):
        variation_of(case_of(catalogue("plus")[0], **record))


def test_a_case_whose_words_ask_for_another_goal_is_refused() -> None:
    (stove,) = (one for one in catalogue("pro") if one.key == "pro/task/libero_goal/7")
    for words in (None, "put the cream cheese on the stove", "Put the cream cheese on the stove"):
        variant = None if words is None else {"language": words}
        assert variation_of(case_of(stove, substrate_variant=variant)) is stove
    published = case_of(stove, substrate_variant={"language": "Turn off the stove"})
    message = "tells the policy 'Turn off the stove', but is scored by 'put the cream cheese on the stove'"
    with pytest.raises(SubstrateError, match=message):
        variation_of(published)
    with pytest.raises(SubstrateError, match=message):
        open_substrate("embedded").world(published)


def test_a_case_may_say_the_same_goal_in_other_words() -> None:
    (drawer,) = (one for one in catalogue("pro") if one.key == "pro/task/libero_goal/3")
    words = {"language": "Open the top layer of the drawer and put the cream cheese inside"}
    assert variation_of(case_of(drawer, substrate_variant=words)) is drawer


def test_another_source_has_no_catalogue() -> None:
    with pytest.raises(ManifestError, match="source='plas'"):
        catalogue("plas")


def test_draws_are_shares_that_depend_on_their_parts_alone() -> None:
    assert share("a", 1) == share("a", 1) != share("a", 2)
    numbers = [share("spread", n) for n in range(2000)]
    assert 0.0 < min(numbers) < 0.01 < 0.99 < max(numbers) < 1.0
    assert sum(numbers) / 2000 == pytest.approx(0.5, abs=0.02)
    kept = some(range(50), 20, "x")
    assert kept == sorted(set(kept))
    assert len(kept) == 20


def test_confounders_may_burst_in_and_occluders_may_not() -> None:
    added = next(
        v for v in catalogue("plus") if v.suite == "libero_spatial" and v.kind == "add" and v.difficulty == 5
    )
    assert eligible("distractor_burst", variation_metadata(added))
    hidden = next(v for v in catalogue("pro") if v.category == "view_occlusion")
    assert "black_book_occluder_1" not in variation_metadata(hidden).distractors


def test_the_embedded_substrate_plays_pairs_on_variations_and_forks_as_it_replays() -> None:
    substrate = open_substrate("embedded")
    spec = PolicySpec("scripted", 8, 8, (), image_size=32)
    policy = ScriptedPolicy(spec, [(0.2, 0.3, -0.9, 0.0, 0.1, 0.0, -1.0)] * 3, 8)
    try:
        for variation in (
            next(v for v in catalogue("pro") if v.category == "object" and v.suite == "libero_spatial"),
            next(v for v in catalogue("plus") if v.category == "Robot Initial States" and v.difficulty == 5),
        ):
            case = case_of(variation, "obstacle_insertion")
            records = [
                play_pair(case, substrate.world(case), policy, PairSettings(prefix=prefix)).identity()
                for prefix in ("fork", "replay")
            ]
            assert records[0] == records[1]
            assert records[0]["instruction"] == variation_metadata(variation).language
    finally:
        substrate.close()
