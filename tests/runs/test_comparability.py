from __future__ import annotations

import pytest
from msgspec import structs

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import OptionError
from pytest_libero_max.runs.comparability import (
    COMPARISON,
    HERE,
    NAMES,
    ONE_MEASUREMENT,
    THERE,
    Kind,
    Side,
    differences_between,
    listed,
    measurement_differences,
    require_names,
)
from pytest_libero_max.runs.plan import Run
from tests.report.made_up import POLICY, PROVENANCE, plan

EVERYTHING: frozenset[Kind] = frozenset()
"""Nothing is tolerated."""

FIELDS: dict[str, tuple[str, Json]] = {
    "strength": ("setting", {"protocol": {"strength": 0.05}}),
    "latency": ("setting", {"protocol": {"latency": "4steps"}}),
    "prefix": ("setting", {"protocol": {"prefix": "replay"}}),
    "study": ("setting", {"protocol": {"study": {"name": "audit"}}}),
    "noise_floor": ("added", {"protocol": {"noise_floor": 4}}),
    "sham": ("added", {"protocol": {"sham": 0.2}}),
    "semantics": ("setting", {"substrate": {"semantics": "corrected"}}),
    "roots": ("place", {"substrate": {"roots": ["here"]}}),
    "versions": ("setting", {"versions": {"mujoco": "3.9.0"}}),
    "case_set": ("setting", {"case_set": {"digest": "1" * 64}}),
    "path": ("place", {"case_set": {"path": "there.json"}}),
    "code": ("policy", {"policy": {"code": "f" * 64}}),
    "revision": ("policy", {"policy": {"revision": "checkpoint 2"}}),
    "weights": ("policy", {"policy": {"weights": "0" * 64}}),
    "reference": ("address", {"policy": {"reference": "other.py"}}),
    "profile": ("place", {"policy": {"profile": "there.toml"}}),
}
"""Kind of the difference and the changed parts of the provenance, by a name of this table."""


def side(parts: Json | None = None, **of_policy: object) -> Side:
    changed = {name: {**PROVENANCE[name], **values} for name, values in (parts or {}).items()}
    return Side(Run(tuple(plan()), {**PROVENANCE, **changed}), {**POLICY, **of_policy})


@pytest.mark.parametrize(("kind", "parts"), FIELDS.values(), ids=FIELDS)
def test_each_field_has_a_kind_that_its_readers_tolerate_or_not(kind: Kind, parts: Json) -> None:
    sides = {THERE: side(), HERE: side(parts)}
    (difference,) = differences_between(sides, EVERYTHING)
    ((part, values),) = parts.items()
    (name,) = values
    assert (difference.field, difference.kind) == (f"{part}.{name}", kind)
    assert difference.values[HERE] == values[name]
    assert bool(differences_between(sides, COMPARISON)) == (kind == "setting")
    tolerated = measurement_differences(sides[THERE].run, sides[HERE].run) == []
    assert tolerated == (kind in ONE_MEASUREMENT)


@pytest.mark.parametrize(
    ("name", "value"),
    [("horizon", 16), ("query_interval", 4), ("repeatable", False), ("wrappers", ["restore=gated"])],
)
def test_a_comparison_looks_at_how_the_policy_was_played(name: str, value: object) -> None:
    (difference,) = differences_between({THERE: side(), HERE: side(None, **{name: value})}, COMPARISON)
    assert (difference.name, difference.kind) == (name, "setting")
    assert not differences_between({THERE: side(), HERE: side(None, name="another")}, COMPARISON)


def test_what_drew_the_images_and_scenes_are_settings_too() -> None:
    there, here = side(), side()
    cases = [pair.case_id for pair in there.run.planned]
    drawn = {
        THERE: Side(there.run, POLICY, dict.fromkeys(cases, "a 1"), ("llvmpipe",)),
        HERE: Side(here.run, POLICY, {**dict.fromkeys(cases, "a 1"), cases[0]: "a 2"}, ("radeon",)),
    }
    found = differences_between(drawn, COMPARISON)
    assert [one.name for one in found] == ["scenes", "renderers"]
    assert [one.name for one in differences_between(drawn, ONE_MEASUREMENT)] == ["scenes"]
    assert not differences_between({THERE: drawn[THERE], HERE: Side(here.run, POLICY)}, COMPARISON)


def test_differences_are_accepted_by_name_field_or_part() -> None:
    parts = {"protocol": {"strength": 0.05}, "versions": {"mujoco": "3.9.0", "numpy": "3"}}
    strength, mujoco, numpy = differences_between({THERE: side(), HERE: side(parts)}, COMPARISON)
    assert strength.accepted(["strength"])
    assert strength.accepted(["protocol.strength"])
    assert mujoco.accepted(["versions"])
    assert numpy.accepted(["versions"])
    assert mujoco.accepted(["versions.mujoco"])
    assert not numpy.accepted(["versions.mujoco", "strength"])
    assert listed([strength]) == "strength (1.0 there, 0.05 here)"


def test_every_name_is_that_of_a_difference_and_unknown_ones_are_refused() -> None:
    require_names([*NAMES, "versions.numpy", "substrate.of_another_package"])
    with pytest.raises(OptionError, match="Did you mean 'strength'"):
        require_names(["strenght"])
    with pytest.raises(OptionError, match="is no setting in which runs can differ"):
        require_names(["platform.cores"])


def test_addresses_of_servers_may_differ_where_the_records_name_the_weights() -> None:
    runs = [
        structs.replace(side().run, provenance={**PROVENANCE, "policy": {"reference": f"openpi://{host}:1"}})
        for host in ("a", "b")
    ]
    assert measurement_differences(*runs, declared=True) == []
    (said,) = measurement_differences(*runs)
    assert said.endswith("declare the weights: --libero-max-revision)")
