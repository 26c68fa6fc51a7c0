"""A policy behind a server as the pair runner needs it; its server may declare it and keep its memory."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any
from weakref import WeakSet

from numpy.typing import NDArray

from pytest_libero_max.errors import AdapterError, ServerError, counted
from pytest_libero_max.policies.check import Actions
from pytest_libero_max.policies.clients.messages import Reply, Request
from pytest_libero_max.policies.clients.transport import Client, Refused
from pytest_libero_max.policies.contract import Episode, PolicySpec, Query, published_seed
from pytest_libero_max.policies.profile import Profile
from pytest_libero_max.worlds.contract import Observation

Adapt = Callable[[Any, PolicySpec], tuple[Any, PolicySpec]]
"""Function from a server's greeting and the spec so far to the layout of its requests and the spec."""


class ServedPolicy:
    """A policy behind a server, as the pair runner knows policies.

    Args:
        client: Of the server; it hands its greeting on.
        adapt: Makes the layout of the request and the spec from the greeting; None leaves them unchanged.

    Attributes:
        greeting: The server's description of itself.
        client: The connection, which counts interruptions.
        batch_size: Number of queries in the last answered batch; 1 where the server does not say.
        returned: Number of actions in the last reply, before they were cut to H; None where it is not known.
    """

    server: str | None = None
    returned: int | None = None

    def __init__(
        self,
        spec: PolicySpec,
        request: Request,
        reply: Reply,
        client: Client,
        adapt: Adapt | None = None,
    ) -> None:
        self.spec = spec
        self.greeting: Any = None
        self._profiled = spec
        self._adapted: tuple[Any, PolicySpec] | None = None
        self.batch_size = 1
        self._request = request
        self._reply = reply
        self._adapt = adapt
        self._layout: Any = None
        self._episode = Episode("", 0, "", 0, 1)
        self.client = client
        client.on_open = self._greeted

    @property
    def waited_s(self) -> float:
        """Time spent waiting for the server after interruptions, s."""
        return self.client.waited_s

    def reset(self, episode: Episode) -> None:
        """Keep the episode for the requests; the server keeps nothing to reset."""
        self._episode = episode

    def predict(self, observation: Observation, query: Query) -> Actions:
        """Ask the server."""
        return self.client.ask(self.request(observation, query), self.read)

    def request(self, observation: Observation, query: Query) -> dict[str, Any]:
        """Return the request."""
        return self._request.build(observation, query, self._episode, self._layout)

    def read(self, reply: Any) -> Actions:
        """Return the actions of a reply; notes the size of the batch in which they were computed."""
        actions = self._reply.read(reply, self.spec.query_interval, self.spec.horizon)
        self.returned = self._reply.returned
        batch = reply.get("batch") if isinstance(reply, Mapping) else None
        self.batch_size = batch if isinstance(batch, int) else 1
        return actions

    def model_inputs(self, observation: Observation, query: Query) -> dict[str, NDArray[Any]]:
        """Return the arrays of the request by the profile's names, for inspection."""
        return self._request.arrays(observation, self._layout)

    def _greeted(self, greeting: Any) -> None:
        _require_chunk(greeting, self.spec)
        if self._adapt is not None:
            # From the profile's spec, also later: the policy's own may be at another cadence by then.
            adapted = self._adapt(greeting, self._profiled)
            if self._adapted is None:
                self._adapted = adapted
                self._layout, self.spec = adapted
            elif adapted != self._adapted:
                raise ServerError(
                    "the server declares or wants something else than before; is it the same one?"
                )
        self.greeting = {} if greeting is None else greeting


def _require_chunk(greeting: Any, spec: PolicySpec) -> None:
    """Refuse a Q beyond the chunk that a server says it returns."""
    size = greeting.get("action_chunk_size") if isinstance(greeting, Mapping) else None
    if isinstance(size, int) and size < spec.query_interval:
        raise AdapterError(
            f"The server returns {counted(size, 'action')} (action_chunk_size), but "
            f"query_interval={spec.query_interval} "
            "are executed before the next query. Lower --libero-max-query-interval."
        )


NOISE_SEED, TAKES_NOISE_SEED = "libero_max_noise_seed", "libero_max_deterministic_noise"
"""Fields of LIBERO-MAX's authors: seed in a request, and a server's promise to draw from it alone."""


_SERVED_REQUEST = ("prompt", "observation", "query", "episode")
"""Parts of a request to `libero-max serve`."""


def declared_spec(greeting: Any) -> PolicySpec:
    """Return the spec that a server's greeting declares."""
    values = greeting.get("spec") if isinstance(greeting, Mapping) else None
    names = {item.name for item in fields(PolicySpec)}
    if not isinstance(values, dict) or not {"name", "horizon", "query_interval"} <= values.keys() <= names:
        raise Refused(
            "the greeting declares no spec: this is no server of `libero-max serve`. Name the profile of the "
            "policy (`libero-max list profiles` lists them)"
        )
    try:
        return PolicySpec(**values)
    except (AdapterError, TypeError, ValueError) as error:
        raise ServerError(f"the greeting declares a spec that cannot be used: {error}") from error


