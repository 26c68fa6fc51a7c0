"""The public fixtures: loading the policy, replaying the prefix, injecting the event, playing the pair.

They work in any test module; a test that asks for ``libero_max_case``, directly or through another
fixture, gets one item for each case of the track.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from typing import TYPE_CHECKING

import pytest

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.evaluation.policy_source import PolicySource
from pytest_libero_max.evaluation.settings import Settings
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.plugin.collection import settings_of
from pytest_libero_max.plugin.options import POLICY_FLAG
from pytest_libero_max.plugin.processes.isolation import play_isolated
from pytest_libero_max.plugin.run_pair import play_here
from pytest_libero_max.plugin.stash_keys import LOADED, RESULT, RUN_BEGUN, RUN_BEGUN_INPUT
from pytest_libero_max.report.writers.junit import properties

if TYPE_CHECKING:
    from pytest_libero_max.pairing.prefix import BranchPoint
    from pytest_libero_max.policies.contract import Policy
    from pytest_libero_max.substrates.contract import Substrate
    from pytest_libero_max.worlds.contract import World


@pytest.fixture(scope="session")
def libero_max_settings(pytestconfig: pytest.Config) -> Settings:
    """Return the plugin's options as they resolved."""
    return settings_of(pytestconfig)


@pytest.fixture(scope="session")
def libero_max_policy(pytestconfig: pytest.Config, libero_max_settings: Settings) -> Policy:
    """Return the policy under test, loaded once a worker."""
    settings = libero_max_settings
    if settings.policy is None:
        pytest.fail(
            f"This test needs a policy: give {POLICY_FLAG}=adapter.py, or set libero_max_policy in the ini "
            "file.",
            pytrace=False,
        )
    seat, begun_s = _seat(pytestconfig, settings), _run_begun_s(pytestconfig)
    policy = pytestconfig.stash[LOADED] = PolicySource(settings).load(seat, begun_s)
    return policy


def _run_begun_s(config: pytest.Config) -> float | None:
    """Return when the run began; None for a session that plays no run."""
    on_worker: dict[str, float] = getattr(config, "workerinput", {})
    return on_worker.get(RUN_BEGUN_INPUT, config.stash.get(RUN_BEGUN, None))


def _seat(config: pytest.Config, settings: Settings) -> int:
    """Return the number of this process among those that play, also of other shards."""
    name = str(getattr(config, "workerinput", {}).get("workerid", ""))
    number = "".join(letter for letter in name if letter.isdigit())
    return (int(number) if number else 0) + (0 if settings.shard is None else settings.shard[0] - 1)


@pytest.fixture(scope="session")
def libero_max_substrate(libero_max_settings: Settings) -> Iterator[Substrate]:
    """Yield the substrate, which builds the worlds; every scene is built once a worker."""
    from pytest_libero_max.substrates.registry import open_substrate

    settings = libero_max_settings
    with closing(open_substrate(settings.substrate.name, settings.substrate_options)) as substrate:
        yield substrate


@pytest.fixture
def libero_max_world(libero_max_case: Case, libero_max_substrate: Substrate) -> World:
    """Return the world of the case, as the last episode left it: reset it, or play a prefix."""
    return libero_max_substrate.world(libero_max_case)


@pytest.fixture
def libero_max_prefix(
    libero_max_case: Case, libero_max_world: World, libero_max_policy: Policy, libero_max_settings: Settings
) -> BranchPoint:
    """Return the executed prefix: Base played up to the trigger, where the world now stands.

    The test is skipped where the policy never comes near the trigger entity.
    """
    from pytest_libero_max.pairing.runner import play_prefix

    latency = libero_max_settings.latency
    branch = play_prefix(libero_max_case, libero_max_world, libero_max_policy, latency)
    if branch is None:
        pytest.skip(f"{libero_max_case.item_id}: the trigger region is never reached")
    return branch


@pytest.fixture
def libero_max_inject(
    libero_max_case: Case, libero_max_world: World, libero_max_settings: Settings
) -> Callable[[], Json]:
    """Return a function that lets the case's event happen to the world and returns the evidence."""
    from pytest_libero_max.pairing.runner import inject

    return lambda: inject(libero_max_case, libero_max_world, strength=libero_max_settings.strength)


@pytest.fixture
def libero_max_pair(
    request: pytest.FixtureRequest, libero_max_case: Case, libero_max_settings: Settings
) -> PairRecord:
    """Return the measured pair of the case.

    An error of the machinery is an error of the item, recorded as such, and never a failure of the policy.
    """
    play = play_isolated if libero_max_settings.isolate else play_here
    record = play(request, libero_max_case, libero_max_settings)
    request.node.stash[RESULT] = record.to_dict()
    request.node.user_properties.extend(properties(record))
    return record
