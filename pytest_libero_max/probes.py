"""Probes: what is read of every arm while it is played, and what a probe of your own needs."""

from __future__ import annotations

from pytest_libero_max.pairing.probes.probe import Column, Probe, Probes, View
from pytest_libero_max.pairing.probes.registry import probes_called
from pytest_libero_max.pairing.trajectory import QueryResult, Step, Trajectory

__all__ = ["Column", "Probe", "Probes", "QueryResult", "Step", "Trajectory", "View", "probes_called"]
