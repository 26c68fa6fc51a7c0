"""Plays a pair in the process it is called in, with pytest's fixtures."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from time import perf_counter
from typing import TYPE_CHECKING, NoReturn, TypeVar

import pytest
from msgspec import structs

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.latency import NO_LATENCY
from pytest_libero_max.costs.model import PAIR, WORLD
from pytest_libero_max.errors import AdapterError, LiberoMaxError, RefusalError, class_name, text_of
from pytest_libero_max.pairing.record import FILES, RESET_FILES, PairError, PairRecord
from pytest_libero_max.plugin.collection import markers_of, noise_cases_of, settings_of
from pytest_libero_max.plugin.options import Settings
from pytest_libero_max.plugin.processes.left_running import left_running
from pytest_libero_max.plugin.processes.pair_process import PairProcess, pair_process_of
from pytest_libero_max.plugin.processes.sending import encodable
from pytest_libero_max.plugin.run_stop import stop_run
from pytest_libero_max.plugin.stash_keys import ADAPTER_DIGEST, DECLARED, LOADED, NOTE, POLICY_PHASE, RESULT
from pytest_libero_max.runs.media import TRACES_NAME

if TYPE_CHECKING:
    from pytest_libero_max.events.schedules import Arm
    from pytest_libero_max.pairing.runner import Pair
    from pytest_libero_max.policies.contract import Policy
    from pytest_libero_max.worlds.contract import World

Result = TypeVar("Result")

SERVER = "server"
"""Among the timings of a pair: address of the policy server that answered last."""

BROKEN_POLICY = "the policy cannot be played"
"""Reason of a stop: every other pair would end in the same way."""


AGAIN_AFTER = 8
"""Pairs that a process has played when it plays its first one again, once."""

LIMIT_REACHED = (
    "a pair reached a limit in the session's own process, which cannot be trusted any more. Play with -n 1 "
    "or --libero-max-isolate, so that the other pairs go on"
)


@dataclass
class _First:
    """The first pair of a process, and the number of pairs that it has played."""

    case: Case
    record: PairRecord
    pairs: int = 0


_FIRST = pytest.StashKey[_First]()


def play_here(request: pytest.FixtureRequest, case: Case) -> PairRecord:
    """Play a pair in the process of the session or of its worker; an error is kept on the item."""
    process = pair_process_of(request.config)
    try:
        with process.pair(), left_running(request.config).pair():
            return play(request, case, process)
    except Unsupported as unsupported:
        pytest.skip(str(unsupported))
    except BaseException as error:
        raised = error
    return _leave(request, case, process, raised)


def _leave(
    request: pytest.FixtureRequest, case: Case, process: PairProcess, error: BaseException
) -> NoReturn:
    """Keep an error on the item and fail it; outside of the error's handler, or pytest shows it twice."""
    from pytest_libero_max.policies.check import ends_the_session

    limit = process.ended_by(error)
    if limit is None and ends_the_session(error):
        raise error
    request.node.stash[RESULT] = PairError.of(case, limit or error, process.phase).to_dict()
    if limit is not None:
        stop_run(request.node, LIMIT_REACHED)
        pytest.fail(explain(limit), pytrace=False)
    if process.phase == POLICY_PHASE:
        stop_run(request.node, BROKEN_POLICY)
    if isinstance(error, LiberoMaxError):
        pytest.fail(explain(error), pytrace=False)
    whole = "".join(traceback.format_exception(error))
    if encodable(whole) != whole:  # a reporter would read the exception itself, and write it as UTF-8
        pytest.fail(encodable(whole), pytrace=False)
    if not isinstance(error, Exception):
        # pytest keeps no fixture that ends like this, and every later item would fail for another reason.
        raise LiberoMaxError(f"{type(error).__name__} in phase {process.phase!r}: {error}") from error
    raise error


class Unsupported(Exception):
    """The policy declares that it does not support the suite of the case."""


