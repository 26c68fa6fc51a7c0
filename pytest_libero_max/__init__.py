"""LIBERO-MAX as a pytest plugin: does a policy still finish when the world changes while it acts?

The names here, and those in the modules among them (``changes``, ``conformance``, ``errors``, ``probes``,
``strategies``, ``transforms``, ``triggers``), are the public interface: they change only with a line in the
changelog. Every other module may move. A name is imported on first use, because pytest loads this package in
every session of everybody who has it installed.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pytest_libero_max import changes, conformance, errors, probes, strategies, transforms, triggers
    from pytest_libero_max.benchmark.cases import Case
    from pytest_libero_max.benchmark.identity import Identity
    from pytest_libero_max.benchmark.latency import Latency
    from pytest_libero_max.benchmark.manifests import Manifest, load_manifest
    from pytest_libero_max.benchmark.suites import Suite
    from pytest_libero_max.benchmark.tracks import load_track
    from pytest_libero_max.changes.change import Change, Evidence
    from pytest_libero_max.errors import LiberoMaxError
    from pytest_libero_max.evaluation.evaluate import Evaluation, evaluate
    from pytest_libero_max.events.kind import EventKind, Scenario
    from pytest_libero_max.events.new_case import make_case
    from pytest_libero_max.events.schedules import Arm, Entry, Revert, program_of
    from pytest_libero_max.events.triggers import Moment, Trigger
    from pytest_libero_max.pairing.environment import ArmEnv
    from pytest_libero_max.pairing.probes.probe import Probe
    from pytest_libero_max.pairing.record import PairError, PairRecord
    from pytest_libero_max.pairing.runner import (
        PairSettings,
        continue_rollout,
        inject,
        measure_in_step,
        measure_pair,
        play_pair,
        play_prefix,
        return_to,
    )
    from pytest_libero_max.policies.clients.protocol import Opening, ServerProtocol
    from pytest_libero_max.policies.contract import (
        BatchItem,
        Episode,
        Handover,
        Policy,
        PolicySpec,
        Query,
    )
    from pytest_libero_max.policies.loading import load_policy
    from pytest_libero_max.report.build import build_report
    from pytest_libero_max.report.gates import evaluate_gate, parse_gate
    from pytest_libero_max.report.measures import Measured
    from pytest_libero_max.report.readers import PairOutcome, ReadResults, ResultsReader
    from pytest_libero_max.report.sections import PlayedPairs, ReportSection
    from pytest_libero_max.report.stopping_rule import StoppingRule
    from pytest_libero_max.runs.plan import PlannedPair
    from pytest_libero_max.runs.store import read_pairs
    from pytest_libero_max.studies.study import Study
    from pytest_libero_max.substrates.contract import Substrate, SubstrateKind, SubstrateOptions, Tracks
    from pytest_libero_max.substrates.registry import open_substrate
    from pytest_libero_max.substrates.tiny.world import TinyWorld
    from pytest_libero_max.tasks.contents import InitialPlacement, Relation, TaskMetadata
    from pytest_libero_max.worlds.base import WorldBase
    from pytest_libero_max.worlds.contract import AlterableWorld, Entity, World, WorldState
    from pytest_libero_max.worlds.mujoco_world import MujocoWorld
    from pytest_libero_max.worlds.robot import MujocoRobot, Robot
    from pytest_libero_max.worlds.scenery import CameraView, Lights, Surfaces

__all__ = [
    "AlterableWorld",
    "Arm",
    "ArmEnv",
    "BatchItem",
    "CameraView",
    "Case",
    "Change",
    "Entity",
    "Entry",
    "Episode",
    "Evaluation",
    "EventKind",
    "Evidence",
    "Handover",
    "Identity",
    "InitialPlacement",
    "Latency",
    "LiberoMaxError",
    "Lights",
    "Manifest",
    "Measured",
    "Moment",
    "MujocoRobot",
    "MujocoWorld",
    "Opening",
    "PairError",
    "PairOutcome",
    "PairRecord",
    "PairSettings",
    "PlannedPair",
    "PlayedPairs",
    "Policy",
    "PolicySpec",
    "Probe",
    "Query",
    "ReadResults",
    "Relation",
    "ReportSection",
    "ResultsReader",
    "Revert",
    "Robot",
    "Scenario",
    "ServerProtocol",
    "StoppingRule",
    "Study",
    "Substrate",
    "SubstrateKind",
    "SubstrateOptions",
    "Suite",
    "Surfaces",
    "TaskMetadata",
    "TinyWorld",
    "Tracks",
    "Trigger",
    "World",
    "WorldBase",
    "WorldState",
    "build_report",
    "changes",
    "conformance",
    "continue_rollout",
    "errors",
    "evaluate",
    "evaluate_gate",
    "inject",
    "load_manifest",
    "load_policy",
    "load_track",
    "make_case",
    "measure_in_step",
    "measure_pair",
    "open_substrate",
    "parse_gate",
    "play_pair",
    "play_prefix",
    "probes",
    "program_of",
    "read_pairs",
    "return_to",
    "strategies",
    "transforms",
    "triggers",
]

_TO_USE = {
    "evaluation.evaluate": ("evaluate", "Evaluation"),
    "policies.contract": ("PolicySpec", "Policy", "Episode", "Handover", "Query", "BatchItem"),
    "policies.loading": ("load_policy",),
    "benchmark.cases": ("Case",),
    "benchmark.manifests": ("Manifest", "load_manifest"),
    "benchmark.tracks": ("load_track",),
    "events.new_case": ("make_case",),
    "substrates.registry": ("open_substrate",),
    "substrates.tiny.world": ("TinyWorld",),
    "pairing.runner": (
        "play_pair",
        "measure_pair",
        "measure_in_step",
        "PairSettings",
        "play_prefix",
        "inject",
        "return_to",
        "continue_rollout",
    ),
    "pairing.environment": ("ArmEnv",),
    "benchmark.latency": ("Latency",),
    "events.schedules": ("Arm", "Entry", "Revert", "program_of"),
    "pairing.record": ("PairRecord", "PairError"),
    "runs.store": ("read_pairs",),
    "report.build": ("build_report",),
    "report.gates": ("parse_gate", "evaluate_gate"),
    "errors": ("LiberoMaxError",),
}
"""Names for adapters, and for playing and reading pairs in Python, by the module that defines them."""

_TO_EXTEND = {
    "events.kind": ("EventKind", "Scenario"),
    "benchmark.identity": ("Identity",),
    "tasks.contents": ("TaskMetadata", "Relation", "InitialPlacement"),
    "changes.change": ("Change", "Evidence"),
    "events.triggers": ("Trigger", "Moment"),
    "pairing.probes.probe": ("Probe",),
    "studies.study": ("Study",),
    "report.stopping_rule": ("StoppingRule",),
    "report.sections": ("ReportSection", "PlayedPairs"),
    "report.measures": ("Measured",),
    "report.readers": ("ResultsReader", "ReadResults", "PairOutcome"),
    "runs.plan": ("PlannedPair",),
    "substrates.contract": ("Substrate", "SubstrateKind", "SubstrateOptions", "Tracks"),
    "benchmark.suites": ("Suite",),
    "worlds.contract": ("World", "WorldState", "Entity", "AlterableWorld"),
    "worlds.robot": ("Robot", "MujocoRobot"),
    "worlds.base": ("WorldBase",),
    "worlds.mujoco_world": ("MujocoWorld",),
    "worlds.scenery": ("CameraView", "Lights", "Surfaces"),
    "policies.clients.protocol": ("ServerProtocol", "Opening"),
}
"""Names for packages that add something, by the module that defines them."""

_MODULE_OF = {
    name: module for homes in (_TO_USE, _TO_EXTEND) for module, names in homes.items() for name in names
}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if name not in _MODULE_OF:
        return import_module(f"{__name__}.{name}")
    value = getattr(import_module(f"{__name__}.{_MODULE_OF[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
