"""Processor time of the process that owns a run, for each pair that its workers send.

    python -m tests.scripts.measure_controller --engine xdist --workers 2 8 32 64 --pairs 8000
    python -m tests.scripts.measure_controller --page

Each number of workers is a run of its own, on the ``tiny`` substrate with ``noop``. Two pairs are played
first, one of each variant; the workers then answer with the reports of these under the names of others: at
once, or after ``--pause`` seconds, as a worker that takes so long for a pair. All else is as in any run:
pytest, xdist or Ray, the store, the reports. What was measured is added to a file (``--output``), a line a
run. ``--page`` writes the page of that file, and its figure, beside it.

The module is also the plugin of pytest that measures, in the process that owns the run, or answers, in
those that play.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import pty
import resource
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Generator, Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from cProfile import Profile
from pathlib import Path
from statistics import quantiles
from types import ModuleType
from typing import Any

import pytest

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.manifests import load_manifest
from pytest_libero_max.benchmark.order import Order
from pytest_libero_max.plugin.collection import ITEM_PREFIX, PairItem
from pytest_libero_max.report.palette import GAIN, INK, LOSS, MUTED
from pytest_libero_max.report.writers import svg
from tests.scripts import answering_worker
from tests.scripts.answering_worker import FOLDER_VARIABLE, PAIRS_NAME, PAUSE_VARIABLE, REPORTS_NAME, Known

ROOT = Path(__file__).parents[2]
MEASURED = ROOT / "reports/controller.jsonl"

ENGINE_VARIABLE = "MEASURE_CONTROLLER_ENGINE"
ENGINES = ("xdist", "xdist-pytest", "ray")
"""Workers of xdist without pytest in them, with it, and actors of Ray, with it as well."""

PROFILE_VARIABLE = "MEASURE_CONTROLLER_PROFILE"
"""File for a profile of the main thread (cProfile), which makes it slower; unset: none."""

NUMBERS_NAME = "numbers.json"

_EVERY = 100
"""Pairs between two looks at the processor's clock, which asks the system about every thread."""


class Answers:
    """A plugin of a process that plays: answers with known reports.

    Args:
        known: The reports.
        pause_s: Time of a pair, s.
    """

    def __init__(self, known: Known, pause_s: float) -> None:
        self._known, self._pause_s = known, pause_s
        self._numbers: dict[str, int] = {}

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> bool | None:
        """Send the reports of the pair of the same variant under the name of this one."""
        if not isinstance(item, PairItem):
            return None
        hook = item.config.hook
        hook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
        time.sleep(self._pause_s)
        if not self._numbers:
            self._numbers = {other.nodeid: number for number, other in enumerate(item.session.items)}
        for data in self._known.reports(self._numbers[item.nodeid]):
            report = hook.pytest_report_from_serializable(config=item.config, data=data)
            report.start = report.stop = time.time()
            hook.pytest_runtest_logreport(report=report)
        hook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
        return True


class Recorder:
    """A plugin of a plain session: keeps the reports of its pairs."""

    def __init__(self, config: pytest.Config, folder: Path) -> None:
        self._config, self._path = config, folder / REPORTS_NAME
        self._reports: dict[str, list[Json]] = {}

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Keep a report as it would be sent."""
        hook = self._config.hook.pytest_report_to_serializable
        data = json.dumps(hook(config=self._config, report=report))  # at once: what it holds grows later
        self._reports.setdefault(report.nodeid[-2], []).append(json.loads(data))

    def pytest_sessionfinish(self) -> None:
        """Write them."""
        self._path.write_text(json.dumps(self._reports))


class LightWorkers:
    """A plugin of the process that owns a run: its workers of xdist are :mod:`.answering_worker`."""

    @pytest.hookimpl(optionalhook=True)
    def pytest_xdist_getremotemodule(self) -> ModuleType:
        return answering_worker


class Meter:
    """A plugin of the process that owns a run: measures what its pairs take."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / NUMBERS_NAME
        self._begun = time.perf_counter()
        self._first: tuple[float, float] | None = None
        self._last = (0.0, 0.0)
        self._delays_s: list[float] = []
        self._numbers: Json = {}

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_logreport(self, report: pytest.TestReport) -> Generator[None]:
        """Note the times before the first report and after each last one of a pair."""
        if self._first is None:
            self._first = time.process_time(), time.perf_counter()
            self._numbers |= {"start_cpu_s": self._first[0], "start_mib": resident_mib()}
            self._numbers["start_s"] = self._first[1] - self._begun
        yield
        if report.when == "call":
            self._delays_s.append(time.time() - report.stop)
            if len(self._delays_s) % _EVERY == 0:
                self._last = time.process_time(), time.perf_counter()

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtestloop(self) -> Generator[None, Any, Any]:
        """Note the memory before the reports of the run are written."""
        profile = os.environ.get(PROFILE_VARIABLE)
        profiler = Profile() if profile else None
        if profiler:
            profiler.enable()
        try:
            return (yield)
        finally:
            self._numbers["played_mib"] = resident_mib()
            if profiler and profile:
                profiler.disable()
                profiler.dump_stats(profile)

    def pytest_unconfigure(self) -> None:
        """Write what was measured."""
        assert self._first is not None
        pairs = len(self._delays_s) // _EVERY * _EVERY
        cpu_s, wall_s = (last - first for first, last in zip(self._first, self._last, strict=True))
        delays = quantiles(self._delays_s, n=100)
        children = resource.getrusage(resource.RUSAGE_CHILDREN)
        self._numbers |= {
            "pair_cpu_ms": 1e3 * cpu_s / pairs,
            "pairs_per_s": pairs / wall_s,
            "delay_median_ms": 1e3 * delays[49],
            "delay_p99_ms": 1e3 * delays[98],
            "end_cpu_s": time.process_time() - self._last[0],
            "end_mib": resident_mib(),
            "workers_cpu_s": children.ru_utime + children.ru_stime,
        }
        self._path.write_text(json.dumps(self._numbers))


