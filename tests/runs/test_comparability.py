from __future__ import annotations

from dataclasses import fields

import pytest
from msgspec import structs

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import OptionError
from pytest_libero_max.evaluation.settings import Settings
from pytest_libero_max.runs import plan as plan_module
from pytest_libero_max.runs.comparability import (
    COMPARISON,
    HERE,
    ONE_MEASUREMENT,
    THERE,
    Kind,
    Side,
    differences_between,
    listed,
    measurement_differences,
    names,
    policies_text,
    policy_differences,
    require_names,
)
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.protocol import PARTS, declared
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
    "images": ("setting", {"substrate": {"images": "1"}}),
    "roots": ("place", {"substrate": {"roots": ["here"]}}),
    "versions": ("setting", {"versions": {"mujoco": "3.9.0"}}),
    "case_set": ("setting", {"case_set": {"digest": "1" * 64}}),
    "path": ("place", {"case_set": {"path": "there.json"}}),
    "code": ("policy", {"policy": {"code": "f" * 64}}),
    "revision": ("policy", {"policy": {"revision": "checkpoint 2"}}),
    "weights": ("policy", {"policy": {"weights": "0" * 64}}),
    "reference": ("address", {"policy": {"reference": "other.py"}}),
    "profile": ("place", {"policy": {"profile": "there.toml"}}),
    "wrap": ("policy", {"policy": {"wrap": {"restore": "gated"}}}),
    "asked_horizon": ("policy", {"policy": {"horizon": 4}}),
    "asked_query_interval": ("policy", {"policy": {"query_interval": 2}}),
    "program": ("setting", {"protocol": {"program": {"name": "twice", "digest": "a" * 64}}}),
    "instruction": ("setting", {"substrate": {"instruction_source": "clean"}}),
    "source_variations": ("setting", {"substrate": {"source_variations": "own"}}),
    "substrate": ("setting", {"substrate": {"name": "libero"}}),
    "assets": ("place", {"substrate": {"assets": "there"}}),
    "limit": ("setting", {"case_set": {"limit": 4}}),
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


def test_images_without_a_version_are_of_the_first_and_matter_to_policies_that_are_shown_some() -> None:
    unversioned: Json = {"substrate": {"images": None}}
    (difference,) = differences_between({THERE: side(unversioned), HERE: side()}, COMPARISON)
    assert (difference.name, difference.values) == ("images", {THERE: "1", HERE: "2"})
    assert not differences_between({THERE: side(unversioned, cameras=[]), HERE: side()}, COMPARISON)


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
    require_names([*names(), "versions.numpy", "substrate.of_another_package"])
    with pytest.raises(OptionError, match="Did you mean 'strength'"):
        require_names(["strenght"])
    with pytest.raises(OptionError, match="setting in which"):
        require_names(["platform.cores"])


OPTIONS: dict[str, str] = {
    "policy": "reference",
    "profile": "profile",
    "revision": "revision",
    "manifest": "path",
    "track": "case_set",
    "program": "program",
    "limit": "limit",
    "substrate": "substrate",
    "libero": "roots",
    "libero_assets": "assets",
    "prefix": "prefix",
    "strength": "strength",
    "study": "study",
    "latency": "latency",
    "horizon": "asked_horizon",
    "query_interval": "asked_query_interval",
    "wrap": "wrap",
    "noise": "sham",
}
"""The row of :data:`FIELDS` by which an option of a run is compared."""

NO_EPISODE = {
    "which of the cases, which are compared one by one": ("only_installed", "suites", "shard"),
    "in which order, and how many": ("order", "stop"),
    "what is read, kept or shown of an episode": (
        "probe",
        "traces",
        "film",
        "progress",
        "output",
    ),
    "what is decided on results": ("strict", "gate", "compare", "verify"),
    "what is examined, and no pair played": ("conform", "xfails"),
    "what makes a pair an error, and no result": ("timeout", "memory"),
    "where and how often pairs are played": (
        "retries",
        "isolate",
        "resume",
        "ray",
    ),
}
"""Options that alter no episode, by what they are about."""