def play(request: pytest.FixtureRequest, case: Case, process: PairProcess) -> PairRecord:
    """Play a pair in this process.

    Raises:
        Unsupported: The policy does not play this suite.
        BaseException: Whatever a policy, a fixture or the simulator raises; the process knows the phase.
    """
    # Asked for here, not in the signature: what goes wrong in them belongs to the pair as well.
    process.enter(POLICY_PHASE)
    policy = request.getfixturevalue("libero_max_policy")
    loaded = request.config.stash.get(LOADED, None)
    if loaded is None or policy is not loaded:
        raise AdapterError(
            "the fixture libero_max_policy is overridden, so another policy than "
            f"{settings_of(request.config).reference!r} would be played under its name. Take the fixture "
            "away, and name the adapter that is to be played with --libero-max-policy."
        )
    if not policy.spec.supports(case.suite):
        suites = ", ".join(policy.spec.suites or ())
        raise Unsupported(f"unsupported: policy {policy.spec.name!r} declares the suites {suites}")
    process.enter("setup")
    troubles: list[str] = getattr(policy, "troubles", [])
    with process.watchdog.pair():
        pair = _on_servers(policy, case, lambda: _measure(request, case, process, policy))
    server = getattr(policy, "server", None)
    pair = pair if server is None else _timed(pair, {SERVER: server})
    notes = [*troubles, *_keep(pair, settings_of(request.config))]
    troubles.clear()
    if notes:
        request.node.stash[NOTE] = "; ".join(notes)
    _require_first_pair_again(request, case, pair.record, policy, process)
    return pair.record


def _require_first_pair_again(
    request: pytest.FixtureRequest, case: Case, record: PairRecord, policy: Policy, process: PairProcess
) -> None:
    """After some pairs play the first one of this process again: another one if the policy remembers them.

    Base alone is played again: half of the time, and the other arms share its beginning and its policy.

    Raises:
        RefusalError: It came out otherwise than before.
    """
    if not policy.spec.repeatable:
        return
    config = request.config
    first = config.stash.setdefault(_FIRST, _First(case, record))
    first.pairs += 1
    if first.pairs != AGAIN_AFTER:
        return
    try:
        with process.watchdog.pair():
            world = request.getfixturevalue("libero_max_substrate").world(first.case)
            arms = _arms(first.case, policy, config)[:1]
            again = _on_servers(
                policy,
                first.case,
                lambda: _measure_arms(first.case, world, policy, config, process, {}, arms),
            ).record.arms
        different = [name for name, arm in again.items() if first.record.arms[name].proof != arm.proof]
        if different:
            raise RefusalError(
                f"the policy remembers something from pair to pair: {first.case.item_id} was played again "
                f"after {AGAIN_AFTER} pairs, and {' and '.join(different)} came out otherwise, so that "
                "results depend on what was played before. Let reset() empty queues, histories, counters and "
                "generators; libero-max check finds most of it. Declare PolicySpec(repeatable=False) only "
                "for a server whose arithmetic varies."
            )
    except AdapterError:
        process.enter(POLICY_PHASE)
        raise


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


def _measure(request: pytest.FixtureRequest, case: Case, process: PairProcess, policy: Policy) -> Pair:
    from pytest_libero_max.pairing.scene_fingerprints import scene_fingerprints
    from pytest_libero_max.policies.adapter_digest import adapter_digest
    from pytest_libero_max.policies.check import check_cameras

    settings, begin = settings_of(request.config), perf_counter()
    substrate = request.getfixturevalue("libero_max_substrate")
    world = request.getfixturevalue("libero_max_world")
    world_s = perf_counter() - begin
    if ADAPTER_DIGEST not in request.config.stash:
        process.enter(POLICY_PHASE)
        check_cameras(policy, world)
        if settings.study is not None:
            settings.study.check_policy(policy.spec)
        request.config.stash[ADAPTER_DIGEST] = adapter_digest(
            settings.reference, settings.profile, settings.revision
        )
        process.enter("setup")
    fingerprints = {
        **substrate.fingerprint(images=bool(policy.spec.cameras)),
        **scene_fingerprints(world, case.init_state_index),
        "adapter": request.config.stash[ADAPTER_DIGEST],
    }
    if settings.strength != 1.0:
        fingerprints["strength"] = f"{settings.strength:g}"
    if settings.latency != NO_LATENCY:
        fingerprints["latency"] = str(settings.latency)
    _require_declared_spec(request.config, policy)
    pair = _measure_arms(case, world, policy, request.config, process, fingerprints)
    if settings.study is not None:
        settings.study.check(pair)
    pair = _with_files(pair, policy, settings)
    return _timed(pair, {WORLD: world_s, PAIR: perf_counter() - begin})


