"""A policy behind a server as the pair runner needs it: requests, replies, and the server's declarations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from numpy.typing import NDArray

from pytest_libero_max.errors import AdapterError, ServerError, counted
from pytest_libero_max.policies.check import Actions
from pytest_libero_max.policies.clients.reply import Reply
from pytest_libero_max.policies.clients.request import Request
from pytest_libero_max.policies.clients.transport import Client
from pytest_libero_max.policies.contract import Episode, PolicySpec, Query
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
