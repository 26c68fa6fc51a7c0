"""Interaction of two changes: ``python -m tests.scripts.interaction RUN`` reads a run of ``compound``.

Over the same cases, success with both changes less that with the light alone, less the same of the event
alone and Base. Below zero the two together cost more than the sum of both. The interval is the one that
reports use for differences of differences.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from pytest_libero_max.lab.studies.camera.blocks import ConditionContrast
from pytest_libero_max.lab.studies.camera.conditions import Conditions, contrasts_of_contrasts
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.formats import change_text
from pytest_libero_max.runs.store import read_pairs

ARMS = ("base", "event", "light", "dynamic")
"""Neither, each alone, both."""


def interaction(records: tuple[PairRecord, ...]) -> ConditionContrast:
    """Return (both - light) - (event - neither)."""
    successes = {name: np.array([bool(record.arms[name].success) for record in records]) for name in ARMS}
    configuration = np.array([record.configuration for record in records])
    source = np.array([record.source for record in records])
    conditions = Conditions(successes, source, task=configuration, configuration=configuration)
    pair = ("dynamic", "light"), ("event", "base")
    (found,) = contrasts_of_contrasts(conditions, [pair], [("both - light", "event - neither")])
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path)
    records = tuple(read_pairs(parser.parse_args().run).records)
    for name in ARMS:
        print(f"{name:<8} {sum(record.arms[name].success for record in records)}/{len(records)}")
    found = interaction(records)
    print(f"interaction above 0 in {found.gains}, below 0 in {found.losses} of {len(records)} cases")
    print(f"interaction {change_text(found)}")


if __name__ == "__main__":
    main()
