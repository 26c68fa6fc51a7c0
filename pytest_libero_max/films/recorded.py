"""Films of the pairs of a run that has ended, from its folder: records, traces, and the cases it played."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.keywords import matches
from pytest_libero_max.errors import LiberoMaxError, OptionError, ProtocolError, ReportError, did_you_mean
from pytest_libero_max.films.drawing import film_frames
from pytest_libero_max.films.encoding import available_format, write_film
from pytest_libero_max.films.policy_view import Shown, caption, policy_look
from pytest_libero_max.films.replay import Tick, View, play_again, through_cameras
from pytest_libero_max.pairing.case_rules import require_of_case
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.pairing.scene_fingerprints import scene_fingerprints
from pytest_libero_max.pairing.trace import ArmTrace, read_trace, trace_name
from pytest_libero_max.runs.media import TRACES_NAME, distinct_arms, film_name, is_selected
from pytest_libero_max.runs.outside import cases_of_run, outside_text, require_inside
from pytest_libero_max.runs.replay_command import traces_setting
from pytest_libero_max.runs.store import StoredRun, pairs_file, read_pairs
from pytest_libero_max.substrates.contract import Substrate
from pytest_libero_max.substrates.registry import described_substrate, open_substrate
from pytest_libero_max.worlds.contract import World
from pytest_libero_max.worlds.rendering.context import RENDERING

SIZE_PX = 256
"""Side of a picture in a film, unless another is asked for."""

EVERY = 4
"""Policy steps from one frame to the next, unless others are asked for: five frames a second."""


def film_path(folder: Path, record: PairRecord, kind: str | None = None, view: str = "world") -> Path:
    """Destination of the film of a pair.

    Args:
        kind: ``mp4`` or ``webp``; None for the format that can be written here.
    """
    return folder / film_name(record.item_id, distinct_arms(record), f".{kind or available_format()}", view)


@dataclass(frozen=True)
class Drawn:
    """How a recorded pair is drawn."""

    size: int = SIZE_PX
    every: int = EVERY
    """Show only every so many steps; a film keeps its speed."""
    overwrite: bool = False
    on_step: Callable[[int], None] = lambda step: None
    """Called with the policy steps of each picture before it is drawn."""

    def tell(self, ticks: Iterable[Tick]) -> Iterator[Tick]:
        """Yield pictures, each after :attr:`on_step`."""
        for tick in ticks:
            self.on_step(tick.step)
            yield tick


def film_pair(
    path: Path,
    case: Case,
    world: World,
    record: PairRecord,
    traces: Mapping[str, ArmTrace],
    how: Drawn = Drawn(),
    shown: Shown | None = None,
) -> None:
    """Play a recorded pair again and write its film, or nothing at all.

    Args:
        shown: Conversion to the policy's images, to film these at its queries. None: film the cameras.

    Raises:
        AdapterError: The policy's view cannot be made.
        ProtocolError: The replay does not reach the recorded digests.
        ReportError: The film is there already, or cannot be written.
        ChangeError: A change does not fit this world.
        SimulatorError: The simulation broke, or the renderer does not answer.
    """
    look, also, words = through_cameras(how.size), frozenset[int](), None
    if shown is not None:
        look, also = policy_look(case, record, traces, shown, how.size)
        words = caption(record, shown)
    ticks = play_again(case, world, record, traces, look, how.every, also, simulate=shown is not None)
    frames = film_frames(record, traces, how.tell(ticks), how.size, words)
    write_film(path, frames, record.control_hz, how.overwrite)


@dataclass(frozen=True)
class RecordedRun:
    """A run on the disk with everything that its pairs need to be played again."""

    folder: Path
    stored: StoredRun
    cases: Mapping[str, Case]
    substrate: Substrate

    @property
    def outside(self) -> str | None:
        """A sentence on the places that the run names and that are not opened; None where it names none."""
        return outside_text(self.stored.run.provenance)

    def traces(self, record: PairRecord) -> dict[str, ArmTrace]:
        """Return the traces of a pair."""
        path = require_inside(self.folder, self.folder / TRACES_NAME / trace_name(record.item_id))
        if not path.exists():
            raise ReportError(
                f"{record.item_id} has no trace ({path} is missing), so its actions are not known. Play it "
                f"again with {traces_setting(self.stored.run.provenance)}."
            )
        return read_trace(path, record)

    def again(self, record: PairRecord, use: Callable[[Case, World, Mapping[str, ArmTrace]], None]) -> None:
        """Do something for which a pair is played again, for example :func:`film_pair`.

        Args:
            use: Plays it again; is given its case, its world and the traces of its arms.
        """
        case = self.cases.get(record.case_id)
        if case is None:
            raise ReportError(f"{record.item_id} is not among the cases of the run's track or manifest.")
        require_of_case(record, case)
        traces = self.traces(record)
        try:
            use(case, self.substrate.world(case), traces)
        except ProtocolError as error:
            raise ProtocolError(f"{error} {self._differences(record, case)}") from error

    def replayed(self, record: PairRecord) -> str:
        """Execute the recorded actions of a pair, without its policy, and compare how its arms end.

        Returns:
            Empty if steps, success and proof of each arm come out as recorded; otherwise what differs, or why
            the pair could not be replayed.
        """
        ends: dict[str, bool] = {}

        def look(name: str, step: int, world: World, before: View | None) -> View:
            if step == record.arms[name].steps:
                ends[name] = world.succeeded()
            return View({}, 0.0)

        def play(case: Case, world: World, traces: Mapping[str, ArmTrace]) -> None:
            for _ in play_again(case, world, record, traces, look):
                pass

        try:
            self.again(record, play)
        except LiberoMaxError as error:
            return str(error)
        return "; ".join(
            f"{name}: success {record.arms[name].success}, then {success}"
            for name, success in ends.items()
            if success != record.arms[name].success
        )

    def drawn_differently(self) -> str | None:
        """Return the renderers here and of the run, where they differ; None where they do not.

        Only what the run recorded is compared. No digest covers the images: two renderers show the same
        states in slightly different pixels.
        """
        if not self.stored.records:
            return None
        then, now = self.stored.records[0].fingerprints, self.substrate.fingerprint(images=True)
        names = [name for name in RENDERING if name in then and then[name] != now.get(name)]
        if not names:
            return None
        differences = ", ".join(f"{name} {then.get(name)} then, {now.get(name)} here" for name in names)
        return f"Drawn by another renderer than in the run ({differences}): pixels may differ slightly."

    def _differences(self, record: PairRecord, case: Case) -> str:
        scene = scene_fingerprints(self.substrate.world(case), case.init_state_index)
        now = {**self.substrate.fingerprint(), **scene}
        different = [
            f"{name} {record.fingerprints[name]} then, {now[name]} now"
            for name in sorted(now.keys() & record.fingerprints.keys())
            if now[name] != record.fingerprints[name]
        ]
        if different:
            return f"Different from then: {'; '.join(different)}."
        return "The versions are the same; the trace may be of another run."


@contextmanager
def open_recorded(
    folder: Path,
    cases: str | None = None,
    installations: Sequence[Path] = (),
    assets: Path | None = None,
    *,
    for_people: bool = False,
) -> Iterator[RecordedRun]:
    """Open a run to play its pairs again, on the substrate that it was played on.

    Paths that the run names are not opened (:mod:`~pytest_libero_max.runs.outside`).

    Args:
        cases: Track or path of a manifest. None: the track of the run.
        installations: LIBERO's folders on this machine. None given: what ``import libero`` finds.
        assets: Models and textures for it. None: its own.
        for_people: True to draw the images that look best, False to draw those of the run.

    Raises:
        ReportError: The pairs cannot be read, or the run kept no traces.
        OptionError: The run played a manifest, and none is given.
        ManifestError: The cases cannot be read.
        SubstrateError: The substrate cannot be opened.
    """
    stored = read_pairs(folder)
    provenance = stored.run.provenance
    home = pairs_file(folder).parent
    if not (home / TRACES_NAME).is_dir():
        raise ReportError(
            f"{home} has no {TRACES_NAME}, so the actions of its pairs are not known. Play the run again "
            f"with {traces_setting(provenance)}."
        )
    cases_played = {case.case_id: case for case in cases_of_run(provenance, cases)}
    chosen_there = described_substrate(provenance["substrate"])
    there = chosen_there.options.for_people() if for_people else chosen_there.options
    options = replace(there, installations=tuple(installations), assets=assets)
    substrate = open_substrate(chosen_there.name, options)
    try:
        yield RecordedRun(home, stored, cases_played, substrate)
    finally:
        substrate.close()


def chosen(stored: StoredRun, names: Sequence[str], which: str) -> list[PairRecord]:
    """Return the pairs to film, those of one scene behind each other.

    Args:
        names: Item ids, case ids, or expressions over parts of them as for pytest's ``-k``; none: ``which``
            decides.

    Raises:
        OptionError: A name is not that of a measured pair, nor a part of one; suggests the closest.
    """
    records = sorted(stored.records, key=lambda record: record.item_id)
    if not names:
        return [record for record in records if is_selected(record, which)]
    wanted: set[str] = set()
    for name in names:
        exact = {record.item_id for record in records if name in (record.case_id, record.item_id)}
        matching = exact or {record.item_id for record in records if matches(name, _keywords(record))}
        if not matching:
            raise OptionError.seen(
                "case",
                name,
                f" is neither a measured pair of this run nor a part of the name of one. "
                f"{did_you_mean(name, [record.item_id for record in records])}",
            )
        wanted |= matching
    return [record for record in records if record.item_id in wanted]


def _keywords(record: PairRecord) -> tuple[str, ...]:
    """Names of a pair that ``-k`` looks at: the item, and its markers."""
    markers = (record.event, record.family, record.suite, f"variant_{record.variant}", record.source)
    return (record.case_id, record.item_id, *markers)
