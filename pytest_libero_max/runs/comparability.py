"""Comparability of runs: the settings in which runs differ, with the value of each.

This is the one place that knows what a result depends on beside its cases. Gates against another run,
``compare``, ``trend``, ``merge`` and resuming ask it, and say which kinds of differences they tolerate.

======== ================================================= ============== =============================
Kind     Fields                                            In comparisons Within one measurement
======== ================================================= ============== =============================
setting  protocol, substrate, case set, versions, scenes,  a difference   a difference
         budgets of steps, installations; H, Q,
         repeatability and wrappers of the policy
         version of the images, where a policy is shown some
renderer what drew the images                              a difference   tolerated
added    arms that are played beside Base and Dynamic      tolerated      a difference
policy   the policy as asked for: code, revision; the      tolerated      a difference
         files that it has read
address  addresses of its servers                          tolerated      tolerated if records name the
                                                                          weights
place    paths, whose content digests identify             tolerated      tolerated
======== ================================================= ============== =============================

A comparison is of policies, so these may differ, and the comparison names what is not the same in policies of
one name. One measurement is what is merged or resumed; its pairs are compared by :mod:`.agreement` as well.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any, Literal, TypeAlias, get_args

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.structs import shown
from pytest_libero_max.errors import OptionError, counted, did_you_mean
from pytest_libero_max.pairing.record import FILES, RESET_FILES, PairRecord
from pytest_libero_max.policies.clients.address import is_served
from pytest_libero_max.policies.profile import declares_weights
from pytest_libero_max.runs.agreement import OF_CASE, OF_MACHINE, differing_files, identity_text
from pytest_libero_max.runs.plan import Run, Substrate
from pytest_libero_max.runs.protocol import PARTS, declared
from pytest_libero_max.runs.setting import ALWAYS, Recorded
from pytest_libero_max.substrates.registry import images_of

Kind = Literal["setting", "renderer", "added", "policy", "address", "place"]

COMPARISON: frozenset[Kind] = frozenset({"added", "policy", "address", "place"})
"""Kinds of differences that a comparison of runs tolerates."""

ONE_MEASUREMENT: frozenset[Kind] = frozenset({"renderer", "place"})
"""Kinds of differences that the pieces of one measurement may have."""

OF_POLICIES: frozenset[Kind] = frozenset(get_args(Kind)) - {"policy"}
"""Kinds that are left out where two policies alone are compared."""

_PARTS = ("policy", "substrate", "case_set", "protocol", "versions")
"""Parts of the provenance that results depend on."""

_FINGERPRINTS = "fingerprints"
_FILE = f"policy.{FILES}."

_KINDS: Mapping[str, Kind] = {
    "case_set.path": "place",
    "case_set.program": "place",
    "substrate.roots": "place",
    "substrate.assets": "place",
    "policy.reference": "address",
    "policy.servers": "address",
}
"""Kinds of single fields of the provenance that are no settings; settings declare theirs."""

_AS_PLAYED: Json = {"horizon": None, "query_interval": None, "repeatable": True, "wrappers": []}
"""Declarations of a policy as it was played that a comparison looks at; values of records without them."""

THERE, HERE = "there", "here"
"""Names of another run and of this one."""

SCENES, RENDERERS, MAX_STEPS = "scenes", "renderers", "max_steps"
_IMAGES = "substrate.images"

_GROUPS = ("versions", "case_set")
"""Parts whose fields are accepted together, by the name of the part."""


def places() -> list[str]:
    """Return the fields of the provenance that hold places on a machine, as ``PART.FIELD``."""
    settings = {f"{part}.{name}": field.kind for part in PARTS for name, field in declared(part).items()}
    return [place for place, kind in {**_KINDS, **settings}.items() if kind == "place"]


def names() -> list[str]:
    """Return the names by which a difference can be accepted; ``PART.FIELD`` names one beyond them."""
    settings = [name for name, field in declared("protocol").items() if field.kind is None]
    of_substrate = [
        name for name in Substrate.__struct_fields__ if f"substrate.{name}" not in _KINDS and name != "name"
    ]
    return [*settings, *of_substrate, *_AS_PLAYED, SCENES, RENDERERS, MAX_STEPS, *_GROUPS]


_Settings: TypeAlias = Mapping[tuple[str, str], Recorded]
"""Declarations by part of the provenance and field."""


@dataclass(frozen=True)
class Difference:
    """A field in which runs differ."""

    field: str
    """Place in the provenance, for example ``protocol.strength``; ``scenes``, ``max_steps`` or ``renderers``;
    ``policy.files.NAME`` of a file, ``fingerprints.NAME`` of an instrument."""
    kind: Kind
    """What it is, for those who tolerate it."""
    values: Mapping[str, Any]
    """Its value in each run, by the names of the runs; None where a run has none."""

    @property
    def name(self) -> str:
        """Name by which the difference is accepted, for example ``strength``."""
        part, _, rest = self.field.partition(".")
        return part if part in _GROUPS or not rest else rest

    def accepted(self, names: Iterable[str]) -> bool:
        """Return True if one of the names accepts this difference."""
        return not {self.name, self.field}.isdisjoint(names)

    def __str__(self) -> str:
        return f"{self.field}: {', '.join(shown(value) for value in self.values.values())}"


@dataclass(frozen=True)
class Side:
    """A run as far as its comparability is concerned."""

    run: Run
    policy: Json | None = None
    """Spec of the policy as played, with all files that it has read; None where no pair was."""
    scenes: Mapping[str, str] = field(default_factory=dict)
    """Fingerprints of scene and start, by case; empty where a record of an earlier version has none."""
    renderers: Sequence[str] = ()
    """What drew the images; empty where no record says so."""
    budgets: Mapping[str, int] = field(default_factory=dict)
    """Steps that an episode may take, by case."""
    fingerprints: Mapping[str, str] = field(default_factory=dict)
    """What a pair was played with, by name."""


def differences_between(sides: Mapping[str, Side], tolerated: frozenset[Kind]) -> list[Difference]:
    """Return what runs differ in beside what is tolerated: fields of the provenance first, sorted.

    Args:
        sides: The runs by name. Scenes and budgets are compared on the cases that all of them have.
    """
    settings: _Settings = {(part, name): field for part in PARTS for name, field in declared(part).items()}
    by_run = {name: _fields(side, settings) for name, side in sides.items()}
    found = []
    for key in sorted({key for fields in by_run.values() for key in fields}):
        place, kind = key
        part, _, name = place.partition(".")
        setting = settings.get((part, name))
        usual = None if setting is None or setting.usual is ALWAYS else setting.usual
        values = {run: fields.get(key, usual) for run, fields in by_run.items()}
        if len({json.dumps(value, sort_keys=True) for value in values.values()}) > 1:
            found.append(Difference(place, kind, values))
    found += [*_file_differences(sides), *_instrument_differences(sides), *_budget_differences(sides)]
    found += [*_scene_differences(sides), *_image_differences(sides), *_renderer_differences(sides)]
    return [one for one in found if one.kind not in tolerated]


def listed(found: Iterable[Difference]) -> str:
    """Return differences of two runs, named :data:`THERE` and :data:`HERE`, as words for a sentence."""
    return ", ".join(
        f"{one.field.removeprefix('protocol.')} ({shown(one.values[THERE])} there, "
        f"{shown(one.values[HERE])} here)"
        for one in found
    )


def policy_differences(sides: Mapping[str, Side]) -> list[Difference]:
    """Return what policies of one name differ in; those of several are expected to differ in everything.

    How they ask, and what is wrapped around them, are settings as it was played, and not repeated here.
    """
    names = {(side.policy or {}).get("name") for side in sides.values()}
    found = differences_between(sides, OF_POLICIES) if len(names) == 1 else []
    as_played = {name for name, field in declared("policy").items() if field.as_played}
    return [difference for difference in found if difference.name not in as_played]


def is_file(field: str) -> bool:
    """Return True if the field of a difference is a file that policies have read."""
    return field.startswith(_FILE)


def policies_text(fields: Iterable[str]) -> str | None:
    """Return a sentence on the fields in which policies of one name differ; None for no field."""
    names = [
        f"the file {name.removeprefix(_FILE)}" if is_file(name) else name.removeprefix("policy.")
        for name in fields
    ]
    return f"The policies have one name, and differ in {', '.join(names)}." if names else None


def _fields(side: Side, settings: _Settings) -> dict[tuple[str, Kind], Any]:
    """Return what a run says of itself, by field and kind: as asked for, and of its policy as played."""
    fields: dict[tuple[str, Kind], Any] = {
        (f"{part}.{name}", _kind_of(part, name, settings)): value
        for part in _PARTS
        for name, value in side.run.provenance.get(part, {}).items()
        if f"{part}.{name}" != _IMAGES
    }
    if side.policy is not None:
        for name, usual in _AS_PLAYED.items():
            fields[f"policy.{name}", "setting"] = side.policy.get(name, usual)
    return fields


def _kind_of(part: str, name: str, settings: _Settings) -> Kind:
    declared_kind = settings[part, name].kind if (part, name) in settings else None
    return declared_kind or _KINDS.get(f"{part}.{name}") or ("policy" if part == "policy" else "setting")


def _file_differences(sides: Mapping[str, Side]) -> list[Difference]:
    """Name the files that not all policies have read with one content; nothing where a record names none."""
    policies = {name: side.policy or {} for name, side in sides.items()}
    names = {
        (part, file)
        for part in (FILES, RESET_FILES)
        for one, other in combinations(policies.values(), 2)
        for file in differing_files(part, one, other)
    }
    return [
        Difference(
            f"{_FILE}{file}",
            "policy",
            {
                name: identity_text(policy[part].get(file)) if part in policy else None
                for name, policy in policies.items()
            },
        )
        for part, file in sorted(names)
    ]


def _instrument_differences(sides: Mapping[str, Side]) -> list[Difference]:
    """Name the fingerprints of records that no provenance holds, such as digests of installations."""
    known = {"adapter", *OF_CASE, *OF_MACHINE}
    for side in sides.values():
        provenance = side.run.provenance
        known |= {"substrate", *provenance["versions"], *provenance["substrate"], *provenance["protocol"]}
    names = sorted({name for side in sides.values() for name in side.fingerprints} - known)
    found = []
    for name in names:
        values = {run: side.fingerprints.get(name) for run, side in sides.items()}
        if len({*values.values()} - {None}) > 1:
            found.append(Difference(f"{_FINGERPRINTS}.{name}", "setting", values))
    return found


def _budget_differences(sides: Mapping[str, Side]) -> list[Difference]:
    """Name the budgets of the common cases whose episodes have not the same budget in all runs."""
    cases = set.intersection(*({*side.budgets} for side in sides.values()))
    other = [case for case in cases if len({side.budgets[case] for side in sides.values()}) > 1]
    values = {name: sorted({side.budgets[case] for case in other}) for name, side in sides.items()}
    return [Difference(MAX_STEPS, "setting", values)] if other else []


def _scene_differences(sides: Mapping[str, Side]) -> list[Difference]:
    """Name the common cases that a run played in another scene, or from another start, than the first run.

    Runs of earlier versions recorded a digest of source code for all scenes. That says nothing of a scene, so
    such a run is compared like every other, with None here.
    """
    cases = sorted(set.intersection(*({*side.scenes} for side in sides.values())))
    played = {name: side.scenes for name, side in sides.items()}
    first = next((name for name, scenes in played.items() if any(scenes[case] for case in cases)), None)
    if first is None:
        return []
    values: dict[str, str | None] = {}
    for name, scenes in played.items():
        other = [case for case in cases if scenes[case] != played[first][case]]
        keys = sorted({played[first][case].partition(" ")[0] for case in other})
        named = ", ".join(keys[:3]) + (", ..." if len(keys) > 3 else "")
        if not any(scenes[case] for case in cases):
            values[name] = None
        elif other:
            values[name] = f"{len(other)} of {counted(len(cases), 'case')} differ from {first!r}: {named}"
        else:
            values[name] = "recorded"
    return [Difference(SCENES, "setting", values)] if len({*values.values()}) > 1 else []


def _image_differences(sides: Mapping[str, Side]) -> list[Difference]:
    """Name the version of the images of each run, where they differ; None where a policy is shown none."""
    values = {
        name: images_of(side.run.provenance["substrate"])
        if side.policy is None or side.policy["cameras"]
        else None
        for name, side in sides.items()
    }
    different = len({*values.values()} - {None}) > 1
    return [Difference(_IMAGES, "setting", values)] if different else []


def _renderer_differences(sides: Mapping[str, Side]) -> list[Difference]:
    """Name what drew the images of each run, where runs differ; None where a run had none or does not say."""
    values = {name: "; ".join(side.renderers) or None for name, side in sides.items()}
    different = len({*values.values()} - {None}) > 1
    return [Difference(RENDERERS, "renderer", values)] if different else []


def require_names(asked: Iterable[str]) -> None:
    """Check names by which differences are to be accepted.

    Raises:
        OptionError: One is unknown; says which are known.
    """
    known = names()
    for name in asked:
        part, dot, rest = name.partition(".")
        if name not in known and not (dot and rest and part in (*_PARTS, _FINGERPRINTS)):
            raise OptionError(
                f"{name!r} is no setting in which runs can differ. {did_you_mean(name, known)} A single "
                f"field is written PART.FIELD, with one of the parts {', '.join((*_PARTS, _FINGERPRINTS))}."
            )


def measurement_differences(one: Run, other: Run, *, declared: bool = False) -> list[str]:
    """Return why two runs are two measurements, for example ``versions.numpy: '2.3', '2.4'``.

    Args:
        declared: True if both say by which weights their pairs were played (:func:`declare_weights`). Then
            the addresses of their servers may differ, because their records say whether the weights do.
    """
    served = all(is_served(run.provenance["policy"]["reference"]) for run in (one, other))
    tolerated: frozenset[Kind] = ONE_MEASUREMENT | ({"address"} if served and declared else set())
    found = differences_between({"one": Side(one), "other": Side(other)}, tolerated)
    texts = [str(difference) for difference in found]
    if served and found and not declared and all(difference.kind == "address" for difference in found):
        texts[-1] += (
            " (to play one measurement over other addresses, declare the weights: --libero-max-revision)"
        )
    return texts


def declare_weights(records: Iterable[PairRecord]) -> bool:
    """Return True if all records name the weights by which they were played, and not only a profile."""
    return all(declares_weights(str(record.policy.get("revision"))) for record in records)
