"""``libero-max publish``, ``verify-run``, ``index`` and ``published``: packed results, and the paper's."""

from __future__ import annotations

import argparse
import secrets
import time
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.cli.arguments import Commands, option, switch, whole_number
from pytest_libero_max.errors import OptionError

if TYPE_CHECKING:
    from pytest_libero_max.runs.store import StoredRun


def add_command(commands: Commands) -> None:
    """Add ``publish``, ``verify-run``, ``index`` and ``published`` to the parser."""
    publish = commands.add_parser(
        "publish", help="Write packed pairs, report and figures of a run into a folder to be published"
    )
    publish.add_argument("run_folder", type=Path, metavar="RUN", help="The output folder of the run")
    publish.add_argument("folder", type=Path, metavar="FOLDER", help="For example reports/lite/expert")
    switch(
        publish,
        "--actions",
        "Also the recorded actions, with which others replay pairs without the policy (the run must "
        "have kept them: --libero-max-traces=all)",
    )
    publish.set_defaults(run=_publish)

    check = commands.add_parser(
        "verify-run",
        help="Check a published run: compute every number again, and play some pairs again",
        description="Reports, figures and cases have to follow from the packed pairs and from the frozen "
        "tracks. Pairs drawn at random are then played again, each in a process of its own, and have to end "
        "alike, with the same proofs. This loads the policy that the run names, and runs its code; "
        "--pairs=0 prints the name alone. Exit status 1 if anything differs.",
    )
    check.add_argument("folder", type=Path, metavar="FOLDER", help="Written by libero-max publish")
    option(check, "--pairs K", "Number of pairs to play again; 0 plays none", type=whole_number(0), default=2)
    option(check, "--seed TEXT", "Draw the same pairs again (default: a new one, printed)")
    option(
        check,
        "--policy REFERENCE",
        "The policy of the run as it is found here, as for pytest --libero-max-policy (default: that "
        "of the run)",
    )
    switch(
        check,
        "--actions",
        "Execute the recorded actions of these pairs instead, and load no policy: shows that they lead "
        "to the recorded ends, not that the policy chose them",
    )
    option(
        check,
        "--record FILE",
        "Note here that pairs were played again and ended alike, for libero-max index --verified",
        type=Path,
    )
    check.set_defaults(run=_verify_run)

    index = commands.add_parser(
        "index",
        help="Write a page of published runs, with a table to be sorted for each set of cases",
        description="Reports, figures and cases of each run are computed again first. A run that does not "
        "agree with itself is named at the top of the page and in no table, and the exit status is 1. The "
        "page is one static file.",
    )
    index.add_argument(
        "folders", type=Path, nargs="+", metavar="FOLDER", help="A published run, or a folder above several"
    )
    option(index, "--output FILE", "The page", type=Path, default=Path("index.html"))
    option(
        index,
        "--verified FILE",
        "Checks of those who run the index, written by libero-max verify-run --record",
        type=Path,
    )
    index.set_defaults(run=_index)

    published = commands.add_parser("published", help="Print the results published in the paper")
    published.set_defaults(run=_published)


def _publish(options: argparse.Namespace) -> None:
    from pytest_libero_max.report.publication import publish

    print(f"Written: {', '.join(map(str, publish(options.run_folder, options.folder, options.actions)))}")


def _verify_run(options: argparse.Namespace) -> int:
    from pytest_libero_max.report.publication import checked
    from pytest_libero_max.report.run_index import note_check, read_checks
    from pytest_libero_max.runs.replay_command import is_outside
    from pytest_libero_max.runs.run_verification import verification_lines, verified
    from pytest_libero_max.runs.store import read_pairs

    for line in checked(options.folder):
        print(line)
    run = read_pairs(options.folder)
    if options.actions and options.policy is not None:
        raise OptionError("--actions asks no policy: leave out one of --actions and --policy.")
    if not options.actions:
        print(f"policy: {options.policy or run.run.provenance['policy']['reference']}", flush=True)
    if not options.pairs or (is_outside(run.run.provenance) and not options.actions):
        print("played again: none; nothing shows that these pairs were played")
        return 0
    if options.record is not None:
        read_checks(options.record)  # before minutes of play
    seed = options.seed if options.seed is not None else str(secrets.randbelow(10**6))
    what = "the recorded actions of " if options.actions else ""
    drawn = f"{min(options.pairs, len(run.records))} pairs again, drawn by --seed={seed}"
    print(f"playing {what}{drawn}", flush=True)
    start = time.perf_counter()
    if options.actions:
        found, how = _replayed(options.folder, run, options.pairs, seed), "from their recorded actions"
    else:
        found = verified(run, options.pairs, Path.cwd(), seed=seed, policy=options.policy)
        how = "in processes of their own"
    lines, problems = verification_lines(found, time.perf_counter() - start, how)
    print("\n".join([*lines, *problems]))
    if problems:
        print(
            "A pair that could not be played says nothing about the run. Where policy and versions are those "
            "of the run, a pair that ends otherwise refutes it."
        )
    elif options.record is not None:
        note_check(options.record, options.folder, len(found), seed, options.actions)
        print(f"Noted: {options.record}")
    return 1 if problems else 0


def _replayed(folder: Path, run: StoredRun, pairs: int, seed: str) -> dict[str, str]:
    """Return what :func:`~pytest_libero_max.runs.run_verification.verified` does, from recorded actions."""
    from pytest_libero_max.worlds.threads import use_one_blas_thread

    use_one_blas_thread()  # as in a run: the last bits depend on it
    from pytest_libero_max.films.recorded import open_recorded
    from pytest_libero_max.runs.run_verification import chosen

    with open_recorded(folder) as recorded:
        return {record.item_id: recorded.replayed(record) for record in chosen(run.records, pairs, seed)}


def _index(options: argparse.Namespace) -> int:
    from pytest_libero_max.report.formats import counted
    from pytest_libero_max.report.page.index_page import index_html
    from pytest_libero_max.report.run_index import published_in, read_checks, run_index
    from pytest_libero_max.report.writers.report_files import write_text

    known = {} if options.verified is None else read_checks(options.verified)
    index = run_index(published_in(options.folders), known)
    write_text(options.output, index_html(index, options.output.parent))
    for folder, reason in index.refused:
        print(f"refused: {folder}: {reason}")
    print(f"Written: {options.output}, {counted(sum(map(len, index.groups.values())), 'run')}")
    return 1 if index.refused else 0


def _published(options: argparse.Namespace) -> None:
    from pytest_libero_max.report.published import published_lines

    print("\n".join(published_lines()))
