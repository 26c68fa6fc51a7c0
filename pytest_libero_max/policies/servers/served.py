"""A policy behind a server: a profile, a protocol, and the contract of a policy around them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import AdapterError, ServerError, did_you_mean
from pytest_libero_max.policies.contract import Episode, PolicySpec, Query
from pytest_libero_max.policies.profile import Profile, load_profile, profile_names
from pytest_libero_max.policies.servers.address import Address, parse_address
from pytest_libero_max.policies.servers.link import Client, Link
from pytest_libero_max.policies.servers.reply import Reply
from pytest_libero_max.policies.servers.request import Request
from pytest_libero_max.worlds.contract import Observation

Actions = NDArray[np.float64]

Adapt = Callable[[Any, PolicySpec], tuple[Any, PolicySpec]]
"""From what a server says about itself, and the spec so far, to the layout of its requests and the spec."""


class ServedPolicy:
    """A policy behind a server, as the pair runner knows policies.

    Args:
        spec: What it declares.
        request: Makes requests.
        reply: Reads replies.
        connect: Makes the client; told whom to tell what the server says about itself.
        adapt: Makes the layout of the request and the spec, of what the server said; None: as they are.

    Attributes:
        greeting: What the server says about itself.
        client: The connection, which counts interruptions.
        batch_size: How many queries the server answered together with the last one; 1 where it does not say.
    """

    def __init__(
        self,
        spec: PolicySpec,
        request: Request,
        reply: Reply,
        connect: Callable[[Callable[[Any], None]], Client],
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
        self.client = connect(self._greeted)

    @property
    def waited_s(self) -> float:
        """How long the server was waited for after interruptions, s."""
        return self.client.waited_s

    def reset(self, episode: Episode) -> None:
        """Keep the episode for the requests; servers are asked query by query and have nothing to forget."""
        self._episode = episode

    def predict(self, observation: Observation, query: Query) -> Actions:
        """Ask the server.

        Raises:
            ServerError: It was given up.
        """
        return self.client.ask(self.request(observation, query), self.read)

    def request(self, observation: Observation, query: Query) -> dict[str, Any]:
        """What the server is sent.

        Raises:
            AdapterError: An input cannot be made.
        """
        return self._request.build(observation, query, self._episode, self._layout)

    def read(self, reply: Any) -> Actions:
        """The actions of a reply; notes in how large a batch they were computed.

        Raises:
            ServerError: There are none that can be played.
        """
        actions = self._reply.read(reply, self.spec.query_interval, self.spec.horizon)
        batch = reply.get("batch") if isinstance(reply, Mapping) else None
        self.batch_size = batch if isinstance(batch, int) else 1
        return actions

    def model_inputs(self, observation: Observation, query: Query) -> dict[str, NDArray[Any]]:
        """The arrays of the request, by the names that the profile gives them, for a look at them.

        Raises:
            AdapterError: An input cannot be made.
        """
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
            f"The server returns {size} actions (action_chunk_size), but "
            f"query_interval={spec.query_interval} "
            "are executed before the next query. Lower --libero-max-query-interval."
        )


def load_served(
    text: str, profile_text: str | None, horizon: int | None = None, query_interval: int | None = None
) -> ServedPolicy:
    """The policy at an address, connected.

    Args:
        text: The address.
        profile_text: Name or path of the profile.
        horizon: Replaces H of the profile.
        query_interval: Replaces Q of the profile.

    Raises:
        AdapterError: The address or the profile cannot be used.
        ServerError: The server was given up.
    """
    address, profile = parse_address(text), require_profile(text, profile_text)
    given = {"policy.horizon": horizon, "policy.query_interval": query_interval}
    profile.require_known(tuple(name for name, value in given.items() if value is not None))
    request, reply = Request(profile), Reply(profile)
    spec = PolicySpec(
        name=profile.get("policy", "name"),
        horizon=profile.get("policy", "horizon", query_interval or 1) if horizon is None else horizon,
        query_interval=profile.get("policy", "query_interval", 1)
        if query_interval is None
        else query_interval,
        cameras=request.cameras,
        image_size=profile.get("policy", "image_size", 256),
        repeatable=profile.get("policy", "repeatable", False),
        suites=profile.get("policy", "suites"),
        control=profile.get("actions", "control", "delta"),
        revision=profile.get("policy", "revision") or f"profile {profile.name} {profile.digest[:12]}",
    )
    link, adapt = _link(address, profile, spec, request)
    kinds = [ServedPolicy]
    if address.protocol == "vla-eval":
        from pytest_libero_max.policies.servers.vla_eval import OneByOnePolicy

        kinds = [OneByOnePolicy]
    elif address.protocol == "openpi":
        from pytest_libero_max.policies.servers.declared import (
            DeclaredPolicy,
            RememberingPolicy,
            SeeingPolicy,
            as_declared,
            as_prepared,
        )

        by_server = profile.get("policy", "declared_by_server", False)
        adapt = as_declared(profile, request, horizon, query_interval) if by_server else as_prepared
        kinds = [DeclaredPolicy, RememberingPolicy, SeeingPolicy]

    def connected(kind: type[ServedPolicy]) -> ServedPolicy:
        policy = kind(
            spec,
            request,
            reply,
            lambda told: Client(f"policy server {address}", link, address.patience_s, told),
            adapt,
        )
        policy.client.connect()
        return policy

    policy = connected(kinds[0])
    if len(kinds) > 1 and policy.greeting.get("memory") is True:
        policy.client.close()
        policy = connected(kinds[2] if policy.greeting.get("sees") is True else kinds[1])
    if profile.get("policy", "every_step", False) and not hasattr(policy, "see"):
        policy.client.close()
        raise AdapterError(
            f"Profile {profile.name!r} is for a policy that sees every step, but the server at {address} is "
            "shown queries alone. Serve an adapter with see(observation, step), snapshot() and "
            "restore(memory) by `libero-max serve`."
        )
    return policy


def require_profile(text: str, profile_text: str | None) -> Profile:
    """The profile for an address.

    Raises:
        AdapterError: None is named, there is none of that name, or it is for another protocol.
    """
    address = parse_address(text)
    if profile_text is None:
        raise AdapterError(
            f"policy={text!r} is the address of a server, and how it is asked depends on the policy behind "
            f"it. Add --libero-max-profile=NAME; for {address.scheme}:// there are {_fitting(address)}, or "
            "the path of your own."
        )
    profile = load_profile(profile_text)
    if profile.protocol != address.protocol:
        raise AdapterError(
            f"profile={profile_text!r} is for {profile.protocol}://, but the address is {str(address)!r}. "
            f"For {address.scheme}:// there are {_fitting(address)}."
        )
    return profile


def _fitting(address: Address) -> str:
    """The profiles of this package for an address, for messages."""
    return ", ".join(name for name in profile_names() if load_profile(name).protocol == address.protocol)


def _link(
    address: Address, profile: Profile, spec: PolicySpec, request: Request
) -> tuple[Link, Adapt | None]:
    """The connection in the protocol of the address, and what the server's greeting changes."""
    match address.protocol:
        case "openpi":
            from pytest_libero_max.policies.servers.openpi import OpenpiLink

            return OpenpiLink(address), None
        case "starvla":
            from pytest_libero_max.policies.servers.starvla import StarvlaLink

            return StarvlaLink(address), None
        case "vla-eval":
            from pytest_libero_max.policies.servers.vla_eval import VlaEvalLink, returns_poses, wanted

            def adapt(greeting: Any, spec: PolicySpec) -> tuple[Any, PolicySpec]:
                layout = wanted(profile.tables.get("request", {}), greeting)
                spec = replace(spec, cameras=request.cameras_of(layout))
                return layout, replace(spec, control="absolute") if returns_poses(greeting) else spec

            return VlaEvalLink(address), adapt
        case "http":
            from pytest_libero_max.policies.servers.http_act import CODECS, HttpLink

            codec = _one_of(profile, "codec", CODECS)
            return HttpLink(address, profile.get("policy", "path", "/act"), codec), None
        case _:
            from pytest_libero_max.policies.servers.gr00t import DIALECTS, Gr00tLink

            return Gr00tLink(address, _one_of(profile, "dialect", DIALECTS)), None


def _one_of(profile: Profile, field: str, known: Mapping[str, Any]) -> str:
    value = profile.get("policy", field)
    if value not in known:
        raise AdapterError(
            f"profile {profile.name!r}: policy.{field}={value!r}. {did_you_mean(str(value), known)}"
        )
    return str(value)