def as_declared(profile: Profile, request: Request, horizon: int | None, query_interval: int | None) -> Adapt:
    """Return a function that takes the spec from the server, and sends the images that it asks for."""
    layout = profile.tables.get("request")
    if not isinstance(layout, Mapping) or not isinstance(layout.get("observation"), Mapping):
        raise AdapterError("The profile lacks a [request] whose 'observation' is a table.")

    def adapt(greeting: Any, spec: PolicySpec) -> tuple[Any, PolicySpec]:
        declared = declared_spec(greeting)
        declared = replace(
            declared,
            horizon=declared.horizon if horizon is None else horizon,
            query_interval=declared.query_interval if query_interval is None else query_interval,
        )
        unseen = {f"{camera}_image" for camera in request.cameras if camera not in declared.cameras}
        seen = {key: value for key, value in layout["observation"].items() if key not in unseen}
        return {**layout, "observation": seen}, declared

    return adapt


def as_prepared(profile: Profile) -> Adapt:
    """Return a function that adds what `libero-max serve` declares to a profile that prepares observations.

    A server that takes the noise seeds of LIBERO-MAX's authors and says so answers alike when it is asked
    again. H, Q and images are the profile's. Only the adapter knows the revision, the suites, the control and
    whether answers repeat. Other servers declare none of it.
    """

    def adapt(greeting: Any, spec: PolicySpec) -> tuple[Any, PolicySpec]:
        if greeting.get(TAKES_NOISE_SEED) is True:
            spec = replace(spec, repeatable=True)
        if "libero_max" not in greeting:
            return None, spec
        lacking = [name for name in _SERVED_REQUEST if name not in profile.tables.get("request", {})]
        if lacking:
            raise AdapterError(
                f"`libero-max serve` answers there, and the request of profile {profile.name!r} lacks "
                f"{', '.join(lacking)}. Ask it with --libero-max-profile=served."
            )
        declared = declared_spec(greeting)
        return None, replace(
            spec,
            revision=f"{declared.revision}, {spec.revision}",
            suites=spec.suites if declared.suites is None else declared.suites,
            repeatable=spec.repeatable and declared.repeatable,
            control=spec.control if declared.control == "delta" else declared.control,
        )

    return adapt


@dataclass(frozen=True, slots=True, weakref_slot=True, eq=False)
class Kept:
    """A memory that a server keeps for as long as this object lives."""

    name: str | None
    """The server's name for it; None for that of a new episode."""
    frames: tuple[dict[str, Any], ...] = ()
    """Steps shown since to a policy that sees every step, which the server does not know yet."""


class DeclaredPolicy(ServedPolicy):
    """A policy whose server may take the cadence that is played, or the seed of its noise, and says so."""

    def request(self, observation: Observation, query: Query) -> dict[str, Any]:
        request = super().request(observation, query)
        if self.greeting.get("cadence") is True:
            request["cadence"] = [self.spec.horizon, self.spec.query_interval]
        if self.greeting.get(TAKES_NOISE_SEED) is True:
            request[NOISE_SEED] = published_seed(self._episode.seed, query)
        return request


class RememberingPolicy(DeclaredPolicy):
    """A policy behind a server that keeps its memory.

    Each request names the memory that it begins with, and those that may still be restored; the reply names
    the one after it. So a query can be asked again after an interruption, like any other. It raises a
    ``ServerError`` where the server was started again and has no memories.
    """

    _at: str | None = None
    """The server's name for the memory that the next request begins with; None for that of a new episode."""

    _frames: tuple[dict[str, Any], ...] = ()
    """Steps that the policy was shown since, which the next request holds."""

    @cached_property
    def _name(self) -> str:
        return secrets.token_hex(8)

    @cached_property
    def _kept(self) -> WeakSet[Kept]:
        return WeakSet()

    def reset(self, episode: Episode) -> None:
        super().reset(episode)
        self._at, self._frames = None, ()

    def predict(self, observation: Observation, query: Query) -> Actions:
        keep = sorted({kept.name for kept in self._kept if kept.name is not None})
        request = self.request(observation, query)
        request["memory"] = {"client": self._name, "at": self._at, "keep": keep}
        if self._frames:  # without the query's own, which is in it
            request["frames"] = [frame for frame in self._frames if frame["step"] < query.step]

        def read(reply: Any) -> tuple[Actions, str]:
            actions, name = self.read(reply), reply.get("memory")
            if not isinstance(name, str):
                raise ServerError("the reply names no memory, although the server's greeting promises one")
            return actions, name

        actions, self._at = self.client.ask(request, read)
        self._frames = ()
        return actions

    def snapshot(self) -> object:
        """Return a name of the memory, which the server keeps as long as the caller keeps this."""
        kept = Kept(self._at, self._frames)
        self._kept.add(kept)
        return kept

    def restore(self, memory: object) -> None:
        """Go back to a memory."""
        if not isinstance(memory, Kept):
            raise AdapterError.seen("memory", memory, ", but must be what snapshot() returned.")
        self._at, self._frames = memory.name, memory.frames


class SeeingPolicy(RememberingPolicy):
    """A policy behind a server that is shown every step: each request holds the steps since the last one."""

    def see(self, observation: Observation, step: int) -> None:
        """Keep a step for the next request."""
        query = Query(0, step, self._episode.instruction, 0)
        shown = self.request(observation, query)["observation"]
        self._frames = (*self._frames, {"observation": shown, "step": step})