def resident_mib() -> float:
    """The most memory that this process has had, MiB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def pytest_configure(config: pytest.Config) -> None:
    """Measure, answer or keep the reports: as the process is."""
    folder = Path(os.environ[FOLDER_VARIABLE])
    if not (folder / REPORTS_NAME).exists():
        config.pluginmanager.register(Recorder(config, folder))
    elif hasattr(config, "workerinput"):
        pause_s = float(os.environ[PAUSE_VARIABLE])
        config.pluginmanager.register(Answers(Known(folder), pause_s))
    else:
        config.pluginmanager.register(Meter(folder))
        if os.environ[ENGINE_VARIABLE] == "xdist":
            config.pluginmanager.register(LightWorkers())


def run(folder: Path, *arguments: str, terminal: bool = False) -> None:
    """Run pytest with this module as its plugin, in a folder of its own.

    Raises:
        subprocess.CalledProcessError: It did not pass.
    """
    command = [
        *(sys.executable, "-m", "pytest", "-p", __spec__.name, "-p", "no:cacheprovider"),
        *("--libero-max-policy=noop", "--libero-max-substrate=tiny", "--libero-max-output=run"),
        *arguments,
    ]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "TERM": "xterm"}
    with on_terminal() if terminal else nullcontext(sys.stderr.fileno()) as output:
        subprocess.run(command, cwd=folder, env=environment, check=True, stdout=output)


@contextmanager
def on_terminal() -> Iterator[int]:
    """Yield a file descriptor that a process takes for a terminal; what it writes is thrown away."""
    master, slave = pty.openpty()

    def read() -> None:
        with suppress(OSError):
            while os.read(master, 2**16):
                pass

    threading.Thread(target=read, daemon=True).start()
    try:
        yield slave
    finally:
        os.close(slave)


def measure(engine: str, workers: int, pairs: int, pause_s: float, *, terminal: bool) -> Json:
    """Return what one run measured."""
    from tests.plugin.conftest import tiny_manifest

    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        folder = Path(name)
        # Actors of Ray have the environment in which their cluster was started.
        os.environ |= {FOLDER_VARIABLE: name, PAUSE_VARIABLE: str(pause_s), ENGINE_VARIABLE: engine}
        distribution = stack.enter_context(cluster(engine, workers))
        (folder / "pytest.ini").write_text("[pytest]\n")
        for count, path in ((2, "two.json"), (pairs, "pairs.json")):
            cases = tiny_manifest(tuple(range(count // 2)), ("illumination_switch",))
            (folder / path).write_text(json.dumps(cases))
        run(folder, "--libero-max-manifest=two.json")
        write_pairs(folder)
        arguments = ("--libero-max-manifest=pairs.json", *distribution, "--libero-max-output=all")
        run(folder, *arguments, terminal=terminal)
        numbers: Json = json.loads((folder / NUMBERS_NAME).read_text())
        numbers["record_bytes"] = (folder / "all/pairs.jsonl").stat().st_size / pairs
    load = os.getloadavg()[0]
    asked = {"engine": engine, "workers": workers, "pairs": pairs, "pause_s": pause_s, "terminal": terminal}
    return {**asked, "load": load, **{name: round(value, 3) for name, value in numbers.items()}}


def write_pairs(folder: Path) -> None:
    """Write the names of all pairs, in the order of play and in lines of equal length."""
    cases = Order().of(load_manifest(folder / "pairs.json").cases)
    lines = [
        json.dumps(
            {
                "nodeid": f"{ITEM_PREFIX}{case.item_id}]",
                "case_id": case.case_id,
                "item_id": case.item_id,
                "case_digest": case.digest,
                "init_state_index": case.init_state_index,
                "policy_seed": case.policy_seed,
            }
        )
        for case in cases
    ]
    width = max(map(len, lines))
    (folder / PAIRS_NAME).write_text("".join(f"{line:{width}}\n" for line in lines))


@contextmanager
def cluster(engine: str, workers: int) -> Iterator[list[str]]:
    """Arguments that let the pairs be played by so many workers; with Ray, on a cluster of this machine."""
    if engine != "ray":
        yield ["-n", str(workers)]
        return
    import ray

    address = ray.init(num_cpus=workers, include_dashboard=False, log_to_driver=False)
    try:
        yield [
            f"--libero-max-ray={address.address_info['gcs_address']},actors={workers}",
        ]
    finally:
        ray.shutdown()


PAIRS_S = (1, 3, 10)
"""Times of a pair for which the page says how many workers are fed, s."""

AIM_WORKERS = 256
"""Workers with a pair a second that one controller is to feed."""

_HEAD = """\
# How many workers one controller feeds

    python -m tests.scripts.measure_controller --workers 2 8 32 64 256 --pairs 8000
    python -m tests.scripts.measure_controller --page

