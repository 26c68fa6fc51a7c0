"""The page of the Python API: public names, their signatures and what they are for."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import fields
from importlib import import_module
from typing import Any, NamedTuple

from tests.reference import COMMAND, PAGES
from tests.reference.docstrings import description, section, summary
from tests.reference.markdown import code, one_line, prose, table


class Public(NamedTuple):
    """What a module offers to other people's code.

    Attributes:
        text: What the module is for.
        names: The names, in the order of the page.
    """

    text: str
    names: tuple[str, ...]


ADAPTER = ("PolicySpec", "Policy", "Episode", "Query")
"""What an adapter imports from the package itself; these are described at length."""

MODULES: Mapping[str, Public] = {
    "pytest_libero_max.policies.contract": Public(
        "Policies, beyond what an adapter imports.",
        ("RemembersPolicy", "BatchPolicy", "BatchItem", "query_seed"),
    ),
    "pytest_libero_max.policies.loading": Public(
        "From the text of `--libero-max-policy` to a policy.", ("load_policy", "check_reference")
    ),
    "pytest_libero_max.policies.adapter_digest": Public("The code of an adapter.", ("adapter_digest",)),
    "pytest_libero_max.policies.check": Public(
        "The checks that the pair runner makes of a policy and its answers.",
        ("check_policy", "check_actions", "remembers"),
    ),
    "pytest_libero_max.policies.transforms.images": Public(
        "Pieces of adapters: images.",
        (
            "rotate_180",
            "flip_rows",
            "resize_with_pad",
            "resize_bilinear",
            "resize_bicubic",
            "resize_lanczos",
            "resize_area",
            "centre_crop",
            "jpeg_round_trip",
            "png_file",
            "side_by_side",
            "to_unit",
            "to_signed",
            "channels_first",
        ),
    ),
    "pytest_libero_max.policies.transforms.states": Public(
        "Pieces of adapters: the state of the robot.",
        (
            "axis_angle",
            "axis_angle_antipodal",
            "rotation_matrix",
            "rotation_6d_columns",
            "rotation_6d_rows",
            "grip_site_quaternion",
            "sine_cosine",
            "pad_to",
            "first",
            "entry",
        ),
    ),
    "pytest_libero_max.policies.transforms.actions": Public(
        "Pieces of adapters: actions.",
        (
            "first_columns",
            "clip",
            "gripper_from_opening",
            "gripper_from_open_flag",
            "gripper_from_close_flag",
            "gripper_sign",
            "gripper_inverted",
            "gripper_flag_below_half",
            "pose_from_rotation_6d",
            "Statistics",
            "unnormalise",
            "read_statistics",
        ),
    ),
    "pytest_libero_max.benchmark.cases": Public(
        "Cases: the frozen units of the benchmark.", ("Case", "Event", "parse_case")
    ),
    "pytest_libero_max.benchmark.manifests": Public(
        "Manifests: files of cases.", ("Manifest", "load_manifest", "parse_manifest")
    ),
    "pytest_libero_max.benchmark.tracks": Public(
        "The tracks that are installed with the package.", ("track_names", "load_track")
    ),
    "pytest_libero_max.benchmark.sampling": Public("Smaller sets of cases.", ("stratified",)),
    "pytest_libero_max.benchmark.identity": Public(
        "The identity of a configuration: the source of all its seeds.", ("Identity",)
    ),
    "pytest_libero_max.benchmark.records": Public("Cases as manifests spell them.", ("case_record",)),
    "pytest_libero_max.tasks.contents": Public("What a task contains.", ("TaskMetadata", "task_metadata")),
    "pytest_libero_max.events.kind": Public("What an event is.", ("EventKind", "Scenario")),
    "pytest_libero_max.events.registry": Public(
        "The events by name.", ("resolve_event", "eligible_events", "families")
    ),
    "pytest_libero_max.events.triggers": Public("When something happens.", ("Trigger", "Moment", "register")),
    "pytest_libero_max.events.schedules": Public(
        "What happens in an arm.", ("Arm", "Entry", "Revert", "arms_of", "schedule_from_list")
    ),
    "pytest_libero_max.substrates.registry": Public("Substrates by name.", ("open_substrate",)),
    "pytest_libero_max.substrates.contract": Public(
        "The contract of a substrate.", ("Substrate", "SubstrateKind", "SubstrateOptions", "Catalogue")
    ),
    "pytest_libero_max.worlds.contract": Public(
        "The contract of a world.",
        ("World", "WorldState", "Entity", "PixelFilter"),
    ),
    "pytest_libero_max.changes": Public(
        "Changes of a world.", ("Change", "Evidence", "change_from_dict", "check_changes")
    ),
    "pytest_libero_max.pairing.runner": Public(
        "Playing a pair, or a part of it, without pytest.",
        ("play_pair", "measure_pair", "play_prefix", "inject", "continue_rollout", "PairSettings", "Pair"),
    ),
    "pytest_libero_max.pairing.record": Public("What is kept of a pair.", ("PairRecord", "PairError")),
    "pytest_libero_max.runs.store": Public("Reading `pairs.jsonl`.", ("read_pairs", "StoredRun")),
    "pytest_libero_max.report.build": Public("From records to the report.", ("build_report",)),
    "pytest_libero_max.report.gates": Public(
        "Conditions on a report.", ("Gate", "GateResult", "parse_gate", "evaluate")
    ),
    "pytest_libero_max.strategies": Public(
        "Hypothesis strategies, for tests of events, changes, worlds and policies.",
        (
            "strengths",
            "changes",
            "events",
            "cases",
            "varied_cases",
            "manifests",
            "actions",
            "action_sequences",
            "scripted_policies",
        ),
    ),
    "pytest_libero_max.errors": Public(
        "The exceptions that the package raises.",
        (
            "LiberoMaxError",
            "OptionError",
            "ManifestError",
            "AdapterError",
            "ActionError",
            "ServerError",
            "ChangeError",
            "SubstrateError",
            "EntityError",
            "SimulatorError",
            "ProtocolError",
            "ReportError",
        ),
    ),
}
"""The modules with public names, in the order of the page."""


ENTRY_POINTS = (
    ("`pytest_libero_max.events`", "a subclass of `EventKind`, under the name of the event"),
    ("`pytest_libero_max.changes`", "a class of changes, under the name of its operation"),
    ("`pytest_libero_max.substrates`", "a `SubstrateKind`, under its name"),
    ("`pytest_libero_max.policies`", "a policy, or a class or function that makes one"),
)
"""The entry-point groups and what each expects."""


def page() -> str:
    """The text."""
    pages = table(
        ("Page", "Written by"),
        (
            (f"[{name}]({name})", f"[`{module}.py`](../tests/reference/{module}.py)")
            for name, module in PAGES.items()
        ),
    )
    package = import_module("pytest_libero_max")
    adapter = "\n\n".join(_class(getattr(package, name)) for name in ADAPTER)
    modules = "\n\n".join(_module(name, public) for name, public in MODULES.items())
    return f"""# Reference

