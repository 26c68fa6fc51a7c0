"""Simulation of one controller, one network file system and many workers, from parts that were measured.

Workers begin when the file system has given them what a process reads. Each plays one pair after another and
holds one more in its queue, as under xdist: it waits only where the controller has not yet answered the pair
before its last one. The controller takes in one record after another, first come, first served. The duration
of a pair is drawn from an exponential distribution, which is wider than what recorded runs show: the queue of
the controller is rather too long than too short.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

READ_MIB = 210.0
"""What a process reads before its first pair: 25 MiB by calls and 185 MiB of mapped libraries. Measured in a
process that had drawn and stepped one embedded scene, 2026-11-26."""

RECORD_MS, RECORD_RAY_MS = 1.4, 2.19
"""Processor time of the controller for a pair, median under xdist and the dearest run, which was under Ray:
``reports/controller.jsonl``."""

BEGIN_S, BEGIN_WORKER_S = 2.2, 0.017
"""Processor time of the controller until the first report of 8,000 pairs: a constant, and for each worker,
whose ids it compares; from the runs with 32 and 256 workers in the same file."""

END_MS = 0.9
"""Processor time of the reports at the end for each pair: 70 s for 80,000, ``reports/controller.md``."""


@dataclass(frozen=True)
class Scale:
    """Sizes of a run, and of what carries it."""

    workers: int
    pairs: int
    pair_s: float
    """Mean duration of a pair."""
    record_ms: float = RECORD_MS
    """Processor time of the controller for a pair."""
    files_mib_s: float = 1000.0
    """MiB that the network file system gives in a second, to all machines together."""
    workers_a_machine: int = 16
    """Workers of a machine read what one of them has read from its memory."""

    @property
    def read_s(self) -> float:
        """Seconds in which the file system gives every machine what a process reads."""
        machines = -(-self.workers // self.workers_a_machine)
        return machines * READ_MIB / self.files_mib_s


@dataclass(frozen=True)
class Simulated:
    """Course of a run."""

    read_s: float
    """Until every machine has read what a process needs."""
    begin_s: float
    """Until the controller has compared what the workers collected."""
    play_s: float
    """From the first pair to the last record."""
    end_s: float
    """For the reports."""
    idle: float
    """Share of the workers' time in which they wait for the controller, before the last pairs are given."""
    busy: float
    """Share of the play in which the controller takes in records."""
    delay_s: float
    """The longest time between the end of a pair and its record."""

    @property
    def first_limit(self) -> str:
        """Largest loss beside playing: ``controller``, ``file system``, ``start`` or ``reports``."""
        losses = {
            "controller": self.idle * self.play_s,
            "file system": self.read_s,
            "start": self.begin_s,
            "reports": self.end_s,
        }
        return max(losses, key=lambda name: losses[name])


def simulate(scale: Scale, seed: int = 195) -> Simulated:
    """Return the course of a run: its pairs in the order in which they end."""
    durations = np.random.Generator(np.random.PCG64(seed)).exponential(scale.pair_s, scale.pairs)
    record_s = scale.record_ms / 1000
    playing = [(float(durations[number]), number) for number in range(min(scale.workers, scale.pairs))]
    heapq.heapify(playing)
    given, free, delay, waited = len(playing), 0.0, 0.0, 0.0
    answered = dict.fromkeys(range(scale.workers), 0.0)
    while playing:
        end, worker = heapq.heappop(playing)
        free = max(free, end) + record_s
        delay = max(delay, free - end)
        if given < scale.pairs:
            # The pair in its queue was given with the answer to the pair before.
            begin = max(end, answered[worker])
            waited += begin - end
            heapq.heappush(playing, (begin + float(durations[given]), worker))
            given += 1
        answered[worker] = free
    return Simulated(
        read_s=scale.read_s,
        begin_s=BEGIN_S + BEGIN_WORKER_S * scale.workers,
        play_s=free,
        end_s=END_MS / 1000 * scale.pairs,
        idle=waited / (scale.workers * free),
        busy=scale.pairs * record_s / free,
        delay_s=delay,
    )


_HEADINGS = (
    *("Workers", "A pair", "Controller, ms a pair", "Read", "Begin", "Play", "Reports"),
    *("Workers wait", "Controller busy", "Longest delay", "Largest loss"),
)


def scale_lines(scales: list[Scale]) -> Iterator[str]:
    """Yield a Markdown table of simulated runs."""
    yield f"| {' | '.join(_HEADINGS)} |"
    yield "|" + " ---: |" * (len(_HEADINGS) - 1) + " --- |"
    for scale in scales:
        run = simulate(scale)
        seconds = (f"{value:.0f} s" for value in (run.read_s, run.begin_s, run.play_s, run.end_s))
        shares = f"{run.idle:.1%}", f"{run.busy:.0%}", f"{run.delay_s:.1f} s"
        sizes = f"{scale.workers:,}", f"{scale.pair_s:g} s", f"{scale.record_ms:g}"
        yield f"| {' | '.join((*sizes, *seconds, *shares, run.first_limit))} |"


def main() -> None:
    """Print the table of ``reports/scale.md``: 20 pairs for each worker."""
    scales = [
        Scale(workers, 20 * workers, pair_s, record_ms)
        for record_ms in (RECORD_MS, RECORD_RAY_MS)
        for workers in (100, 300, 1000, 3000)
        for pair_s in (1.0, 3.0, 10.0)
    ]
    for line in scale_lines(scales):
        print(line)


if __name__ == "__main__":
    main()
