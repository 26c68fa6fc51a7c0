"""What both rollouts of a pair have in common: how an episode begins and how a policy is asked."""

from __future__ import annotations

from pytest_libero_max.benchmark.cases import SETTLE_STEPS, Case
from pytest_libero_max.changes.registry import change_from_dict
from pytest_libero_max.errors import AdapterError
from pytest_libero_max.pairing.clock import Clock
from pytest_libero_max.policies.check import Actions, ask, start
from pytest_libero_max.policies.contract import Episode, Policy, Query, query_seed
from pytest_libero_max.worlds.contract import NOOP_ACTION, World


def instruction_of(case: Case, world: World) -> str:
    """What the policy is told to do: the manifest's prompt, or the task's where it fixes none."""
    return world.language if case.instruction is None else case.instruction


def begin_world(case: Case, world: World, clock: Clock) -> None:
    """Reset to the case's initial state, apply the setup both arms share, settle for ten no-op steps.

    Raises:
        SubstrateError: The scene has no such initial state.
        ChangeError: The setup does not fit this world.
        SimulatorError: The scene does not settle.
    """
    with clock("reset_s"):
        world.reset(case.init_state_index)
        for change in case.event.setup:
            change_from_dict(change).apply(world)
        for _ in range(SETTLE_STEPS):
            world.step(NOOP_ACTION)


def begin_policy(case: Case, world: World, policy: Policy, clock: Clock) -> None:
    """Tell the policy that an episode begins; a privileged one gets the live world.

    Raises:
        AdapterError: It raised, or altered the world.
    """
    privileged = policy.spec.privileged
    episode = Episode(
        suite=case.suite,
        task_index=case.task_index,
        instruction=instruction_of(case, world),
        seed=case.policy_seed,
        max_steps=case.budget,
        world=world if privileged else None,
    )
    before = world.digest() if privileged else b""
    with clock("policy_s"):
        start(policy, episode)
    if privileged and world.digest() != before:
        raise _altered(policy, "reset")


def make_query(case: Case, world: World, index: int, step: int) -> Query:
    """Query ``index`` of the episode, after ``step`` executed policy steps."""
    return Query(index, step, instruction_of(case, world), query_seed(case.policy_seed, index))


def ask_policy(world: World, policy: Policy, query: Query, clock: Clock) -> Actions:
    """Show the policy the world as it is now and return its checked actions, (n, 7).

    This is the only place where the pair runner looks at the world for a policy, so images are rendered for
    queries alone, and only those of the cameras and the size the policy declares.

    Raises:
        ActionError: The actions cannot be played.
        AdapterError: The policy raised, or altered the world, which is read only for it.
        SimulatorError: The renderer does not answer.
    """
    spec = policy.spec
    with clock("observe_s"):
        observation = world.observe(spec.cameras, spec.image_size)
    before = world.digest() if spec.privileged else b""
    with clock("policy_s"):
        actions = ask(policy, observation, query)
    if spec.privileged and world.digest() != before:
        raise _altered(policy, f"predict, query {query.index} at step {query.step}")
    return actions


def _altered(policy: Policy, where: str) -> AdapterError:
    return AdapterError(
        f"policy {policy.spec.name!r} altered the world in {where}, but episode.world is read only: a policy "
        "acts through the actions it returns. Plan on a copy of the model and data instead."
    )
