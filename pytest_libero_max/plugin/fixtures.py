"""The public fixtures: loading the policy, replaying the prefix, injecting the event, playing the pair.

They work in any test module; a test that asks for ``libero_max_case``, directly or through another
fixture, gets one item for each case of the track.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import AdapterError, LiberoMaxError
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.plugin.collection import noise_cases_of, settings_of
from pytest_libero_max.plugin.options import POLICY_FLAG, Settings
from pytest_libero_max.plugin.stash_keys import ADAPTER_DIGEST, DECLARED, NOTE, POLICY_PHASE, RESULT
from pytest_libero_max.report.junit import properties
from pytest_libero_max.report.media import FILMS_NAME, TRACES_NAME

if TYPE_CHECKING:
    from pytest_libero_max.pairing.prefix import BranchPoint
    from pytest_libero_max.pairing.runner import Pair
    from pytest_libero_max.policies.contract import Policy
    from pytest_libero_max.worlds.contract import Substrate, World


@pytest.fixture(scope="session")
def libero_max_settings(pytestconfig: pytest.Config) -> Settings:
    """The plugin's options as they resolved."""
    return settings_of(pytestconfig)


@pytest.fixture(scope="session")
def libero_max_policy(libero_max_settings: Settings) -> Policy:
    """The policy under test, loaded once a worker."""
    from pytest_libero_max.policies.check import ends_the_session
    from pytest_libero_max.policies.loading import load_policy

    settings = libero_max_settings
    if settings.policy is None:
        pytest.fail(
            f"This test needs a policy: give {POLICY_FLAG}=adapter.py, or set libero_max_policy in the ini "
            "file.",
            pytrace=False,
        )
    try:
        return load_policy(
            settings.policy,
            horizon=settings.horizon,
            query_interval=settings.query_interval,
            profile=settings.profile,
        )
    except BaseException as error:
        if isinstance(error, Exception) or ends_the_session(error):
            raise
        # pytest keeps no fixture that ends like this, and every later item would fail for another reason.
        raise AdapterError(
            f"policy {settings.policy!r} raised {type(error).__name__} while it was loaded: {error}. Repair "
            "the adapter."
        ) from error


@pytest.fixture(scope="session")
def libero_max_substrate(libero_max_settings: Settings) -> Iterator[Substrate]:
    """What builds the worlds; every scene is built once a worker."""
    from pytest_libero_max.sources import open_substrate

    substrate = open_substrate(libero_max_settings.substrate, libero_max_settings.substrate_options)
    yield substrate
    substrate.close()


@pytest.fixture
def libero_max_world(libero_max_case: Case, libero_max_substrate: Substrate) -> World:
    """The world of the case, as the last episode left it: reset it, or play a prefix."""
    return libero_max_substrate.world(libero_max_case)


@pytest.fixture
def libero_max_prefix(
    libero_max_case: Case, libero_max_world: World, libero_max_policy: Policy, libero_max_settings: Settings
) -> BranchPoint:
    """The executed prefix: Base played up to the trigger, where the world now stands.

    The test is skipped where the policy never comes near the trigger entity.
    """
    from pytest_libero_max.pairing.runner import play_prefix

    branch = play_prefix(libero_max_case, libero_max_world, libero_max_policy)
    if branch is None:
        pytest.skip(f"{libero_max_case.item_id}: the trigger region is never reached")
    return branch


@pytest.fixture
def libero_max_inject(libero_max_case: Case, libero_max_world: World) -> Callable[[], Json]:
    """Call it to let the case's event happen to the world; returns the evidence."""
    from pytest_libero_max.pairing.runner import inject

    return lambda: inject(libero_max_case, libero_max_world)


@pytest.fixture
def libero_max_pair(request: pytest.FixtureRequest, libero_max_case: Case) -> PairRecord:
    """The measured pair of the case.

    An error of the machinery is an error of the item, recorded as such, and never a failure of the policy.
    """
    phase: list[str] = ["setup"]
    try:
        record = _play(request, libero_max_case, phase.append)
    except _Unsupported as unsupported:
        pytest.skip(str(unsupported))
    except BaseException as error:
        from pytest_libero_max.policies.check import ends_the_session

        if ends_the_session(error):
            raise
        request.node.stash[RESULT] = PairError.of(libero_max_case, error, phase[-1]).to_dict()
        if phase[-1] == POLICY_PHASE:
            # It would be the same with every other pair: what is not begun stays missing.
            request.session.shouldfail = "the policy cannot be played"
        if isinstance(error, LiberoMaxError):
            pytest.fail(_explain(error), pytrace=False)
        if not isinstance(error, Exception):
            # pytest keeps no fixture that ends like this, and every later item would fail for another reason.
            raise LiberoMaxError(f"{type(error).__name__} in phase {phase[-1]!r}: {error}") from error
        raise
    request.node.stash[RESULT] = record.to_dict()
    request.node.user_properties.extend(properties(record))
    return record


