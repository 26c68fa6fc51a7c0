"""``libero-max publish pack`` and ``publish verify``: results packed, and verified."""

from __future__ import annotations

import argparse
import secrets
import shlex
import time
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.benchmark.documents import Json, printable
from pytest_libero_max.cli.arguments import Commands, add_libero, option, switch, whole_number
from pytest_libero_max.errors import OptionError, counted

if TYPE_CHECKING:
    from pytest_libero_max.runs.replay_command import Places
    from pytest_libero_max.runs.store import StoredRun


def add_command(commands: Commands) -> None:
    """Add ``pack`` and ``verify`` to the parser."""
    publish = commands.add_parser(
        "pack", help="Write packed pairs, report and figures of a run into a folder to be published"
    )
    publish.add_argument("run_folder", type=Path, metavar="RUN", help="The output folder of the run")
    publish.add_argument("folder", type=Path, metavar="FOLDER", help="For example reports/lite/expert")
    switch(
        publish,
        "--actions",
        "Also the recorded actions, with which others replay pairs without the policy (the run must "
        "have kept them: --libero-max-traces=all)",
    )
    option(publish, "--authors TEXT", "Names of the authors, for the page of libero-max publish index")
    option(publish, "--model ADDRESS", "Address of the model's page on the web, for the same")
    publish.set_defaults(run=_publish)

    check = commands.add_parser(
        "verify",
        help="Check a published run: compute every number again, and play some pairs again",
        description="Reports, figures and cases have to follow from the packed pairs and from the frozen "
        "tracks. Pairs drawn at random are then played again, each in a process of its own, and have to end "
        "alike, with the same proofs. Nothing that the folder names is opened or run: a policy of this "
        "package is played by its name, any other is named by --policy, and LIBERO is that of this machine. "
        "--pairs=0 plays none. Exit status 1 if anything differs.",
    )
    check.add_argument("folder", type=Path, metavar="FOLDER", help="Written by libero-max publish pack")
    option(check, "--pairs K", "Number of pairs to play again; 0 plays none", type=whole_number(0), default=2)
    option(check, "--seed TEXT", "Draw the same pairs again (default: a new one, printed)")
    option(
        check,
        "--policy REFERENCE",
        "The policy of the run as it is found here, as for pytest --libero-max-policy (default: that of the "
        "run, if it is one of this package)",
    )
    option(check, "--profile NAME|PATH", "The profile of its server, if it is none of this package's")
    option(
        check, "--cases MANIFEST", "The manifest of the run, if it played no frozen track", dest="case_set"
    )
    add_libero(check)
    switch(
        check,
        "--actions",
        "Execute the recorded actions of these pairs instead, and load no policy: shows that they lead "
        "to the recorded ends, not that the policy chose them",
    )
    option(
        check,
        "--record FILE",
        "Note here that pairs were played again and ended alike, for libero-max publish index --verified",
        type=Path,
    )
    check.set_defaults(run=_verify_run)


def _publish(options: argparse.Namespace) -> None:
    from pytest_libero_max.report.publication import About, publish

    about = None
    if options.authors or options.model:
        try:
            about = About(options.authors or "", options.model or "")
        except ValueError as error:
            raise OptionError(f"--{error}.") from error
    written = publish(options.run_folder, options.folder, options.actions, about)
    print(f"Written: {', '.join(map(str, written))}")


def _verify_run(options: argparse.Namespace) -> int:
    from pytest_libero_max.report.publication import checked, note_check, read_checks
    from pytest_libero_max.runs.outside import outside_text
    from pytest_libero_max.runs.replay_command import is_outside
    from pytest_libero_max.runs.run_verification import CANNOT_JUDGE, FRESH, verification_lines, verified
    from pytest_libero_max.runs.store import read_pairs

    for line in checked(options.folder):
        print(line)
    run = read_pairs(options.folder)
    provenance = run.run.provenance
    if options.actions and options.policy is not None:
        raise OptionError("--actions asks no policy: leave out one of --actions and --policy.")
    if not options.actions:
        print(printable(f"policy: {options.policy or provenance['policy']['reference']}"), flush=True)
    if (outside := outside_text(provenance)) is not None:
        print(printable(outside), flush=True)
    if not options.pairs or (is_outside(provenance) and not options.actions):
        print("played again: none; nothing shows that these pairs were played")
        return 0
    if not options.actions and run.records and not run.records[0].policy.get("repeatable", True):
        print(CANNOT_JUDGE)
        return 0
    places = None if options.actions else _places(provenance, options)
    if options.record is not None:
        read_checks(options.record)  # before minutes of play
    seed = options.seed if options.seed is not None else str(secrets.randbelow(10**6))
    what = "the recorded actions of " if options.actions else ""
    drawn = f"{counted(min(options.pairs, len(run.records)), 'pair')} again, drawn by --seed={seed}"
    print(f"playing {what}{drawn}", flush=True)
    start = time.perf_counter()
    if places is None:
        found, how = _replayed(options, run, seed), "from their recorded actions"
    else:
        found, how = verified(run, options.pairs, places, seed=seed), FRESH
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


def _places(provenance: Json, options: argparse.Namespace) -> Places:
    """Return what is taken from this machine to play the pairs of a run."""
    from pytest_libero_max.policies.clients.address import is_served
    from pytest_libero_max.policies.profile import profile_names
    from pytest_libero_max.policies.references import absolute_reference
    from pytest_libero_max.runs.outside import built_in_policy, cases_of_run
    from pytest_libero_max.runs.replay_command import Places

    policy = built_in_policy(provenance) if options.policy is None else options.policy
    if policy is None:
        reference = shlex.quote(str(provenance["policy"]["reference"]))
        raise OptionError(
            f"The folder names the policy {reference}, and nothing that a folder names is run. Name the "
            f"policy as it is found here, for example --policy={reference}; --actions or --pairs=0 need none."
        )
    profile = options.profile or (provenance["policy"].get("profile") if is_served(policy) else None)
    if profile is not None and options.profile is None and profile not in profile_names():
        raise OptionError(
            f"The folder names the profile {shlex.quote(str(profile))}, which is none of this package's. "
            "Nothing that a folder names is opened: give it with --profile."
        )
    cases_of_run(provenance, options.case_set)  # says which option is missing
    return Places(
        absolute_reference(policy, Path.cwd()),
        profile,
        None if options.case_set is None else str(Path(options.case_set).expanduser().absolute()),
        None,
        None,
        tuple(str(root.expanduser().absolute()) for root in options.libero),
        None if options.libero_assets is None else str(options.libero_assets.expanduser().absolute()),
    )


def _replayed(options: argparse.Namespace, run: StoredRun, seed: str) -> dict[str, str]:
    """Return what :func:`~pytest_libero_max.runs.run_verification.verified` does, from recorded actions."""
    from pytest_libero_max.worlds.threads import use_one_blas_thread

    use_one_blas_thread()  # as in a run: the last bits depend on it
    from pytest_libero_max.films.recorded import open_recorded
    from pytest_libero_max.runs.run_verification import chosen

    where = options.folder, options.case_set, options.libero, options.libero_assets
    with open_recorded(*where) as recorded:
        return {
            record.item_id: recorded.replayed(record) for record in chosen(run.records, options.pairs, seed)
        }
