"""``libero-max check``: the usual mistakes of a policy, found with a few queries."""

from __future__ import annotations

import argparse
import logging
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.cli.arguments import Commands, add_cadence, option, switch
from pytest_libero_max.errors import counted
from pytest_libero_max.policies.clients.address import is_address
from pytest_libero_max.runs.live_text import LiveText, understands_sequences

if TYPE_CHECKING:
    from pytest_libero_max.conformance.policy.subject import PolicySubject


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
    from pytest_libero_max.conformance.lines import STRICT, check_lines
    from pytest_libero_max.conformance.policy.subject import open_policy
    from pytest_libero_max.conformance.registry import rules_for
    from pytest_libero_max.conformance.rules import Examination
    from pytest_libero_max.policies.loading import check_reference

    check_reference(options.policy, options.profile, None)
    subject = open_policy(
        reference,
        horizon=options.horizon,
        query_interval=options.query_interval,
        profile=options.profile,
        substrate=options.substrate,
    )
    outcomes = Examination(lambda: subject, rules_for("policy")).outcomes()
    lines = check_lines(outcomes, strict=options.strict)
    print("\n".join(map(str, lines)))
    _draw_inputs(subject, options.picture)
    if _has_stand_in(options.policy):
        print(
            f"{options.policy} still has the Model of `libero-max init`, which looks at nothing. Put your "
            "own in its place, and check again."
        )
    words = [line.word for line in lines]
    wrong, notes, skipped = (words.count(word) for word in ("wrong", "note", "skip"))
    could_not = f", {skipped} could not be examined" if skipped else ""
    print(f"{wrong} wrong, {notes} to look at{could_not}")
    doubts = sum(line.doubtful for line in lines)
    if doubts:
        print(f"{STRICT} counts {counted(doubts, 'note')} as wrong.")
    return 1 if wrong else 0


def _draw_inputs(subject: PolicySubject, file: Path) -> None:
    """Draw the images that the model is shown, or those that the policy receives."""
    from pytest_libero_max.policies.model_inputs import model_inputs, picture_sheet
    from pytest_libero_max.policies.transforms.images import png_file

    observation, query = subject.shown.observations[0], subject.shown.query(0)
    arrays, whose = model_inputs(subject.policy, observation, query), "the images that the model is shown"
    if arrays is None:
        arrays = dict(observation)
        whose = "the images that the policy receives, as the world delivers them"
    if any(array.ndim >= 3 for array in arrays.values()):
        file.write_bytes(png_file(picture_sheet(arrays)))
        print(f"Open {file}: {whose}.")


def _has_stand_in(reference: str) -> bool:
    """Return True if the policy is a file with the template's stand-in for a model."""
    from pytest_libero_max.cli.init import has_stand_in

    file = Path(reference.partition(".py:")[0] + ".py" if ".py:" in reference else reference)
    return file.suffix == ".py" and file.is_file() and has_stand_in(file.read_text(encoding="utf-8"))


def _soon(policy: str) -> str:
    """Return addresses of servers with a patience of seconds, unless they have one; others as they are."""
    if not is_address(policy):
        return policy
    return ",".join(
        part if "patience=" in part else f"{part}{'&' if '?' in part else '?'}patience={PATIENCE_S}"
        for part in policy.split(",")
    )