class _Unsupported(Exception):
    """The policy declares that it does not support the suite of the case."""


def _play(request: pytest.FixtureRequest, case: Case, on_phase: Callable[[str], None]) -> PairRecord:
    from pytest_libero_max.events.schedules import arms_of
    from pytest_libero_max.pairing.runner import PairSettings, measure_pair
    from pytest_libero_max.policies.check import check_cameras
    from pytest_libero_max.policies.code import adapter_digest

    settings = settings_of(request.config)
    # Asked for here, not in the signature: what goes wrong in them belongs to the pair as well.
    on_phase(POLICY_PHASE)
    policy = request.getfixturevalue("libero_max_policy")
    if not policy.spec.supports(case.suite):
        suites = ", ".join(policy.spec.suites or ())
        raise _Unsupported(f"unsupported: policy {policy.spec.name!r} declares the suites {suites}")
    on_phase("setup")
    substrate = request.getfixturevalue("libero_max_substrate")
    world = request.getfixturevalue("libero_max_world")
    if ADAPTER_DIGEST not in request.config.stash:
        on_phase(POLICY_PHASE)
        check_cameras(policy, world)
        request.config.stash[ADAPTER_DIGEST] = adapter_digest(settings.reference, settings.profile)
        on_phase("setup")
    fingerprints = {**substrate.fingerprint(), "adapter": request.config.stash[ADAPTER_DIGEST]}
    _require_declared_spec(request.config, policy)
    pair = measure_pair(
        case,
        world,
        policy,
        PairSettings(prefix=settings.prefix, fingerprints=fingerprints),
        on_phase,
        arms_of(case, repeat_base=case.item_id in noise_cases_of(request.config)),
    )
    notes = _keep(pair, case, world, settings)
    if notes:
        request.node.stash[NOTE] = "; ".join(notes)
    return pair.record


def _keep(pair: Pair, case: Case, world: World, settings: Settings) -> list[str]:
    """Keep what the options ask for beside the record of a measured pair; returns what could not be kept."""
    from pytest_libero_max.pairing.trace import traces_of, write_trace

    notes = []
    if settings.traces == "all" or settings.traces == pair.record.outcome:
        try:
            write_trace(settings.output / TRACES_NAME, pair)
        except (OSError, ValueError) as error:
            notes.append(f"no trace of {case.item_id}: {error}")
    if settings.film != "none":
        from pytest_libero_max.films.recorded import film_pair, film_path, selected

        try:
            if selected(pair.record, settings.film):
                path = film_path(settings.output / FILMS_NAME, pair.record)
                film_pair(path, case, world, pair.record, traces_of(pair))
        except Exception as error:  # whatever a renderer or an encoder raises, the pair is measured
            notes.append(f"no film of {case.item_id}: {error}")
    return notes


def _require_declared_spec(config: pytest.Config, policy: Policy) -> None:
    """Check that the policy still declares what it declared before its first pair.

    Raises:
        AdapterError: Its spec has changed.
    """
    from pytest_libero_max.policies.check import require_spec

    known, spec = config.stash.get(DECLARED, (None, None))
    if known is not policy:
        spec = replace(policy.spec)
        config.stash[DECLARED] = (policy, spec)
    assert isinstance(spec, type(policy.spec))
    require_spec(policy, spec, "an earlier pair")


def _explain(error: LiberoMaxError) -> str:
    """The message, and where the user's own code raised, without the frames of this package."""
    text = f"{type(error).__name__}: {error}"
    cause = error.__cause__
    if cause is None or isinstance(cause, LiberoMaxError):
        return text
    return text + "\n\n" + "".join(traceback.format_exception(type(cause), cause, cause.__traceback__))
