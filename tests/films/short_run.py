"""A run of one short pair in a tiny world that is drawn fast, and what made it."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import pytest

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.manifests import load_manifest
from pytest_libero_max.events.schedules import Arm, arms_of
from pytest_libero_max.pairing.probes.registry import probes_called
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.pairing.runner import Pair, PairSettings, measure_pair
from pytest_libero_max.pairing.trace import ArmTrace, traces_of, write_trace
from pytest_libero_max.policies.contract import Policy
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.store import PairStore
from pytest_libero_max.substrates.tiny import world as tiny
from tests.pairing.actors import Approaching
from tests.plugin.conftest import tiny_manifest
from tests.report.made_up import PROVENANCE
from tests.short_episodes import shorten_here

BUDGET = 8
SIZE = 32


def leave_out_shadows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let tiny worlds have no shadows, which take ten times the time of everything else in a picture."""
    mjcf = tiny._MJCF.replace("<light name", '<light castshadow="false" name')
    monkeypatch.setattr(tiny, "_MJCF", mjcf)


def shorten_episodes(monkeypatch: pytest.MonkeyPatch) -> None:
    shorten_here(monkeypatch, BUDGET)


@dataclass(frozen=True, eq=False)
class Played:
    """A pair that has been measured: target_relocation after 4 of 8 steps, with two stale actions."""

    case: Case
    world: tiny.TinyWorld
    pair: Pair

    @property
    def record(self) -> PairRecord:
        return self.pair.record

    @property
    def traces(self) -> dict[str, ArmTrace]:
        return traces_of(self.pair)


def play(
    folder: Path,
    arms: tuple[Arm, ...] | None = None,
    wait: int = 0,
    policy: Policy | None = None,
    event: str = "target_relocation",
    films: bool = False,
    probes: tuple[str, ...] = (),
) -> Played:
    """Play the first case of a manifest of tiny cases, which is written into the folder."""
    manifest = folder / "tiny.json"
    manifest.write_text(json.dumps(tiny_manifest(events=(event,))))
    case = load_manifest(manifest).cases[0]
    world = tiny.TinyWorld()
    policy = Approaching(wait, horizon=5, interval=3) if policy is None else policy
    settings = PairSettings(
        fingerprints=tiny.TinySubstrate().fingerprint(), films=films, probes=probes_called(probes)
    )
    return Played(case, world, measure_pair(case, world, policy, settings, arms=arms or arms_of(case)))


def store(played: Played, folder: Path, manifest: Path, *, trace: bool = True) -> Path:
    """Write the run of a pair as the plugin does."""
    provenance = {
        **PROVENANCE,
        "substrate": {"name": "tiny"},
        "case_set": {**PROVENANCE["case_set"], "name": f"manifest {manifest.name}", "path": str(manifest)},
    }
    pairs = PairStore(folder, Run.of([played.case], provenance))
    pairs.append(played.record)
    pairs.close()
    if trace:
        write_trace(folder / "traces", played.pair)
    return folder
