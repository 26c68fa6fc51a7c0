"""``libero-max list``: tracks, cases, events, programs, profiles, published results and words."""

from __future__ import annotations

import argparse
import inspect
import json
import re
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.cli.arguments import (
    Commands,
    add_substrate,
    manifest_of,
    option,
    substrate_options,
    switch,
    whole_number,
)
from pytest_libero_max.cli.terminal import say
from pytest_libero_max.errors import OptionError, did_you_mean

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.manifests import Manifest
    from pytest_libero_max.benchmark.programs import Program
    from pytest_libero_max.policies.profile import Profile


def add_command(commands: Commands) -> None:
    """Add every list to the parser."""
    tracks = commands.add_parser("tracks", help="All tracks, with their numbers of cases by source")
    tracks.set_defaults(run=_tracks)

    cases = commands.add_parser("cases", help="What a track holds, or everything about one case of it")
    cases.add_argument("cases", metavar="TRACK|MANIFEST", help="A track's name or a manifest's path")
    cases.add_argument("case", nargs="?", metavar="CASE", help="Id of a case: everything about it")
    switch(cases, "--json", "The manifest's own text, unpacked")
    option(
        cases,
        "--pictures FOLDER",
        "Also write what each camera sees just before and after the event of CASE, without a policy",
        type=Path,
    )
    option(cases, "--size PX", "Side of a picture", type=whole_number(1, 4096), default=256)
    add_substrate(cases)
    cases.set_defaults(run=_cases)

    events = commands.add_parser("events", help="List the kinds of events, with those of installed packages")
    events.set_defaults(run=_events)

    programs = commands.add_parser(
        "programs",
        help="List the programs of events that come with the package, or show one",
        description="Without a name, what each plays and which cases it fits; with one, also its arms "
        "and the command to play it.",
    )
    programs.add_argument("program", nargs="?", metavar="NAME|FILE", help="The program to show")
    programs.set_defaults(run=_programs)

    profiles = commands.add_parser(
        "profiles",
        help="List the profiles of policies behind servers, or explain one",
        description="Without a name, one line for each profile; with one, what it is for, how its server is "
        "started as far as the profile says it, and the commands to check and play it.",
    )
    profiles.add_argument("profile", nargs="?", metavar="NAME|PATH", help="The profile to explain")
    profiles.set_defaults(run=_profiles)

    published = commands.add_parser("published", help="Results published in the paper")
    published.set_defaults(run=_published)

    words = commands.add_parser("words", help="What the words and letters of reports mean, all or some")
    words.add_argument("word", nargs="*", metavar="WORD", help="A word, for example H or 'stale action'")
    words.set_defaults(run=_words)


def _tracks(options: argparse.Namespace) -> None:
    from pytest_libero_max.benchmark.track_text import track_lines
    from pytest_libero_max.benchmark.tracks import FOLDER

    say(track_lines(FOLDER))


def _cases(options: argparse.Namespace) -> None:
    from pytest_libero_max.benchmark.track_text import manifest_lines

    if options.pictures is not None and options.case is None:
        raise OptionError("--pictures shows the event of one case: give CASE as well.")
    manifest = manifest_of(options.cases)
    if options.json:
        print(manifest.to_json(), end="")
    elif options.case is None:
        say(manifest_lines(manifest))
    else:
        _show_case(options, manifest)


def _show_case(options: argparse.Namespace, manifest: Manifest) -> None:
    from pytest_libero_max.benchmark.certificates import read_certificates
    from pytest_libero_max.benchmark.manifests import find_case
    from pytest_libero_max.benchmark.tracks import is_manifest_path, track_path
    from pytest_libero_max.cli.case_text import case_lines, write_event_pictures
    from pytest_libero_max.substrates.registry import open_substrate

    case, name = find_case(manifest, options.case), options.cases
    certificates = {} if is_manifest_path(name) else read_certificates(track_path(name).parent)
    say(case_lines(case, certificates))
    if options.pictures is None:
        return
    with closing(open_substrate(options.substrate.name, substrate_options(options))) as substrate:
        paths = write_event_pictures(options.pictures, substrate.world(case), case, options.size)
    say(f"Written: {path}" for path in paths)


