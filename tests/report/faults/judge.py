"""Play faulty policies and judge the causes that the report gives them.

python -m tests.report.faults.judge first --pairs 4
python -m tests.report.faults.judge first --records FOLDER      # judge again what was played
"""

from __future__ import annotations

import argparse
import importlib
import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pytest_libero_max.errors import LiberoMaxError
from pytest_libero_max.events.new_case import make_case
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.pairing.runner import play_pair
from pytest_libero_max.report.diagnosis import diagnose
from pytest_libero_max.substrates.embedded.substrate import EmbeddedSubstrate
from tests.report.faults.faulty import Fault, Faulty


@dataclass(frozen=True)
class Played:
    """A failure of a fault.

    Attributes:
        fault: Name of the fault.
        arm: The arm to judge: ``dynamic`` of a regression, ``base`` where the policy is always broken.
        accepted: Causes that are right.
        record: The pair.
    """

    fault: str
    arm: str
    accepted: frozenset[str]
    record: PairRecord


def play(fault: Fault, pairs: int, seed: int, substrate: Any, always: bool = False) -> Iterator[Played]:
    """Play a fault until it has failed in some pairs, in another task, event, variant and start each time."""
    found = 0
    for turn in range(3 * pairs):
        task = fault.tasks[turn % len(fault.tasks)]
        event = fault.events[turn % len(fault.events)]
        try:
            case = make_case(event, *task, init_state_index=(seed + turn) % 10, variant=turn % 2)
        except LiberoMaxError:
            continue
        policy = Faulty(fault, seed + turn, always)
        record = play_pair(case, substrate.world(case), policy)
        arm = "base" if always else "dynamic"
        if record.arms[arm].success or (not always and not record.base_success):
            continue
        yield Played(fault.name, arm, policy.memory.get("truth", fault.accepted), record)
        found += 1
        if found == pairs:
            return


def verdicts(played: Iterator[Played]) -> Iterator[tuple[Played, str, str, bool]]:
    """Judge played failures: cause, sentence, and True where the cause is an accepted one."""
    for item in played:
        why = diagnose(item.record, item.arm)
        assert why is not None
        yield item, why.cause, why.sentence, why.cause in item.accepted


def main() -> None:
    """Play and judge a set of faults."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("faults", help="module of this folder: first or second")
    parser.add_argument("--pairs", type=int, default=4)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--always", action="store_true", help="broken from the first step on; judge Base")
    parser.add_argument("--only", default="")
    parser.add_argument("--records", type=Path, help="folder to keep what was played, or to judge it again")
    options = parser.parse_args()
    faults = [
        fault
        for fault in importlib.import_module(f"tests.report.faults.{options.faults}").FAULTS
        if options.only in fault.name
    ]
    results = [*verdicts(_played(faults, options))]
    for fault in faults:
        mine = [entry for entry in results if entry[0].fault == fault.name]
        right = sum(entry[3] for entry in mine)
        print(f"{fault.name:28} {right} of {len(mine)}  {dict(Counter(entry[1] for entry in mine))}")
        for item, cause, sentence, fits in mine:
            if not fits:
                print(
                    f"    {item.record.item_id}: {cause}, not {'/'.join(sorted(item.accepted))}: {sentence}"
                )
    print(f"{sum(entry[3] for entry in results)} of {len(results)}")


def _played(faults: list[Fault], options: argparse.Namespace) -> Iterator[Played]:
    substrate = EmbeddedSubstrate()
    try:
        for fault in faults:
            file = (
                options.records
                and options.records / f"{fault.name}-{options.seed}{'-always' * options.always}.jsonl"
            )
            if file and file.is_file():
                for line in file.read_text().splitlines():
                    stored = json.loads(line)
                    accepted = frozenset(stored["truth"] or fault.accepted)
                    yield Played(fault.name, stored["arm"], accepted, PairRecord.from_dict(stored["record"]))
                continue
            items = [*play(fault, options.pairs, options.seed, substrate, options.always)]
            if file:
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text(
                    "".join(
                        json.dumps(
                            {
                                "arm": i.arm,
                                "truth": sorted(i.accepted) if i.accepted != fault.accepted else None,
                                "record": i.record.to_dict(),
                            }
                        )
                        + "\n"
                        for i in items
                    )
                )
            yield from items
    finally:
        substrate.close()


if __name__ == "__main__":
    main()
