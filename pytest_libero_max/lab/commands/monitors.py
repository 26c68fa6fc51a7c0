"""``libero-max lab monitors``: failure monitors scored over the recorded pairs of a run."""

from __future__ import annotations

import argparse
from pathlib import Path

from pytest_libero_max.benchmark.documents import printable
from pytest_libero_max.cli.arguments import Commands, add_libero, option
from pytest_libero_max.cli.terminal import say
from pytest_libero_max.cli.work import Work
from pytest_libero_max.errors import OptionError


def add_command(commands: Commands) -> None:
    """Add ``monitors`` to the parser."""
    monitors = commands.add_parser(
        "monitors",
        help="Score failure monitors over the recorded pairs of a run",
        description="The run must have kept traces (--libero-max-traces=all). Its policy is not asked, and "
        "nothing is written. Monitors that look at answers alone get the recorded ones; for those that look "
        "at images, which each table names, the recorded positions are drawn again.",
    )
    monitors.add_argument("run_folder", type=Path, metavar="RUN", help="The output folder of the run")
    monitors.add_argument(
        "monitors", nargs="+", metavar="MONITOR", help="Names of monitors, for example chunk_change"
    )
    option(monitors, "--cases TRACK|MANIFEST", "The cases of the run, if it played no frozen track")
    add_libero(monitors)
    monitors.set_defaults(run=_monitors)


def _monitors(options: argparse.Namespace) -> None:
    from pytest_libero_max.films.recorded import open_recorded
    from pytest_libero_max.lab.monitored import scored
    from pytest_libero_max.lab.sections.monitors import Monitors
    from pytest_libero_max.pairing.probes.monitor import Monitor
    from pytest_libero_max.pairing.probes.registry import PROBES
    from pytest_libero_max.report.measures import rows_table, rows_without_intervals
    from pytest_libero_max.report.render.terminal import table_lines
    from pytest_libero_max.report.sections import PlayedPairs
    from pytest_libero_max.worlds.threads import use_one_blas_thread

    use_one_blas_thread()  # as in a run
    chosen = {f"Monitor {name}": PROBES[name] for name in dict.fromkeys(options.monitors)}
    monitors = [probe for probe in chosen.values() if isinstance(probe, Monitor)]
    for probe in chosen.values():
        if not isinstance(probe, Monitor):
            raise OptionError(f"{probe.name!r} is a probe that gives no scores, and no monitor.")
    where = options.run_folder, options.cases, options.libero, options.libero_assets
    with open_recorded(*where) as run, Work() as work:
        if run.outside is not None:
            work.say(printable(run.outside))
        records = []
        for number, record in enumerate(run.stored.records):
            work.show(
                f"{number + 1} of {len(run.stored.records)}{work.left(number, len(run.stored.records))}"
            )
            records.append(scored(run, record, monitors))
        stopped = run.stored.stopped_by_rule
    for title, rows in Monitors().tables(PlayedPairs(records)).items():
        if title in chosen:
            cameras = getattr(chosen[title], "cameras", ())
            looks = f"images of {', '.join(cameras)}, drawn again" if cameras else "recorded answers alone"
            table = rows_table({"Looks at": looks, **(rows_without_intervals(rows) if stopped else rows)})
            say(["", title, *table_lines(table, short=False, numbers=False)])
