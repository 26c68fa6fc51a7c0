"""The cases of a run: the whole track or manifest, and the part of it that the settings choose."""

from __future__ import annotations

from collections import Counter
from functools import cached_property

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json, known
from pytest_libero_max.benchmark.manifests import Manifest, load_manifest
from pytest_libero_max.errors import LiberoMaxError, OptionError
from pytest_libero_max.evaluation.case_support import supported_cases
from pytest_libero_max.evaluation.resolving import about
from pytest_libero_max.evaluation.settings import Settings
from pytest_libero_max.events.registry import check_cases, family_of


class RunCases:
    """The cases that settings choose. Each property raises ``OptionError`` where they cannot be chosen."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings

    @cached_property
    def manifest(self) -> Manifest:
        """The whole track or manifest, with the program of the run laid over it."""
        from pytest_libero_max.benchmark.tracks import load_track

        settings = self._settings
        try:
            manifest = load_manifest(settings.manifest) if settings.manifest else load_track(settings.track)
        except LiberoMaxError as error:
            raise OptionError(str(error)) from None
        with about(f"{settings.manifest or settings.case_set}: "):
            check_cases(manifest.cases)
        if settings.program is not None:
            with about("--libero-max-program: "):
                manifest = manifest.playing(settings.program)
                check_cases(manifest.cases)
        return manifest

    @cached_property
    def of_all_shards(self) -> tuple[Case, ...]:
        """Cases of this run and of the other shards."""
        from pytest_libero_max.benchmark.sampling import stratified

        settings, cases = self._settings, self.manifest.cases
        if settings.program is not None:
            cases = tuple(case for case in cases if case.program is not None)
        if settings.suites is not None:
            cases = tuple(case for case in cases if case.suite in settings.suites)
        if settings.only_installed and cases:
            with about("--libero-max-only-installed: "):
                cases = supported_cases(
                    settings.case_set, cases, settings.substrate.name, settings.substrate_options
                )
        return cases if settings.limit is None else stratified(cases, settings.limit)

    @cached_property
    def chosen(self) -> tuple[Case, ...]:
        """Cases of the run, in the order of play."""
        from pytest_libero_max.benchmark.sampling import shard

        settings, cases = self._settings, self.of_all_shards
        if settings.shard is not None:
            number, count = settings.shard
            with about(f"--libero-max-shard={number}/{count}: "):
                cases = shard(cases, number, count)
        return settings.order.of(cases)

    @cached_property
    def with_second_base(self) -> frozenset[str]:
        """Item ids of the cases of the run whose Base is played twice."""
        from pytest_libero_max.benchmark.sampling import stratified

        count = self._settings.noise.floor
        chosen = stratified(self.chosen, count) if count else ()
        return frozenset(case.item_id for case in chosen)

    @property
    def left_out_by_program(self) -> Counter[str]:
        """Number of cases that the program of the run does not fit, by event."""
        if self._settings.program is None:
            return Counter()
        return Counter(case.event.name for case in self.manifest if case.program is None)

    @property
    def asked(self) -> list[str]:
        """Settings that leave cases out, apart from the shard, as a command line spells them."""
        settings, asked = self._settings, []
        if settings.program is not None and self.left_out_by_program:
            asked.append(f"--libero-max-program={settings.program.source}")
        asked += ["--libero-max-only-installed"] if settings.only_installed else []
        asked += [] if settings.suites is None else [f"--libero-max-suites={','.join(settings.suites)}"]
        return asked + ([] if settings.limit is None else [f"--libero-max-limit={settings.limit}"])

    @property
    def provenance(self) -> Json:
        """The case set in the provenance of the run."""
        settings, manifest = self._settings, self.manifest
        recognition = manifest.recognition
        return {
            "name": settings.case_set,
            "digest": manifest.digest,
            "limit": settings.limit,
            **known(
                path=None if settings.manifest is None else str(settings.manifest),
                program=None if settings.program is None else settings.program.source,
                study=None if settings.study is None else settings.study.source,
                released_as=None if recognition is None else str(recognition),
            ),
        }


def markers_of(case: Case) -> tuple[str, ...]:
    """Return the names of the markers of a pair."""
    return (
        case.event.name,
        family_of(case.event.name),
        case.suite,
        f"variant_{case.event.variant}",
        f"source_{case.source}",
        category_marker(case),
    )


def category_marker(case: Case) -> str:
    """Return the marker of a case's source category."""
    return f"category_{case.source_category.lower().replace(' ', '_')}"
