"""Probes: read-only measurements of every arm while it is played, and the types for probes of your own."""

from __future__ import annotations

from pytest_libero_max.pairing.probes.monitor import Monitor
from pytest_libero_max.pairing.probes.probe import Column, Probe, Probes, View
from pytest_libero_max.pairing.probes.registry import probes_called
from pytest_libero_max.pairing.trajectory import QueryResult, Step, Trajectory

__all__ = [
    "Column",
    "Monitor",
    "Probe",
    "Probes",
    "QueryResult",
    "Step",
    "Trajectory",
    "View",
    "probes_called",
]