The controller is the process that owns a run: it hands out the pairs, takes in, checks and stores each
record, and writes the reports. Its processor time a pair bounds the workers that it can feed, whatever
they play. Workers here answer with the reports of a pair that was played before, under another name: at
once, or after a pause. Those of `xdist` are processes of their own on xdist's channels, but without pytest
in them, so that two cores can hold hundreds. Those of `xdist-pytest` and Ray are real sessions of pytest
in which only the play of a pair is left out.

Processor times are those of the whole controller, its threads included, between the first report and the
last. Measured on two cores; the load at the time of each run is in `controller.jsonl`. Where 10 to 50 other
processes were busy, pairs a second and delays are what was seen there, and not what an idle machine gives.
At a load of 4, 256 workers that take a second for a pair were fed: 256 pairs a second, each stored 0.2 s
after it ended; so were 64 with a quarter of a second. Ten times as many pairs cost as much processor time a
pair: 80,000 by 2 workers, whose reports and end took 70 s and 5 GB.

These 80,000 were measured before a run let go of its records when its summary is known. Until the process
ended, pytest and Python looked through all of them a dozen times: for 20,000 pairs 25 s, and 4 s since
then, at a load of 4 to 5; the most memory of such a run was 1.35 GB, and is 1.06.
"""

_TAIL = """
Start is the processor time until the first report: Python, the plan, and the ids that every worker sends.
Workers that answer at once are faster than the controller: the delay is then that of a queue, which
memory holds as well. With a pause, the delay is what a record waits until it is stored.

