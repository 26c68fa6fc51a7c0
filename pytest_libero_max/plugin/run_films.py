"""Films of a run's pairs, made at its end by the processors that have nothing left to play."""

from __future__ import annotations

import multiprocessing
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from multiprocessing.connection import Connection, wait

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.errors import class_name, text_of
from pytest_libero_max.evaluation.settings import Settings
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.broken import named_of
from pytest_libero_max.report.report_document import ChangedPair
from pytest_libero_max.runs.media import FILMS_NAME, MOST_FILMS, is_selected

_LONGEST_S = 300.0
"""Wall-clock time after which processes that have finished no film are ended."""
_FILMS_OF_A_PROCESS = 4
"""Number of films for which a process is worth its start."""

Told = Callable[[str, str | None], None]
"""Called with the name of a pair once it is filmed, and why it could not be."""


def chosen_for_films(
    settings: Settings, records: Sequence[PairRecord], changed: Sequence[ChangedPair]
) -> tuple[list[PairRecord], int]:
    """Return the pairs to film, and the number of all that the option selects."""
    selected = {record.item_id: record for record in records if is_selected(record, settings.film.which)}
    limit = settings.film.most or (len(records) if settings.film.which == "all" else MOST_FILMS)
    named = named_of(changed, limit)
    if settings.film.which == "all":
        named = list(dict.fromkeys([*named, *selected]))[:limit]
    return [selected[name] for name in named if name in selected], len(selected)


def make_films(
    settings: Settings, cases: Mapping[str, Case], records: Sequence[PairRecord], processes: int
) -> tuple[int, list[str]]:
    """Make the films of pairs that have none.

    Args:
        processes: Number of processes to make them in; 0: in this one.

    Returns:
        The number of pairs that have a film, and messages about the others.
    """
    told: dict[str, str | None] = {}
    if processes == 0:
        _film(settings, cases, records, told.__setitem__)
    else:
        share = min(processes, -(-len(records) // _FILMS_OF_A_PROCESS))
        longest = sorted(records, key=_steps, reverse=True)
        _film_in_processes(settings, cases, [longest[place::share] for place in range(share)], told)
    lost = [record.item_id for record in records if record.item_id not in told]
    notes = [f"no film of {name}: {reason}" for name, reason in told.items() if reason is not None]
    notes += [f"no film of {name}: its process ended before" for name in lost]
    return len(records) - len(notes), notes


def _steps(record: PairRecord) -> int:
    return sum(arm.steps for arm in record.arms.values())


def _film(settings: Settings, cases: Mapping[str, Case], records: Sequence[PairRecord], told: Told) -> None:
    """Film pairs in this process. Whatever a renderer or an encoder raises, the pairs are measured."""
    from pytest_libero_max.films.recorded import film_pair, film_path
    from pytest_libero_max.pairing.trace import read_trace, trace_name
    from pytest_libero_max.runs.media import TRACES_NAME
    from pytest_libero_max.substrates.registry import open_substrate

    options = settings.substrate_options.for_people()
    with closing(open_substrate(settings.substrate.name, options)) as substrate:
        for record in records:
            path = film_path(settings.output / FILMS_NAME, record)
            reason = None
            try:
                if not path.exists():
                    case = cases[record.case_id]
                    traces = read_trace(settings.output / TRACES_NAME / trace_name(record.item_id), record)
                    film_pair(path, case, substrate.world(case), record, traces)
            except Exception as error:
                reason = f"{class_name(error)}: {text_of(error)}"
            told(record.item_id, reason)


def _film_in_processes(
    settings: Settings,
    cases: Mapping[str, Case],
    shares: Sequence[Sequence[PairRecord]],
    told: dict[str, str | None],
) -> None:
    """Film pairs in children of this process, which has drawn nothing itself."""
    forked = multiprocessing.get_context("fork")  # so that what conftest files register is there
    children, open_ends = [], []
    try:
        for share in shares:
            ours, theirs = forked.Pipe(duplex=False)
            child = forked.Process(target=_be_child, args=(settings, cases, share, theirs), daemon=True)
            with warnings.catch_warnings():
                # The threads of this process, such as xdist's receiver, do not go on in the child.
                warnings.simplefilter("ignore", DeprecationWarning)
                child.start()
            theirs.close()
            children.append(child)
            open_ends.append(ours)
        while open_ends and (ready := wait(open_ends, _LONGEST_S)):
            for end in ready:
                assert isinstance(end, Connection)
                try:
                    name, reason = end.recv()
                except EOFError:
                    open_ends.remove(end)
                else:
                    told[name] = reason
    finally:
        for child in children:
            child.kill()
            child.join()


def _be_child(
    settings: Settings, cases: Mapping[str, Case], records: Sequence[PairRecord], end: Connection
) -> None:
    from pytest_libero_max.worlds.threads import use_one_blas_thread

    use_one_blas_thread()
    _film(settings, cases, records, lambda name, reason: end.send((name, reason)))
