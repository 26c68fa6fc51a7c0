"""Player of pairs: plays a case in the process it is called in, whoever asks for it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from time import perf_counter
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from msgspec import structs

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.latency import NO_LATENCY
from pytest_libero_max.errors import AdapterError, RefusalError
from pytest_libero_max.evaluation.policy_source import PolicySource, close_policy
from pytest_libero_max.evaluation.processes.pair_process import Playing
from pytest_libero_max.evaluation.run_cases import markers_of
from pytest_libero_max.pairing.record import FILES, POLICY_PHASE, RESET_FILES, PairError, PairRecord
from pytest_libero_max.pairing.record_rules import SERVER
from pytest_libero_max.runs.media import TRACES_NAME

if TYPE_CHECKING:
    from pytest_libero_max.events.schedules import Arm
    from pytest_libero_max.pairing.runner import Pair
    from pytest_libero_max.policies.contract import Policy, PolicySpec
    from pytest_libero_max.substrates.contract import Substrate
    from pytest_libero_max.worlds.contract import World

Result = TypeVar("Result")

BROKEN_POLICY = "the policy cannot be played"
"""Reason of a stop: every other pair would end in the same way."""

PAIR = "pair_s"
"""Among the timings of a pair: all of it and the building of its scene, but not the loading of the policy."""

WORLD = "world_s"
"""Among the timings of a pair: the building of its scene; almost nothing where it is built already."""

AGAIN_AFTER = 8
"""Pairs that a process has played when it plays its first one again, once."""


class Sources(Protocol):
    """Where a player takes policy and worlds from; what goes wrong in them belongs to the pair as well."""

    def policy(self) -> Policy: ...

    def substrate(self) -> Substrate: ...

    def world(self, case: Case) -> World: ...


class Unsupported(Exception):
    """The policy declares that it does not support the suite of the case."""


@dataclass(frozen=True)
class PlayedPair:
    """A measured pair."""

    record: PairRecord
    note: str | None
    """Failures beside it, for example of a trace; None for none."""


@dataclass(frozen=True)
class FailedPair:
    """A pair that could not be measured."""

    error: PairError
    limit: bool
    """True if a limit of the process ended it, which cannot be trusted any more."""

    @classmethod
    def of(cls, case: Case, process: Playing, error: BaseException) -> FailedPair:
        """Return the failure of a pair.

        Raises:
            BaseException: The error itself, where it is meant for the program and not for the pair.
        """
        from pytest_libero_max.policies.check import ends_the_session

        limit = process.ended_by(error)
        if limit is None and ends_the_session(error):
            raise error
        return cls(PairError.of(case, limit or error, process.phase), limit is not None)


@dataclass
class _First:
    """The first pair of a process, and the number of pairs that it has played."""

    case: Case
    record: PairRecord
    pairs: int = 0


class PairPlayer:
    """Plays pairs of a run in this process."""

    def __init__(self, source: PolicySource, with_second_base: Collection[str]) -> None:
        self._source, self._settings = source, source.settings
        self._with_second_base = with_second_base
        self._adapter: str | None = None
        self._declared: tuple[Policy, PolicySpec] | None = None
        self._first: _First | None = None
        self._of_arms: dict[str, Any] = {}
        study = source.settings.study
        self._references: Mapping[str, str | None] = {} if study is None else study.policies

    def play(self, case: Case, sources: Sources, process: Playing) -> PlayedPair:
        """Play a pair.

        Raises:
            Unsupported: The policy does not play this suite.
            BaseException: Whatever a policy, a source or the simulator raises.
        """
        process.enter(POLICY_PHASE)
        policy = sources.policy()
        if not policy.spec.supports(case.suite):
            suites = ", ".join(policy.spec.suites or ())
            raise Unsupported(f"unsupported: policy {policy.spec.name!r} declares the suites {suites}")
        process.enter("setup")
        troubles: list[str] = getattr(policy, "troubles", [])
        with process.watchdog.pair():
            pair = _on_servers(policy, case, lambda: self._measure(case, sources, process, policy))
        server = getattr(policy, "server", None)
        pair = pair if server is None else _timed(pair, {SERVER: server})
        notes = [*troubles, *self._keep(pair)]
        troubles.clear()
        self._require_first_pair_again(case, pair.record, policy, sources, process)
        return PlayedPair(pair.record, "; ".join(notes) or None)

    def _require_first_pair_again(
        self, case: Case, record: PairRecord, policy: Policy, sources: Sources, process: Playing
    ) -> None:
        """After some pairs play the first one again: it comes out otherwise if the policy remembers them.

        Base alone is played again: half of the time, and the other arms share its beginning and its policy.
        """
        if not policy.spec.repeatable:
            return
        first = self._first = self._first or _First(case, record)
        first.pairs += 1
        if first.pairs != AGAIN_AFTER:
            return
        try:
            with process.watchdog.pair():
                world = sources.substrate().world(first.case)
                arms = self._arms(first.case, policy)[:1]
                replayed = _on_servers(
                    policy,
                    first.case,
                    lambda: self._measure_arms(first.case, world, policy, process, {}, arms),
                ).record.arms
            different = [name for name, arm in replayed.items() if first.record.arms[name].proof != arm.proof]
            if different:
                raise RefusalError(
                    f"the policy remembers something from pair to pair: {first.case.item_id} was played "
                    f"again after {AGAIN_AFTER} pairs, and {' and '.join(different)} came out otherwise, so "
                    "that results depend on what was played before. Let reset() empty queues, histories, "
                    "counters and generators; libero-max check finds most of it. Declare "
                    "PolicySpec(repeatable=False) only for a server whose arithmetic varies."
                )
        except AdapterError:
            process.enter(POLICY_PHASE)
            raise

    def _measure(self, case: Case, sources: Sources, process: Playing, policy: Policy) -> Pair:
        from pytest_libero_max.pairing.scene_fingerprints import scene_fingerprints
        from pytest_libero_max.policies.check import check_cameras

        study, begin = self._settings.study, perf_counter()
        substrate = sources.substrate()
        world = sources.world(case)
        world_s = perf_counter() - begin
        if self._adapter is None:
            process.enter(POLICY_PHASE)
            check_cameras(policy, world)
            if study is not None:
                study.check_policy(policy.spec)
            self._adapter = self._source.identity()
            process.enter("setup")
        fingerprints = {
            **substrate.fingerprint(images=bool(policy.spec.cameras)),
            **scene_fingerprints(world, case.init_state_index),
            "adapter": self._adapter,
            **self._settings.played,
        }
        self._require_declared_spec(policy)
        arms = self._played_by(self._arms(case, policy), case, world, process)
        pair = self._measure_arms(case, world, policy, process, fingerprints, arms)
        if study is not None:
            study.check(pair)
        pair = _with_codes(self._with_files(pair, policy), self._references)
        return _timed(pair, {WORLD: world_s, PAIR: perf_counter() - begin})

    def _played_by(
        self, arms: tuple[Arm, ...], case: Case, world: World, process: Playing
    ) -> tuple[Arm, ...]:
        """Load the policies that arms name; return the arms whose policy plays the suite of the case."""
        from pytest_libero_max.policies.check import check_cameras
        from pytest_libero_max.policies.loading import installed_policy, load_policy

        for name in dict.fromkeys(arm.policy for arm in arms if arm.policy is not None):
            if name not in self._of_arms:
                process.enter(POLICY_PHASE)
                reference = self._references.get(name)
                self._of_arms[name] = (
                    installed_policy(name) if reference is None else load_policy(reference, further=True)
                )
                check_cameras(self._of_arms[name], world)
                process.enter("setup")
            if hasattr(self._of_arms[name], "begin_pair"):
                self._of_arms[name].begin_pair(markers_of(case))
        return tuple(
            arm for arm in arms if arm.policy is None or self._of_arms[arm.policy].spec.supports(case.suite)
        )

    def close(self) -> None:
        """Close the policies of arms, which are kept from pair to pair."""
        while self._of_arms:
            close_policy(self._of_arms.popitem()[1])

    def _measure_arms(
        self,
        case: Case,
        world: World,
        policy: Policy,
        process: Playing,
        fingerprints: Mapping[str, str],
        arms: tuple[Arm, ...],
    ) -> Pair:
        from pytest_libero_max.pairing.probes.registry import probes_called
        from pytest_libero_max.pairing.runner import PairSettings, measure_pair

        settings = self._settings
        how = PairSettings(
            settings.prefix,
            fingerprints,
            process.watchdog,
            probes_called(settings.probe),
            films=settings.film.which != "none",
            policies=self._of_arms,
        )
        return measure_pair(case, world, policy, how, process.enter, arms)

    def _arms(self, case: Case, policy: Policy) -> tuple[Arm, ...]:
        """Return the arms of a case: the pair's, the noise floor's, the sham's, and those of the study."""
        from pytest_libero_max.benchmark.sampling import in_share
        from pytest_libero_max.events.schedules import arms_of
        from pytest_libero_max.policies.contract import CHANCE_SHARE

        settings = self._settings
        repeat_base = case.item_id in self._with_second_base
        by_policy = 0.0 if policy.spec.repeatable else CHANCE_SHARE
        share = by_policy if settings.noise.sham is None else settings.noise.sham
        sham = bool(in_share((case,), share, "sham"))
        arms = arms_of(case, repeat_base, settings.strength, sham)
        if settings.study is not None:
            arms = (*arms, *settings.study.arms(case, policy.spec, settings.strength))
        return tuple(
            replace(arm, latency=settings.latency) if arm.latency == NO_LATENCY else arm for arm in arms
        )

    def _with_files(self, pair: Pair, policy: Policy) -> Pair:
        """Return the pair with the files that its policy has read, unless a revision names what it is."""
        from pytest_libero_max.policies.files_read import FILES_READ

        if policy.spec.revision is not None or not self._source.names_files:
            return pair
        named = pair.record.policy | {FILES: dict(FILES_READ.files)}
        if FILES_READ.reset_files:
            named[RESET_FILES] = dict(sorted(FILES_READ.reset_files.items()))
        return replace(pair, record=structs.replace(pair.record, policy=named))

    def _keep(self, pair: Pair) -> list[str]:
        """Write the trace that the settings ask for, also for a film; return messages about failures."""
        from pytest_libero_max.pairing.trace import write_trace
        from pytest_libero_max.runs.media import is_selected

        settings = self._settings
        if any(is_selected(pair.record, which) for which in (settings.film.which, settings.traces)):
            try:
                write_trace(settings.output / TRACES_NAME, pair)
            except (OSError, ValueError) as error:
                return [f"no trace of {pair.record.item_id}: {error}"]
        return []

    def _require_declared_spec(self, policy: Policy) -> None:
        """Check that the policy's spec is that of before its first pair."""
        from pytest_libero_max.policies.check import require_spec

        if self._declared is None or self._declared[0] is not policy:
            self._declared = policy, replace(policy.spec)
        require_spec(policy, self._declared[1], "an earlier pair")