def test_every_option_is_compared_or_alters_no_episode() -> None:
    aside = [name for names in NO_EPISODE.values() for name in names]
    assert sorted([*OPTIONS, *aside]) == sorted(field.name for field in fields(Settings))
    assert {*OPTIONS.values()} <= {*FIELDS}


def test_every_part_of_a_header_is_compared_or_alters_no_episode() -> None:
    compared = {"policy", "substrate", "case_set", "protocol", "versions"}
    aside = {"platform", "command", "started", "git", "gl_backend", "fingerprint"}
    aside |= {"order", "stopping_rule", "gates", "scores"}
    assert {*plan_module.Provenance.__struct_fields__} == compared | aside
    tried = {
        (part, name) for _, parts in FIELDS.values() for part, fields in parts.items() for name in fields
    }
    assert {(part, name) for part in PARTS for name in declared(part)} <= tried


def test_budgets_and_instruments_of_records_are_settings() -> None:
    run = side().run
    budgets = dict.fromkeys((pair.case_id for pair in run.planned), 220)
    shorter = {**budgets, run.planned[0].case_id: 30}
    plus, other = {"LIBERO-Plus": "0.1.5 sources a"}, {"LIBERO-Plus": "0.1.5 sources b"}
    sides = {
        THERE: Side(run, POLICY, budgets=budgets, fingerprints={**plus, "blas": "Zen", "scene": "a 1"}),
        HERE: Side(run, POLICY, budgets=shorter, fingerprints={**other, "blas": "Haswell", "scene": "a 2"}),
    }
    instrument, steps = differences_between(sides, COMPARISON)
    assert (steps.name, steps.values) == ("max_steps", {THERE: [220], HERE: [30]})
    assert instrument.field == "fingerprints.LIBERO-Plus"
    require_names([steps.name, instrument.field])
    sides[HERE] = Side(run, POLICY, budgets=budgets)
    assert differences_between(sides, COMPARISON) == []


@pytest.mark.parametrize(("part", "only"), [("files", True), ("reset_files", False)])
def test_files_that_policies_read_are_named_and_tolerated_in_comparisons(part: str, only: bool) -> None:
    one, other = ({"w.npy": {"bytes": 4, "sha256": digit * 64}} for digit in "01")
    sides = {THERE: side(None, **{part: one}), HERE: side(None, **{part: other})}
    (difference,) = differences_between(sides, EVERYTHING)
    assert (difference.field, difference.kind) == ("policy.files.w.npy", "policy")
    assert difference.values == {THERE: f"bytes 4 sha256 {'0' * 12}", HERE: f"bytes 4 sha256 {'1' * 12}"}
    assert differences_between(sides, COMPARISON) == []
    assert "w.npy" in (policies_text(one.field for one in policy_differences(sides)) or "")
    assert differences_between(sides | {HERE: side()}, EVERYTHING) == []  # not recorded
    assert bool(differences_between(sides | {HERE: side(None, **{part: {}})}, EVERYTHING)) is only
    assert policy_differences(sides | {HERE: side(None, **{part: other, "name": "another"})}) == []
    asked = side({"policy": {"horizon": 4, "wrap": {"restore": "gated"}}}, **{part: one})
    assert policy_differences(sides | {HERE: asked}) == []


def test_addresses_of_servers_may_differ_where_the_records_name_the_weights() -> None:
    runs = [
        structs.replace(side().run, provenance={**PROVENANCE, "policy": {"reference": f"openpi://{host}:1"}})
        for host in ("a", "b")
    ]
    assert measurement_differences(*runs, declared=True) == []
    (said,) = measurement_differences(*runs)
    assert said.endswith("declare the weights: --libero-max-revision)")