`{COMMAND}` writes these pages from the code. A test fails when one of them is not what the code says.

{pages}

## Entry points

Another package adds these without a change of this one. This [example](../tests/plugin/example_package)
adds an event and a change.

{table(("Group", "An entry is"), ENTRY_POINTS)}

# The Python API

The names on this page are public: they change only with a line in the [changelog](../CHANGELOG.md). Every
other name is internal.

## `pytest_libero_max`

What an adapter imports.

{adapter}

{modules}
"""


def _class(cls: type[Any]) -> str:
    texts = section(cls, "Attributes")
    rows = [
        (code(item.name), code(item.type), one_line(texts.get(item.name, "")))
        for item in (fields(cls) if hasattr(cls, "__dataclass_fields__") else ())
    ]
    methods = [
        (code(name + _signature(value)), one_line(summary(value)))
        for name, value in vars(cls).items()
        if inspect.isfunction(value) and not name.startswith("_") and inspect.getdoc(value)
    ]
    tables = [table(("Field", "Type", "Meaning"), rows)] if rows else []
    tables += [table(("Method", "Meaning"), methods)] if methods else []
    return "\n\n".join([f"### {cls.__name__}", prose(description(cls)), *tables])


def _module(name: str, public: Public) -> str:
    module = import_module(name)
    found = [(name, getattr(module, name)) for name in public.names]
    rows = [(code(name + _signature(value)), one_line(summary(value))) for name, value in found]
    return f"## `{module.__name__}`\n\n{public.text}\n\n{table(('Name', 'Meaning'), rows)}"


def _signature(value: Any) -> str:
    """Of a function; nothing for a class, whose fields or methods are described elsewhere."""
    if inspect.isclass(value):
        return ""
    signature = inspect.signature(value)
    parameters = [_parameter(item) for item in signature.parameters.values() if item.name != "self"]
    keyword_only = [item.kind is item.KEYWORD_ONLY for item in signature.parameters.values()]
    if any(keyword_only):
        parameters.insert(keyword_only.index(True), "*")
    returns = "" if signature.return_annotation == inspect.Signature.empty else signature.return_annotation
    return f"({', '.join(parameters)})" + (f" -> {returns}" if returns else "")


def _parameter(parameter: inspect.Parameter) -> str:
    text = f"{parameter.name}: {parameter.annotation}"
    if parameter.default is inspect.Parameter.empty:
        return text
    plain = parameter.default is None or isinstance(parameter.default, bool | int | float | str)
    return f"{text} = {parameter.default!r}" if plain else f"{text} = ..."
