from __future__ import annotations

import json
from itertools import permutations
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_libero_max.benchmark.selection import Selection, Shards, merged_selection
from pytest_libero_max.errors import ReportError

IDS = [f"case-{number}" for number in range(8)]


def shard(number: int, of: int = 4, asked: tuple[str, ...] = ()) -> Selection:
    return Selection.choose(IDS[number * 2 - 2 : number * 2], 8, asked, (number, of))


def test_all_cases_are_called_by_the_name_of_the_track() -> None:
    whole = Selection.choose(IDS, 8, ())
    assert whole.whole
    assert whole.text("track lite") == "track lite, all 8 cases"


@pytest.mark.parametrize(
    ("selection", "text"),
    [
        (
            Selection.choose(IDS[:3], 8, ["-k camera_shift"]),
            "3 of 8 cases of track lite (selection: -k camera_shift)",
        ),
        (
            Selection.choose(IDS[:3], 8, ["--libero-max-limit=4", "-m geometry"]),
            "3 of 8 cases of track lite (selection: --libero-max-limit=4, -m geometry)",
        ),
        (shard(2, asked=("-k v1",)), "2 of 8 cases of track lite (selection: -k v1, shard 2 of 4)"),
        (
            Selection.choose(IDS[:3], 8, []),
            "3 of 8 cases of track lite (selection: by another plugin or a conftest.py)",
        ),
        (
            merged_selection([shard(1), shard(3)], [*IDS[:2], *IDS[4:6]]),
            "4 of 8 cases of track lite (selection: shards 1, 3 of 4)",
        ),
    ],
)
def test_a_part_is_never_called_by_the_name_of_the_track_alone(selection: Selection, text: str) -> None:
    assert not selection.whole
    assert selection.text("track lite") == text


def test_asking_for_what_leaves_nothing_out_is_the_whole() -> None:
    assert Selection.choose(IDS, 8, ["-k case"]).whole


@given(st.permutations(IDS), st.sets(st.sampled_from(IDS), min_size=1))
def test_the_digest_is_of_the_cases_in_any_order(order: list[str], others: set[str]) -> None:
    whole = Selection.choose(IDS, 8, ())
    assert Selection.choose(order, 8, ()).digest == whole.digest
    assert (Selection.choose(others, 8, ()).digest == whole.digest) == (len(others) == 8)


def test_all_shards_together_are_the_whole_in_any_order() -> None:
    for order in permutations([1, 2, 3, 4]):
        merged = merged_selection([shard(number) for number in order], IDS)
        assert (merged.whole, merged.shards, merged.missing_shards) == (True, None, ())


def test_a_forgotten_shard_is_named() -> None:
    pieces = [shard(1), shard(2), shard(4)]
    merged = merged_selection(pieces, [*IDS[:4], *IDS[6:]])
    assert merged.missing_shards == (3,)
    assert not merged.whole
    assert merged_selection([merged, shard(3)], IDS).missing_shards == ()


def test_a_single_shard_lacks_nothing() -> None:
    assert shard(1).missing_shards == ()
    assert Selection.choose(IDS, 8, (), (1, 1)).whole


@pytest.mark.parametrize(
    ("pieces", "message"),
    [
        ([shard(1), shard(1, of=2)], "shard of 4, another of 2"),
        ([shard(1), Selection.choose(IDS[:2], 9, ())], "knows 8 cases .* another 9"),
        (
            [shard(1, asked=("-k a",)), shard(2, asked=("-k b",))],
            r"selections \(\(-k a\), \(-k b\)\)",
        ),
    ],
)
def test_pieces_of_different_divisions_are_refused(pieces: list[Selection], message: str) -> None:
    with pytest.raises(ReportError, match=message):
        merged_selection(pieces, IDS)


def test_different_selections_joined_name_both() -> None:
    pieces = [Selection.choose(IDS[:2], 8, ["-k a"]), Selection.choose(IDS[2:4], 8, ["-k b"])]
    assert merged_selection(pieces, IDS[:4]).text("track lite") == (
        "4 of 8 cases of track lite (selection: (-k a), (-k b))"
    )


@given(
    st.builds(
        Selection,
        asked=st.lists(st.text(max_size=5), max_size=3).map(tuple),
        chosen=st.integers(0, 5),
        of=st.integers(5, 9),
        digest=st.just("ab" * 32),
        shards=st.none() | st.just(Shards(4, (1, 3))),
        merged=st.booleans(),
    )
)
def test_a_selection_survives_its_file(selection: Selection) -> None:
    assert Selection.from_dict(json.loads(json.dumps(selection.to_dict()))) == selection


@pytest.mark.parametrize(
    "damage",
    [
        {"chosen": 9},
        {"chosen": "3"},
        {"chosen": -1},
        {"shards": {"of": 4}},
        {"shards": 3},
        {"asked": None},
        {"extra": 1},
        {"merged": "yes"},
    ],
)
def test_a_damaged_selection_is_refused(damage: dict[str, Any]) -> None:
    values = Selection.choose(IDS[:3], 8, ["-k a"]).to_dict()
    with pytest.raises(ReportError, match=r"^selection"):
        Selection.from_dict({**values, **damage})
    with pytest.raises(ReportError, match=r"^selection"):
        Selection.from_dict([values])
