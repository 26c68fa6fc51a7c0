"""``libero-max list profiles``: the profiles of policies behind servers."""

from __future__ import annotations

import argparse
import re
import textwrap
from itertools import takewhile
from typing import TYPE_CHECKING

from pytest_libero_max.cli.arguments import Commands
from pytest_libero_max.cli.terminal import say

if TYPE_CHECKING:
    from pytest_libero_max.policies.profile import Profile


def add_command(commands: Commands) -> None:
    """Add ``profiles`` to the parser."""
    profiles = commands.add_parser(
        "profiles",
        help="List the profiles of policies behind servers, or explain one",
        description="Without a name, one line for each profile; with one, what it is for, how its server is "
        "started as far as the profile says it, and the commands to check and play it.",
    )
    profiles.add_argument("profile", nargs="?", metavar="NAME|PATH", help="The profile to explain")
    profiles.set_defaults(run=_profiles)


def _profiles(options: argparse.Namespace) -> int:
    from pytest_libero_max.policies.profile import load_profile, profile_names

    if options.profile is not None:
        say(_explained(options.profile, load_profile(options.profile)))
        return 0
    rows = [(name, load_profile(name)) for name in profile_names()]
    width = max(len(name) for name, _ in rows)
    say(
        f"{name:<{width}}  {profile.protocol:<9} {_chunks(profile):<12} {_sentence(profile)}"
        for name, profile in rows
    )
    return 0


def _about(profile: Profile) -> list[str]:
    """Return the comment with which the file of a profile begins; an empty line where there is none."""
    from pytest_libero_max.benchmark.documents import read_text

    text = read_text(profile.path)
    comment = takewhile(lambda line: line.startswith("#"), text.splitlines())
    return [line.removeprefix("#").removeprefix(" ") for line in comment] or [""]


def _sentence(profile: Profile) -> str:
    """Return the first sentence of the comment, or its beginning."""
    first = re.split(r"(?<=[.:])\s", " ".join(_about(profile)))[0]
    return textwrap.shorten(first.rstrip(":."), 100, placeholder=" ...")


def _chunks(profile: Profile) -> str:
    """Return H and Q of a profile; empty where the server or the user says them."""
    found = [profile.get("policy", field, "?") for field in ("horizon", "query_interval")]
    return "" if "?" in found else "H={} Q={}".format(*found)


def _explained(text: str, profile: Profile) -> list[str]:
    address = f"{profile.protocol}://HOST:PORT"
    suites = ", ".join(profile.suites or ()) or "all"
    return [
        f"{profile.name}: {_chunks(profile)}".rstrip(": "),
        *(f"  {line}" for line in _about(profile)),
        f"Suites: {suites}. Actions: {profile.get('actions', 'control', 'delta')}.",
        f"libero-max check {address} --profile {text}",
        f"pytest --libero-max-policy={address} --libero-max-profile={text}",
    ]
