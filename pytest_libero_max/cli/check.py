"""``libero-max check``: the usual mistakes of a policy, found with a few queries."""

from __future__ import annotations

import argparse
import logging
import sys
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.cli.arguments import Commands, add_cadence, option, switch
from pytest_libero_max.errors import AdapterError, counted
from pytest_libero_max.policies.clients.address import is_address
from pytest_libero_max.runs.live_text import LiveText, understands_sequences

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.cases import Case
    from pytest_libero_max.policies.contract import Policy
    from pytest_libero_max.policies.finding import Finding, Level


PATIENCE_S = 5
"""Longest time to wait for a server that cannot be reached: somebody is waiting."""


def add_command(commands: Commands) -> None:
    """Add ``check`` to the parser."""
    check = commands.add_parser(
        "check", help="Ask a policy a few queries and name the usual mistakes; exit status 1 if one is found"
    )
    check.add_argument("policy", metavar="POLICY", help="As for pytest --libero-max-policy")
    option(check, "--profile NAME|PATH", "As for pytest --libero-max-profile")
    add_cadence(check)
    switch(
        check,
        "--strict",
        "Count as wrong what is a mistake of most policies and intended by few: images not turned by "
        "[::-1, ::-1], a gripper that closes at once, movements of millimetres, chunks of another length",
    )
    option(check, "--substrate NAME", "Substrate of the scene that is shown", default="embedded")
    option(
        check,
        "--picture FILE",
        "File for the images that the model is shown",
        type=Path,
        default=Path("libero-max-check.png"),
    )
    check.set_defaults(run=_check)


def _check(options: argparse.Namespace) -> int:
    from pytest_libero_max.policies.clients.transport import LOG

    policy = _soon(options.policy)
    shown = _Tries(
        "as long as its patience lasts" if policy == options.policy else f"for {PATIENCE_S} s at most"
    )
    LOG.addHandler(shown)
    try:
        return _examine(options, policy)
    finally:
        LOG.removeHandler(shown)
        shown.close()


class _Tries(logging.Handler):
    """Tries to reach a server: the last one on a terminal, where the line goes at the end; else the first."""

    def __init__(self, for_how_long: str) -> None:
        super().__init__()
        self._for_how_long = for_how_long
        self._live = LiveText(sys.stderr) if understands_sequences(sys.stderr) else None
        self._said = False

    def emit(self, record: logging.LogRecord) -> None:
        line = f"Trying {self._for_how_long}: {record.getMessage()}"
        if self._live is not None:
            self._live.draw([line])
        elif not self._said:
            print(line, file=sys.stderr)
        self._said = True

    def close(self) -> None:
        if self._live is not None:
            self._live.erase()
        super().close()


def _examine(options: argparse.Namespace, reference: str) -> int:
    from pytest_libero_max.policies.check import check_cameras
    from pytest_libero_max.policies.examination import examine, made_up
    from pytest_libero_max.policies.loading import check_reference, load_policy
    from pytest_libero_max.policies.model_inputs import model_inputs, picture_sheet
    from pytest_libero_max.policies.transforms.images import png_file
    from pytest_libero_max.substrates.contract import SubstrateOptions
    from pytest_libero_max.substrates.registry import open_substrate

    check_reference(options.policy, options.profile, None)
    policy = load_policy(
        reference,
        horizon=options.horizon,
        query_interval=options.query_interval,
        profile=options.profile,
    )
    if policy.spec.privileged:
        raise AdapterError(
            f"policy {policy.spec.name!r} reads the simulator (privileged), and check shows observations "
            "alone. Play a few pairs with it: pytest --libero-max-policy=... --libero-max-limit=4."
        )
    with closing(open_substrate(options.substrate, SubstrateOptions())) as substrate:
        case = _case_for(policy)
        world = substrate.world(case)
        check_cameras(policy, world)
        shown = made_up(policy, world, case.suite)
    spec = policy.spec
    print(f"{spec.name} (H={spec.horizon} Q={spec.query_interval}): {', '.join(spec.cameras) or 'no images'}")
    findings = examine(policy, shown)
    if options.strict:
        findings = [finding.strict() for finding in findings]
    for finding in findings:
        print(finding)
    told, who = (
        model_inputs(policy, shown.observations[0], shown.query(0)),
        "the images that the model is shown",
    )
    if told is None:
        told, who = (
            dict(shown.observations[0]),
            "the images that the policy receives, as the world delivers them",
        )
    if any(array.ndim >= 3 for array in told.values()):
        options.picture.write_bytes(png_file(picture_sheet(told)))
        print(f"Open {options.picture}: {who}.")
    if _has_stand_in(options.policy):
        print(
            f"{options.policy} still has the Model of `libero-max init`, which looks at nothing. Put your "
            "own in its place, and check again."
        )
    wrong, notes, skipped = (_count(findings, level) for level in ("wrong", "note", "skip"))
    could_not = f", {skipped} could not be examined" if skipped else ""
    print(f"{wrong} wrong, {notes} to look at{could_not}")
    probable = sum(finding.probable for finding in findings)
    if probable:
        print(f"--strict counts {counted(probable, 'note')} as wrong.")
    return 1 if wrong else 0


def _has_stand_in(reference: str) -> bool:
    """Return True if the policy is a file with the template's stand-in for a model."""
    from pytest_libero_max.cli.init import has_stand_in

    file = Path(reference.partition(".py:")[0] + ".py" if ".py:" in reference else reference)
    return file.suffix == ".py" and file.is_file() and has_stand_in(file.read_text(encoding="utf-8"))


def _count(findings: list[Finding], level: Level) -> int:
    return sum(finding.level == level for finding in findings)


def _soon(policy: str) -> str:
    """Return addresses of servers with a patience of seconds, unless they have one; others as they are."""
    if not is_address(policy):
        return policy
    return ",".join(
        part if "patience=" in part else f"{part}{'&' if '?' in part else '?'}patience={PATIENCE_S}"
        for part in policy.split(",")
    )


def _case_for(policy: Policy) -> Case:
    """Return the first case of ``smoke`` that the policy supports; every suite is in that track."""
    from pytest_libero_max.benchmark.tracks import load_track

    return next(case for case in load_track("smoke").cases if policy.spec.supports(case.suite))