def _on_servers(policy: Policy, case: Case, measure: Callable[[], Result]) -> Result:
    """Measure a pair; again where the server that kept the policy's memory was left out for another one."""
    from pytest_libero_max.policies.clients.fleet import OtherServer

    if hasattr(policy, "begin_pair"):
        policy.begin_pair(markers_of(case))
    while True:
        try:
            return measure()
        except OtherServer:  # each time one server less is left, and then another error is raised
            continue


def _with_codes(pair: Pair, references: Mapping[str, str | None]) -> Pair:
    """Return the pair with reference and identity of each policy that an arm names.

    Args:
        pair: The pair, whose arms know names.
        references: Their references by name; without one, or None, for those that are installed.
    """
    from pytest_libero_max.policies.adapter_digest import adapter_digest

    arms = dict(pair.record.arms)
    for name, arm in arms.items():
        if arm.policy is not None:
            reference = references.get(arm.policy["reference"]) or arm.policy["reference"]
            spec = {**arm.policy, "reference": reference, "code": adapter_digest(reference)}
            arms[name] = structs.replace(arm, policy=spec)
    return replace(pair, record=structs.replace(pair.record, arms=arms))


def _timed(pair: Pair, said: Mapping[str, float | str]) -> Pair:
    """Return the pair with more timings in its record."""
    rounded = {name: round(value, 6) if isinstance(value, float) else value for name, value in said.items()}
    timings = pair.record.timings | rounded
    return replace(pair, record=structs.replace(pair.record, timings=dict(sorted(timings.items()))))