def _events(options: argparse.Namespace) -> None:
    from pytest_libero_max.events.registry import EVENTS

    for name, kind in EVENTS.items():
        say([f"{name}: {kind.family}, severity {' and '.join(dict.fromkeys(kind.severities))}"])
        described = (inspect.getdoc(type(kind)) or "").split("\n\n")[0]
        say(_indented([described, f"Expected: {kind.expected}"]))


def _indented(texts: Iterable[str]) -> Iterator[str]:
    for text in texts:
        yield from textwrap.wrap(text, 100, initial_indent="  ", subsequent_indent="  ")


def _programs(options: argparse.Namespace) -> None:
    from pytest_libero_max.benchmark.programs import find_program, program_names

    if options.program is None:
        say(line for name in program_names() for line in _program_lines(find_program(name)))
        return
    program = find_program(options.program)
    say([*_program_lines(program), *_arm_lines(program)])
    say([f"pytest --libero-max-policy=POLICY --libero-max-program={program.source}"])


def _program_lines(program: Program) -> Iterator[str]:
    """Yield the name of a program, what it plays, and which cases it fits."""
    yield f"{program.name}:"
    fits = [*_patterns("with", program.only), *_patterns("without", program.without)]
    limits = f"Cases {', '.join(fits)}: {program.because}" if fits else "All cases."
    yield from _indented([program.about, limits])


def _patterns(word: str, patterns: Mapping[str, tuple[str, ...]]) -> Iterator[str]:
    for key, values in patterns.items():
        yield f"{word} {key} {' or '.join(values)}"


def _arm_lines(program: Program) -> Iterator[str]:
    """Yield the arms that are spelled out, an entry a line, as their file has them."""
    for arm in program.arms:
        others = {key: value for key, value in arm.items() if key not in ("name", "schedule")}
        yield f"  arm {arm['name']}{f' {json.dumps(others)}' if others else ''}"
        for index, entry in enumerate(arm.get("schedule", ())):
            yield f"    {index}. {json.dumps(entry)}"


def _profiles(options: argparse.Namespace) -> None:
    from pytest_libero_max.policies.profile import load_profile, profile_names

    if options.profile is not None:
        say(_explained(options.profile, load_profile(options.profile)))
        return
    rows = [(name, load_profile(name)) for name in profile_names()]
    width = max(len(name) for name, _ in rows)
    say(
        f"{name:<{width}}  {profile.protocol:<9} {_chunks(profile):<12} {_first_sentence(profile)}"
        for name, profile in rows
    )


def _about(profile: Profile) -> list[str]:
    """Return the comment with which the file of a profile begins; an empty line where there is none."""
    from pytest_libero_max.benchmark.documents import read_text

    comment = takewhile(lambda line: line.startswith("#"), read_text(profile.path).splitlines())
    return [line.removeprefix("#").removeprefix(" ") for line in comment] or [""]


def _first_sentence(profile: Profile) -> str:
    first = re.split(r"(?<=[.:])\s", " ".join(_about(profile)))[0]
    return textwrap.shorten(first.rstrip(":."), 100, placeholder=" ...")


def _chunks(profile: Profile) -> str:
    """Return H and Q of a profile; empty where the server or the user says them."""
    chunks = [profile.get("policy", field, "?") for field in ("horizon", "query_interval")]
    return "" if "?" in chunks else "H={} Q={}".format(*chunks)


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


def _published(options: argparse.Namespace) -> None:
    from pytest_libero_max.report.published import published_lines

    print("\n".join(published_lines()))


def _words(options: argparse.Namespace) -> None:
    from pytest_libero_max.report.page.words import glossary

    meanings = glossary()
    for word in options.word or meanings:
        if word not in meanings:
            raise OptionError.seen("word", word, f" is not in the glossary. {did_you_mean(word, meanings)}")
        say(textwrap.wrap(f"{word}: {meanings[word]}", 100, subsequent_indent="  "))