The first bottleneck was the line that shows the progress on a terminal. It was composed anew five times a
pair, and counted all pairs of the run each time: with 8,000 pairs it took twice as long as all else. It is
composed ten times a second now. The second was what every worker collects: the controller counted the
names of all pairs for each worker again, and kept them; with 256 workers that was half of the start, and
260 MiB. Then each record was read three times, where once is enough without a hook of a conftest.py: with
8 workers, in turn, 3 % of a pair. The same code takes up to half more from run to run, as caches and cores
are shared with other processes: compare runs that were made in turn.
"""


def page(rows: Sequence[Json]) -> str:
    """Return the page of what was measured, in Markdown."""
    dearest = max(row["pair_cpu_ms"] for row in rows if not row["before"])
    lines = [
        _HEAD,
        "![Processor time a pair by number of workers](controller.svg)",
        "",
        "| Code | Workers | | A pair takes them | Pairs | Written to | Start, s | A pair, ms "
        "| Memory: start, played, end, MiB | Pairs/s | Delay, median, s |",
        "| --- | ---: | --- | ---: | ---: | --- | ---: | ---: | ---: | ---: | ---: |",
        *map(_line, sorted(rows, key=_place)),
        "",
        _TAIL,
        f"The dearest run of the code as it is now took {dearest:.2f} ms a pair. On a core of its own:",
        "",
        "| A pair takes | Workers that one controller feeds |",
        "| ---: | ---: |",
        *(f"| {seconds} s | {int(1000 * seconds / dearest):,} |" for seconds in PAIRS_S),
        "",
    ]
    return "\n".join(lines)


def _place(row: Json) -> tuple[Any, ...]:
    return ENGINES.index(row["engine"]), row["pairs"], row["terminal"], row["workers"], row["before"]


def _line(row: Json) -> str:
    memory = ", ".join(f"{row[name]:,.0f}" for name in ("start_mib", "played_mib", "end_mib"))
    cells = (
        "before" if row["before"] else "now",
        row["workers"],
        row["engine"],
        f"{row['pause_s']:g} s" if row["pause_s"] else "nothing",
        f"{row['pairs']:,}",
        "a terminal" if row["terminal"] else "a file",
        f"{row['start_cpu_s']:.1f}",
        f"{row['pair_cpu_ms']:.2f}",
        memory,
        f"{row['pairs_per_s']:.0f}",
        f"{row['delay_median_ms'] / 1e3:.2f}",
    )
    return f"| {' | '.join(map(str, cells))} |"


def curve(rows: Sequence[Json]) -> str:
    """Return the processor time a pair by workers of xdist, with 8,000 pairs, as an SVG document."""
    chosen = [row for row in rows if (row["engine"], row["pairs"]) == ("xdist", 8000)]
    width, height, most = 560.0, 260.0, 5.0

    def place(workers: float, ms: float) -> tuple[float, float]:
        return 60 + 50 * math.log2(workers), height - 40 - (height - 70) * ms / most

    left, right = place(1, 0)[0], width - 20
    shapes = []
    for ms in range(int(most) + 1):
        y = place(1, ms)[1]
        shapes += [svg.line(left, y, right, y), svg.text(left - 8, y + 4, f"{ms} ms", "end")]
    for workers in sorted({row["workers"] for row in chosen}):
        shapes.append(svg.text(place(workers, 0)[0], height - 20, str(workers), "middle"))
    aim = 1000 / AIM_WORKERS
    y = place(1, aim)[1]
    shapes += [
        svg.line(left, y, right, y, LOSS),
        svg.text(right, y - 6, f"{AIM_WORKERS} workers, 1 s", "end"),
    ]
    for row in sorted(chosen, key=_place):
        x, y = place(row["workers"], row["pair_cpu_ms"])
        color = MUTED if row["before"] else GAIN
        shapes.append(svg.circle(x, y, 5, color if not row["terminal"] else "none", color))
    for number, (words, color, ring) in enumerate(
        (("now", GAIN, False), ("before", MUTED, False), ("on a terminal", INK, True))
    ):
        x = left + 20 + 110 * number
        shapes += [svg.circle(x, 14, 5, "none" if ring else color, color), svg.text(x + 10, 18, words)]
    return svg.document(width, height, "Processor time of the controller for a pair, by workers", shapes)


def read(path: Path) -> list[Json]:
    """Return what was measured, a run each."""
    return [json.loads(line) for line in path.read_text().splitlines()]


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure each number of workers, or write the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--engine", choices=ENGINES, default="xdist")
    parser.add_argument("--workers", type=int, nargs="+", default=[2, 8], metavar="N")
    parser.add_argument("--pairs", type=int, default=8000, metavar="N")
    parser.add_argument("--pause", type=float, default=0.0, metavar="S", help="Seconds of a pair")
    parser.add_argument("--terminal", action="store_true", help="Let the controller write to a terminal")
    parser.add_argument("--output", type=Path, default=MEASURED, metavar="PATH")
    parser.add_argument("--before", action="store_true", help="Call what is measured the code before")
    parser.add_argument("--page", action="store_true", help="Write the page and its figure instead")
    options = parser.parse_args(arguments)
    if options.page:
        rows = read(options.output)
        options.output.with_suffix(".md").write_text(page(rows))
        options.output.with_suffix(".svg").write_text(curve(rows))
        return
    for workers in options.workers:
        numbers = measure(options.engine, workers, options.pairs, options.pause, terminal=options.terminal)
        line = json.dumps({"before": options.before, **numbers})
        with options.output.open("a") as file:
            file.write(f"{line}\n")
        print(line, flush=True)


if __name__ == "__main__":
    main()
