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
    from pytest_libero_max import changes as changes
    from pytest_libero_max import conformance as conformance
    from pytest_libero_max import errors as errors
    from pytest_libero_max import probes as probes
    from pytest_libero_max import strategies as strategies
    from pytest_libero_max import transforms as transforms
    from pytest_libero_max import triggers as triggers
    from pytest_libero_max.benchmark.cases import Case as Case
    from pytest_libero_max.benchmark.identity import Identity as Identity
    from pytest_libero_max.benchmark.latency import Latency as Latency
    from pytest_libero_max.benchmark.manifests import Manifest as Manifest
    from pytest_libero_max.benchmark.manifests import load_manifest as load_manifest
    from pytest_libero_max.benchmark.suites import Suite as Suite
    from pytest_libero_max.benchmark.tracks import load_track as load_track
    from pytest_libero_max.changes.change import Change as Change
    from pytest_libero_max.changes.change import Evidence as Evidence
    from pytest_libero_max.errors import LiberoMaxError as LiberoMaxError
    from pytest_libero_max.evaluation.evaluate import Evaluation as Evaluation
    from pytest_libero_max.evaluation.evaluate import evaluate as evaluate
    from pytest_libero_max.events.kind import EventKind as EventKind
    from pytest_libero_max.events.kind import Scenario as Scenario
    from pytest_libero_max.events.new_case import make_case as make_case
    from pytest_libero_max.events.schedules import Arm as Arm
    from pytest_libero_max.events.schedules import Entry as Entry
    from pytest_libero_max.events.schedules import Revert as Revert
    from pytest_libero_max.events.schedules import program_of as program_of
    from pytest_libero_max.events.triggers import Moment as Moment
    from pytest_libero_max.events.triggers import Trigger as Trigger
    from pytest_libero_max.pairing.environment import ArmEnv as ArmEnv
    from pytest_libero_max.pairing.probes.probe import Probe as Probe
    from pytest_libero_max.pairing.record import PairError as PairError
    from pytest_libero_max.pairing.record import PairRecord as PairRecord
    from pytest_libero_max.pairing.runner import PairSettings as PairSettings
    from pytest_libero_max.pairing.runner import continue_rollout as continue_rollout
    from pytest_libero_max.pairing.runner import inject as inject
    from pytest_libero_max.pairing.runner import measure_in_step as measure_in_step
    from pytest_libero_max.pairing.runner import measure_pair as measure_pair
    from pytest_libero_max.pairing.runner import play_pair as play_pair
    from pytest_libero_max.pairing.runner import play_prefix as play_prefix
    from pytest_libero_max.pairing.runner import return_to as return_to
    from pytest_libero_max.policies.clients.protocol import Opening as Opening
    from pytest_libero_max.policies.clients.protocol import ServerProtocol as ServerProtocol
    from pytest_libero_max.policies.contract import BatchItem as BatchItem
    from pytest_libero_max.policies.contract import Episode as Episode
    from pytest_libero_max.policies.contract import Handover as Handover
    from pytest_libero_max.policies.contract import Policy as Policy
    from pytest_libero_max.policies.contract import PolicySpec as PolicySpec
    from pytest_libero_max.policies.contract import Query as Query
    from pytest_libero_max.policies.loading import load_policy as load_policy
    from pytest_libero_max.report.build import build_report as build_report
    from pytest_libero_max.report.gates import evaluate_gate as evaluate_gate
    from pytest_libero_max.report.gates import parse_gate as parse_gate
    from pytest_libero_max.report.measures import Measured as Measured
    from pytest_libero_max.report.readers import PairOutcome as PairOutcome
    from pytest_libero_max.report.readers import ReadResults as ReadResults
    from pytest_libero_max.report.readers import ResultsReader as ResultsReader
    from pytest_libero_max.report.report_section import PlayedPairs as PlayedPairs
    from pytest_libero_max.report.report_section import ReportSection as ReportSection
    from pytest_libero_max.report.stopping_rule import StoppingRule as StoppingRule
    from pytest_libero_max.runs.plan import PlannedPair as PlannedPair
    from pytest_libero_max.runs.store import read_pairs as read_pairs
    from pytest_libero_max.studies.study import Study as Study
    from pytest_libero_max.substrates.contract import Substrate as Substrate
    from pytest_libero_max.substrates.contract import SubstrateKind as SubstrateKind
    from pytest_libero_max.substrates.contract import SubstrateOptions as SubstrateOptions
    from pytest_libero_max.substrates.contract import Tracks as Tracks
    from pytest_libero_max.substrates.registry import open_substrate as open_substrate
    from pytest_libero_max.substrates.tiny.world import TinyWorld as TinyWorld
    from pytest_libero_max.tasks.contents import InitialPlacement as InitialPlacement
    from pytest_libero_max.tasks.contents import Relation as Relation
    from pytest_libero_max.tasks.contents import TaskMetadata as TaskMetadata
    from pytest_libero_max.worlds.base import WorldBase as WorldBase
    from pytest_libero_max.worlds.contract import AlterableWorld as AlterableWorld
    from pytest_libero_max.worlds.contract import Entity as Entity
    from pytest_libero_max.worlds.contract import World as World
    from pytest_libero_max.worlds.contract import WorldState as WorldState
    from pytest_libero_max.worlds.mujoco_world import MujocoWorld as MujocoWorld
    from pytest_libero_max.worlds.robot import MujocoRobot as MujocoRobot
    from pytest_libero_max.worlds.robot import Robot as Robot
    from pytest_libero_max.worlds.scenery import CameraView as CameraView
    from pytest_libero_max.worlds.scenery import Lights as Lights
    from pytest_libero_max.worlds.scenery import Surfaces as Surfaces

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
    "report.report_section": ("ReportSection", "PlayedPairs"),
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

_MODULES = ("changes", "conformance", "errors", "probes", "strategies", "transforms", "triggers")

_MODULE_OF = {
    name: module for homes in (_TO_USE, _TO_EXTEND) for module, names in homes.items() for name in names
}

__all__ = sorted([*_MODULES, *_MODULE_OF])


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
