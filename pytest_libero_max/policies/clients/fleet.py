"""A policy behind several servers, of which each process asks one at a time."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

from pytest_libero_max.benchmark.suites import SUITES
from pytest_libero_max.errors import AdapterError, ServerError, counted
from pytest_libero_max.policies.check import Actions, remembers, sees
from pytest_libero_max.policies.clients.address import LEFT_OUT, PATIENCE_S
from pytest_libero_max.policies.clients.opening import open_server, parse_address
from pytest_libero_max.policies.clients.served import ServedPolicy
from pytest_libero_max.policies.clients.servers import ServerGroup, Servers, joined_revisions
from pytest_libero_max.policies.clients.transport import LOG
from pytest_libero_max.policies.contract import Episode, PolicySpec, Query
from pytest_libero_max.worlds.contract import Observation

WITH_OTHERS_S = 10.0
"""Longest time, s, to wait for a server while others are left. The last one has the time of a single one."""

_EQUAL = ("horizon", "query_interval", "cameras", "image_size", "privileged", "control", "history")
"""Fields of the spec in which the groups of a run must agree."""


class OtherServer(ServerError):
    """The server with the policy's memory was left out: the pair has to be played again, with another one."""


class Pool:
    """Equal servers, of which one is asked until it is given up."""

    server: str
    policy: ServedPolicy
    declared: PolicySpec | None = None

    def __init__(
        self, group: ServerGroup, seat: int, override: tuple[int | None, int | None] = (None, None)
    ) -> None:
        self.group = group
        self.left_out: dict[str, str] = {}
        self.waited_s = 0.0
        self._override = override
        self._order = in_order_of(group.addresses, seat)
        self._all_failed = False
        self._open_next([])

    def answered(self) -> None:
        """Note that the server answers, so that it is waited for when it goes away."""
        self._all_failed = False

    def move_on(self, error: ServerError) -> str:
        """Leave the current server out and open another one; return a sentence about it.

        Raises:
            ServerError: None is left. All are tried again at the next query.
        """
        left = self.server
        self.waited_s += self.policy.client.waited_s
        self.policy.client.close()
        self._leave_out(left, error)
        self._open_next([error])
        return f"{self.left_out[left]} {self.server} answered instead."

    def _leave_out(self, address: str, error: ServerError) -> None:
        reason = str(error.__cause__ or error).rstrip(".")  # without what to do where no other is left
        self.left_out[address] = f"{LEFT_OUT} {address} was left out: {reason}."
        LOG.warning("%s", self.left_out[address])

    def _open_next(self, errors: list[ServerError]) -> None:
        rest = [address for address in self._order if address not in self.left_out]
        for address in rest:
            try:
                self.server, self.policy = address, self._open(address, last=address == rest[-1])
            except ServerError as error:
                errors.append(error)
                self._leave_out(address, error)
            else:
                return
        self.left_out.clear()
        self._all_failed = True
        if len(errors) == 1:
            raise errors[0]
        raise ServerError(
            f"none of {counted(len(self._order), 'server')} answers: {'; '.join(map(str, errors))}"
        )

    def _open(self, address: str, last: bool) -> ServedPolicy:
        known = parse_address(address)
        patience = known.patience_s
        if self._all_failed:
            patience = 0.0  # each is asked once until one answers again
        elif not last and patience == PATIENCE_S:
            patience = WITH_OTHERS_S
        policy = open_server(
            replace(known, patience_s=patience), self.group.profile, *self._override, self.group.revision
        )
        self.declared = self.declared or policy.spec
        different = [
            f"{name} {value!r} and {getattr(policy.spec, name)!r}"
            for name, value in vars(self.declared).items()
            if value != getattr(policy.spec, name)
        ]
        if different:
            policy.client.close()
            raise ServerError(f"it is not equal to the server before: {'; '.join(different)}")
        return policy


