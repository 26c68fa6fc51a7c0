"""Commands that build the benchmark and look at it."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.cli.substrates import add_substrate, substrate_options
from pytest_libero_max.cli.work import Work
from pytest_libero_max.errors import OptionError

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.manifests import Manifest
    from pytest_libero_max.construction.examiner import Progress
    from pytest_libero_max.substrates.contract import Catalogue, Substrate

    Commands = argparse._SubParsersAction[argparse.ArgumentParser]


def add_commands(commands: Commands) -> None:
    """Add the commands from ``catalogue`` to ``show`` to the parser."""
    catalogue = commands.add_parser("catalogue", help="Count the source variations of the embedded scenes")
    catalogue.set_defaults(run=_catalogue)

    gallery = commands.add_parser(
        "gallery",
        help="Draw the embedded scenes, their variations and the events",
        description="On a substrate without sheets of its own: only the events.",
    )
    gallery.add_argument("folder", type=Path, metavar="FOLDER", help="Where the pictures are written")
    gallery.add_argument(
        "--page-pictures",
        type=Path,
        metavar="FOLDER",
        help="Also write the small pictures of events that pages of reports show, as this package has them",
    )
    add_substrate(gallery)
    gallery.set_defaults(run=_gallery)

    eligibility = commands.add_parser(
        "eligibility", help="Count the variations that can host each event, by source category"
    )
    _add_classification(eligibility)
    add_substrate(eligibility)
    eligibility.set_defaults(run=_eligibility)

    build = commands.add_parser(
        "build",
        help="Build every track from nothing: select, preflight, replace, freeze",
        description="No policy has a part in it. Interrupted, it goes on where it stopped.",
    )
    build.add_argument("folder", type=Path, metavar="FOLDER", help="Where the tracks are written")
    build.add_argument(
        "tracks",
        nargs="*",
        metavar="TRACK",
        help="On the libero substrate: smoke, max with what is drawn from it, or both (default: both)",
    )
    _add_classification(build)
    add_substrate(build)
    _add_examination(build)
    build.set_defaults(run=_build)

    certify = commands.add_parser(
        "certify",
        help="Let the scripted expert play the frozen cases that have no certificate yet",
        description="Interrupted, it goes on where it stopped.",
    )
    certify.add_argument("folder", type=Path, metavar="FOLDER", help="The tracks, as build wrote them")
    certify.add_argument(
        "tracks", nargs="*", metavar="TRACK", help="Which tracks (default: original and max; on libero, all)"
    )
    _add_expert(certify, default="expert")
    add_substrate(certify)
    _add_examination(certify)
    certify.set_defaults(run=_certify)

    preflight = commands.add_parser("preflight", help="Examine the cases of a track or manifest")
    preflight.add_argument("cases", metavar="TRACK|MANIFEST", help="A track's name or a manifest's path")
    preflight.add_argument("--limit", type=int, metavar="N", help="Only N of them, spread evenly")
    _add_expert(preflight, default=None)
    _add_examination(preflight)
    add_substrate(preflight)
    preflight.set_defaults(run=_preflight)

    freeze = commands.add_parser("freeze", help="Draw the smaller tracks again from max, with checksums")
    freeze.add_argument("folder", type=Path, metavar="FOLDER", help="The tracks, as build wrote them")
    freeze.set_defaults(run=_freeze)

    check = commands.add_parser("verify", help="Check quotas, identities, digests and splits of the tracks")
    check.add_argument("folder", type=Path, nargs="?", metavar="FOLDER", help="Default: the package's own")
    check.set_defaults(run=_verify)

    show = commands.add_parser("show", help="Show the tracks, one of them, or one case of it")
    show.add_argument("cases", nargs="?", metavar="TRACK|MANIFEST", help="Without: an overview of all tracks")
    show.add_argument("case", nargs="?", metavar="CASE", help="Id of a case: everything about it")
    show.add_argument("--json", action="store_true", help="The manifest's own text, unpacked")
    show.add_argument(
        "--pictures",
        type=Path,
        metavar="FOLDER",
        help="Also write what each camera sees just before and after the event of CASE, without a policy",
    )
    show.add_argument(
        "--size", type=int, default=256, metavar="PX", help="Side of a picture (default: %(default)s)"
    )
    add_substrate(show)
    show.set_defaults(run=_show)


def _add_classification(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--plus-classification",
        type=Path,
        metavar="FILE",
        help="On the libero substrate: task_classification.json of LIBERO-Plus's repository, which its "
        "package lacks (default: that of the checkout)",
    )


def _add_expert(command: argparse.ArgumentParser, *, default: str | None) -> None:
    command.add_argument(
        "--expert",
        metavar="POLICY",
        default=default,
        help="Privileged policy that solves the tasks, as for pytest --libero-max-policy: it plays each case "
        "that passes, and one that it completes is certified. It decides nothing else (default: "
        + (default or "none; then nothing is certified")
        + ")",
    )


def _add_examination(command: argparse.ArgumentParser) -> None:
    command.add_argument("--jobs", type=int, default=2, metavar="N", help="Processes (default: %(default)s)")
    command.add_argument(
        "--work",
        type=Path,
        default=Path(".libero-max"),
        metavar="FOLDER",
        help="Keeps examinations between interruptions (default: %(default)s)",
    )


def _catalogue(options: argparse.Namespace) -> None:
    from pytest_libero_max.construction.configurations import count_lines

    print("\n".join(count_lines()))


def _gallery(options: argparse.Namespace) -> None:
    from pytest_libero_max.construction.sheets import write_event_sheet, write_page_pictures
    from pytest_libero_max.substrates.registry import SUBSTRATES, open_substrate

    kind, told = SUBSTRATES[options.substrate], substrate_options(options)
    track = kind.tracks(told).pictured
    sheets: dict[Path, Callable[[Path, Substrate], None]] = {
        **{options.folder / name: draw for name, draw in kind.sheets.items()},
        options.folder / "events.webp": partial(write_event_sheet, track=track),
    }
    if options.page_pictures is not None:
        sheets[options.page_pictures] = partial(write_page_pictures, track=track)
    substrate = open_substrate(options.substrate, told)
    with Work() as work:
        try:
            for number, (path, write) in enumerate(sheets.items(), start=1):
                work.show(f"{path.name}, {number} of {len(sheets)}")
                write(path, substrate)
        finally:
            substrate.close()


def _eligibility(options: argparse.Namespace) -> None:
    from pytest_libero_max.construction.configurations import eligibility_lines

    print("\n".join(eligibility_lines(_catalogue_of(options))))


def _catalogue_of(options: argparse.Namespace) -> Catalogue:
    from pytest_libero_max.substrates.registry import SUBSTRATES

    return SUBSTRATES[options.substrate].catalogue(substrate_options(options))


def _build(options: argparse.Namespace) -> None:
    from pytest_libero_max.construction.examiner import Examiner
    from pytest_libero_max.construction.genuine import TRACKS, build_genuine
    from pytest_libero_max.construction.overview import overview_lines, write_overview
    from pytest_libero_max.construction.release import build_release, write_release
    from pytest_libero_max.construction.verification import verify
    from pytest_libero_max.substrates.registry import SUBSTRATES

    told, whole = substrate_options(options), SUBSTRATES[options.substrate].plays_frozen
    if whole and (options.tracks or options.plus_classification):
        raise OptionError(
            f"The {options.substrate} tracks are built together, from the package's own catalogues. Give no "
            "TRACK and no --plus-classification, or add --substrate libero."
        )
    catalogue = _catalogue_of(options)
    with (
        Work() as work,
        Examiner(options.work, options.jobs, _tell(work), options.substrate, told) as examiner,
    ):
        work.say(f"What is found is kept in {examiner.path()}")
        if whole:
            release = build_release(examiner.examine)
        else:
            release = build_genuine(examiner.examine, catalogue, options.tracks or TRACKS)
        write_release(release, options.folder)
    write_overview(options.folder)
    checks = ["", *verify(options.folder)] if whole else []
    print("\n".join([*overview_lines(options.folder), *checks]))


def _certify(options: argparse.Namespace) -> None:
    from pytest_libero_max.construction.examiner import Examiner
    from pytest_libero_max.construction.overview import certificate_lines, write_overview
    from pytest_libero_max.construction.release import add_certificates, independent_tracks, read_certificates

    tracks = options.tracks or independent_tracks(options.folder)
    where = (options.substrate, substrate_options(options))
    with Work() as work, Examiner(options.work, options.jobs, _tell(work), *where) as examiner:
        work.say(f"What is found is kept in {examiner.path(options.expert)}")
        add_certificates(options.folder, tracks, partial(examiner.certify, expert=options.expert))
    write_overview(options.folder)
    print("\n".join(certificate_lines(read_certificates(options.folder))))


def _preflight(options: argparse.Namespace) -> None:
    from pytest_libero_max.benchmark.sampling import stratified
    from pytest_libero_max.construction.examiner import Examiner
    from pytest_libero_max.construction.overview import certificate_lines, preflight_lines

    cases = _manifest(options.cases).cases
    if options.limit is not None:
        cases = stratified(cases, options.limit)
    where = options.substrate, substrate_options(options)
    with Work() as work, Examiner(options.work, options.jobs, _tell(work), *where) as examiner:
        found = examiner.examine(cases)
        print("\n".join(preflight_lines(found)), flush=True)
        if options.expert is not None:
            passed = [case for case in cases if found[case.case_id].passed]
            print("\n".join(["", *certificate_lines(examiner.certify(passed, options.expert))]))


def _tell(work: Work) -> Callable[[Progress], None]:
    """Shows how far an examiner is."""
    return lambda progress: work.show(str(progress), last=progress.ended)


def _freeze(options: argparse.Namespace) -> None:
    from pytest_libero_max.construction.overview import write_overview
    from pytest_libero_max.construction.release import write_splits
    from pytest_libero_max.construction.verification import verify

    write_splits(options.folder)
    write_overview(options.folder)
    print("\n".join(verify(options.folder)))


def _verify(options: argparse.Namespace) -> None:
    from pytest_libero_max.benchmark.tracks import FOLDER, GENUINE
    from pytest_libero_max.construction.verification import verify

    folders = [options.folder] if options.folder else [FOLDER, FOLDER / GENUINE]
    for folder in folders:
        if options.folder or folder.is_dir():
            print("\n".join(verify(folder)))


def _show(options: argparse.Namespace) -> None:
    from pytest_libero_max.benchmark.tracks import FOLDER
    from pytest_libero_max.construction.overview import manifest_lines, overview_lines

    if options.pictures is not None and options.case is None:
        raise OptionError("--pictures shows the event of one case: give TRACK and CASE as well.")
    if options.cases is None:
        print("\n".join(overview_lines(FOLDER)))
        return
    manifest = _manifest(options.cases)
    if options.json:
        print(manifest.to_json(), end="")
    elif options.case is None:
        print("\n".join(manifest_lines(manifest)))
    else:
        _show_case(options, manifest)


def _show_case(options: argparse.Namespace, manifest: Manifest) -> None:
    from pytest_libero_max.benchmark.tracks import is_manifest_path, track_path
    from pytest_libero_max.construction.case_text import case_lines, find_case, write_event_pictures
    from pytest_libero_max.construction.release import read_certificates
    from pytest_libero_max.substrates.registry import open_substrate

    case, name = find_case(manifest, options.case), options.cases
    certificates = {} if is_manifest_path(name) else read_certificates(track_path(name).parent)
    print("\n".join(case_lines(case, certificates)))
    if options.pictures is None:
        return
    substrate = open_substrate(options.substrate, substrate_options(options))
    try:
        paths = write_event_pictures(options.pictures, substrate.world(case), case, options.size)
    finally:
        substrate.close()
    print("\n".join(f"Written: {path}" for path in paths))


def _manifest(name: str) -> Manifest:
    """A track by its name or a manifest by its path, with its events and changes checked."""
    from pytest_libero_max.benchmark.tracks import load_cases
    from pytest_libero_max.events.registry import check_cases

    manifest = load_cases(name)
    check_cases(manifest)
    return manifest