def _measure_arms(
    case: Case,
    world: World,
    policy: Policy,
    config: pytest.Config,
    process: PairProcess,
    fingerprints: Mapping[str, str],
    arms: tuple[Arm, ...] | None = None,
) -> Pair:
    """Measure some arms of a case; None: all of them."""
    from pytest_libero_max.pairing.probes.registry import probes_called
    from pytest_libero_max.pairing.runner import PairSettings, measure_pair

    settings = settings_of(config)
    return measure_pair(
        case,
        world,
        policy,
        PairSettings(
            settings.prefix,
            fingerprints,
            process.watchdog,
            probes_called(settings.probe),
            films=settings.film != "none",
        ),
        process.enter,
        _arms(case, policy, config) if arms is None else arms,
    )


def _with_files(pair: Pair, policy: Policy, settings: Settings) -> Pair:
    """Return the pair with the files that its policy has read, unless a revision names what it is."""
    from pytest_libero_max.policies.adapter_digest import names_its_files
    from pytest_libero_max.policies.files_read import FILES_READ

    if policy.spec.revision is not None or not names_its_files(settings.reference):
        return pair
    named = pair.record.policy | {FILES: dict(FILES_READ.files)}
    if FILES_READ.reset_files:
        named[RESET_FILES] = dict(sorted(FILES_READ.reset_files.items()))
    return replace(pair, record=structs.replace(pair.record, policy=named))


def _timed(pair: Pair, said: Mapping[str, float | str]) -> Pair:
    """Return the pair with more timings in its record."""
    rounded = {name: round(value, 6) if isinstance(value, float) else value for name, value in said.items()}
    timings = pair.record.timings | rounded
    return replace(pair, record=structs.replace(pair.record, timings=dict(sorted(timings.items()))))


def _arms(case: Case, policy: Policy, config: pytest.Config) -> tuple[Arm, ...]:
    """Return the arms of a case: those of the pair, the noise floor's, the sham's, and those of the study."""
    from pytest_libero_max.benchmark.sampling import in_share
    from pytest_libero_max.events.schedules import arms_of
    from pytest_libero_max.policies.contract import CHANCE_SHARE

    settings = settings_of(config)
    repeat_base = case.item_id in noise_cases_of(config)
    share = settings.sham if settings.sham is not None else 0.0 if policy.spec.repeatable else CHANCE_SHARE
    sham = bool(in_share((case,), share, "sham"))
    arms = arms_of(case, repeat_base, settings.strength, sham)
    if settings.study is not None:
        arms = (*arms, *settings.study.arms(case, policy.spec, settings.strength))
    return tuple(replace(arm, latency=settings.latency) if arm.latency == NO_LATENCY else arm for arm in arms)


def _keep(pair: Pair, settings: Settings) -> list[str]:
    """Write the trace that the options ask for, also for a film; return messages about failures."""
    from pytest_libero_max.pairing.trace import write_trace
    from pytest_libero_max.runs.media import is_selected

    if any(is_selected(pair.record, which) for which in (settings.film, settings.traces)):
        try:
            write_trace(settings.output / TRACES_NAME, pair)
        except (OSError, ValueError) as error:
            return [f"no trace of {pair.record.item_id}: {error}"]
    return []


def _require_declared_spec(config: pytest.Config, policy: Policy) -> None:
    """Check that the policy's spec is that of before its first pair.

    Raises:
        RefusalError: Its spec has changed.
    """
    from pytest_libero_max.policies.check import require_spec

    known, spec = config.stash.get(DECLARED, (None, None))
    if known is not policy:
        spec = replace(policy.spec)
        config.stash[DECLARED] = (policy, spec)
    assert isinstance(spec, type(policy.spec))
    require_spec(policy, spec, "an earlier pair")


def explain(error: BaseException) -> str:
    """Return the message with the frames of the user's own code and none of this package, fit for UTF-8."""
    text = f"{class_name(error)}: {text_of(error)}"
    cause = error.__cause__
    if cause is not None and not isinstance(cause, LiberoMaxError):
        text += "\n\n" + "".join(traceback.format_exception(type(cause), cause, cause.__traceback__))
    return encodable(text)