class ServerFleet:
    """A policy behind several servers, as the pair runner knows policies.

    Each process asks one server of a group until that is given up. Then another one is asked the same query,
    or, where the server kept the policy's memory, the pair is played again. Other members, such as
    the memory or the number of actions returned, are those of the policy behind the server that is asked.
    """

    def __init__(self, servers: Servers, pools: Sequence[Pool]) -> None:
        # Sentences about servers that were left out, in order; the caller may empty it.
        self.troubles = [text for pool in pools for text in pool.left_out.values()]
        self._servers = servers
        self._pools = pools
        self._pool = pools[0]
        self._marks: Collection[str] | None = None
        self._episode = Episode("", 0, "", 0, 1)
        self._spec = _common_spec(servers, [pool.declared for pool in pools if pool.declared])

    @property
    def spec(self) -> PolicySpec:
        return self._spec

    @spec.setter
    def spec(self, spec: PolicySpec) -> None:
        self._spec = spec
        for pool in self._pools:
            self._set_cadence(pool)

    def __getattr__(self, name: str) -> Any:
        if name == "_pool":  # copy and pickle ask before there is one; looking for it would never end
            raise AttributeError(name)
        member = getattr(self._pool.policy, name)
        if not callable(member):
            return member
        # A wrapper keeps the method: it has to reach the server that is asked by then.
        return lambda *arguments: getattr(self._pool.policy, name)(*arguments)

    @property
    def waited_s(self) -> float:
        """Time spent waiting for servers after interruptions, s."""
        return sum(pool.waited_s + pool.policy.client.waited_s for pool in self._pools)

    @property
    def server(self) -> str:
        """Address of the server that is asked."""
        return self._pool.server

    def begin_pair(self, marks: Collection[str]) -> None:
        """Choose the servers of a pair by its markers; without this the suite of each episode chooses."""
        self._marks = marks
        self._pool = self._pools[self._servers.group_of(marks)]

    def reset(self, episode: Episode) -> None:
        self._episode = episode
        marks = (episode.suite,) if self._marks is None else self._marks
        self._pool = self._pools[self._servers.group_of(marks)]
        self._pool.policy.reset(episode)

    def predict(self, observation: Observation, query: Query) -> Actions:
        """Ask the server."""
        while True:
            try:
                answer = self._pool.policy.predict(observation, query)
            except ServerError as error:
                kept = hasattr(self._pool.policy, "snapshot") or self.spec.history
                self.troubles.append(self._pool.move_on(error))
                self._set_cadence(self._pool)
                self._pool.policy.reset(self._episode)
                if kept:
                    raise OtherServer(
                        f"{self.troubles[-1]} It kept the memory of the policy, so the pair begins anew."
                    ) from error
            else:
                self._pool.answered()
                return answer

    def close(self) -> None:
        """Close every connection."""
        for pool in self._pools:
            pool.policy.client.close()

    def _set_cadence(self, pool: Pool) -> None:
        pool.policy.spec = replace(
            pool.policy.spec, horizon=self._spec.horizon, query_interval=self._spec.query_interval
        )


def open_fleet(
    servers: Servers, seat: int = 0, horizon: int | None = None, query_interval: int | None = None
) -> ServerFleet:
    """Return the policy behind some servers, connected to one of each group."""
    pools = [Pool(group, seat, (horizon, query_interval)) for group in servers.groups]
    if len({(remembers(pool.policy), sees(pool.policy)) for pool in pools}) > 1:
        raise AdapterError(
            "Some of the servers keep the policy's memory and others do not. Serve one policy."
        )
    return ServerFleet(servers, pools)


def in_order_of(addresses: Sequence[str], seat: int) -> tuple[str, ...]:
    """Return addresses in the order in which a process tries them.

    Neighbouring seats begin with different servers, and those that began with the same go on with different
    ones.
    """
    start, turn = seat % len(addresses), seat // len(addresses)
    first, *rest = (*addresses[start:], *addresses[:start])
    turn = turn % len(rest) if rest else 0
    return (first, *rest[turn:], *rest[:turn])


def _common_spec(servers: Servers, specs: Sequence[PolicySpec]) -> PolicySpec:
    """Return one spec for the groups of servers."""
    first = specs[0]
    if len(specs) == 1:
        group_alone = servers.groups[0]
        suites = _suites(servers, specs) if group_alone.marks else first.suites
        return replace(first, name=servers.name or first.name, suites=suites)
    for group, spec in zip(servers.groups, specs, strict=True):
        for name in _EQUAL:
            if getattr(spec, name) != getattr(first, name):
                raise AdapterError(
                    f"{name}={getattr(spec, name)!r} of the servers for "
                    f"{'+'.join(group.marks) or 'other pairs'}, but {getattr(first, name)!r} of those "
                    "before: all pairs of a run are played alike. Set H "
                    "and Q with --libero-max-horizon and --libero-max-query-interval, or play runs of their "
                    "own."
                )
    revisions = zip(
        (group.marks for group in servers.groups), (str(spec.revision) for spec in specs), strict=True
    )
    return replace(
        first,
        name=servers.name or first.name,
        repeatable=all(spec.repeatable for spec in specs),
        revision=joined_revisions(revisions),
        suites=_suites(servers, specs),
    )


def _suites(servers: Servers, specs: Sequence[PolicySpec]) -> tuple[str, ...] | None:
    """Return the suites that the servers play; None for all, or where other markers choose them."""
    if any(mark not in SUITES for group in servers.groups for mark in group.marks):
        return None
    named = {mark for group in servers.groups for mark in group.marks}
    suites: set[str] = set()
    for group, spec in zip(servers.groups, specs, strict=True):
        own = set(SUITES) if spec.suites is None else set(spec.suites)
        suites |= own & set(group.marks) if group.marks else own - named
    return None if suites == set(SUITES) else tuple(sorted(suites))
