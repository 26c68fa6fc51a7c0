"""Opens a policy behind a server: its address, its profile, and the protocol between them."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from urllib.parse import SplitResult, parse_qsl, urlsplit

from pytest_libero_max.errors import AdapterError, did_you_mean
from pytest_libero_max.policies.clients.address import PATIENCE_S, TIMEOUT_S, TLS, Address
from pytest_libero_max.policies.clients.messages import Reply, Request
from pytest_libero_max.policies.clients.protocol import PROTOCOLS, Opening
from pytest_libero_max.policies.clients.recognition import recognise
from pytest_libero_max.policies.clients.served import ServedPolicy
from pytest_libero_max.policies.clients.transport import Client
from pytest_libero_max.policies.contract import PolicySpec
from pytest_libero_max.policies.profile import (
    PROFILE_ALONE,
    Profile,
    declares_weights,
    load_profile,
    profile_names,
)
from pytest_libero_max.policies.references import refusal

_REFUSED = MappingProxyType(
    {
        "tcp": "is raw TCP, which the server of Xiaomi-Robotics-0 speaks with pickles",
        "pickle": "asks for pickles",
        "xiaomi": "is raw TCP with pickles",
        "grpc": "is LeRobot's gRPC service, whose messages are pickles",
    }
)


def load_served(
    text: str, profile_text: str | None, horizon: int | None = None, query_interval: int | None = None
) -> ServedPolicy:
    """Return the policy at an address, connected."""
    return open_server(parse_address(text), require_profile(text, profile_text), horizon, query_interval)


def open_server(
    address: Address,
    profile: Profile,
    horizon: int | None = None,
    query_interval: int | None = None,
    revision: str | None = None,
) -> ServedPolicy:
    """Return the policy at an address, connected.

    Args:
        revision: Identity of the weights, as the user declares it; follows that of the server, if it has one.
    """
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
        suites=profile.suites,
        robot=profile.robot.name,
        control=profile.get("actions", "control", "delta"),
        revision=profile.get("policy", "revision") or f"{PROFILE_ALONE} {profile.name} {profile.digest[:12]}",
    )
    protocol = PROTOCOLS[address.protocol]
    opening = Opening(address, profile, spec, request, horizon, query_interval)
    link, adapt = protocol.link(opening), protocol.adapt(opening)

    def connected(kind: type[ServedPolicy]) -> ServedPolicy:
        client = Client(f"policy server {address}", link, address.patience_s, timeout_s=address.timeout_s)
        if protocol.recognised:
            client.recognise = partial(recognise, address, _protocol(address))
        policy = kind(spec, request, reply, client, adapt)
        client.connect()
        return policy

    first = protocol.policy({})
    policy = connected(first)
    kind = protocol.policy(policy.greeting)
    if kind is not first:
        policy.client.close()
        policy = connected(kind)
    if profile.get("policy", "every_step", False) and not hasattr(policy, "see"):
        policy.client.close()
        raise AdapterError(
            f"Profile {profile.name!r} is for a policy that sees every step, but the server at {address} is "
            "shown queries alone. Serve an adapter with see(observation, step), snapshot() and "
            "restore(memory) by `libero-max serve`."
        )
    policy.server = str(address)
    if revision is not None:
        known = policy.spec.revision
        undeclared = known is None or not declares_weights(known)
        policy.spec = replace(policy.spec, revision=revision if undeclared else f"{known}, {revision}")
    return policy


def require_profile(text: str, profile_text: str | None) -> Profile:
    """Return the profile for an address."""
    address = parse_address(text)
    if profile_text is None:
        raise refusal(
            text,
            f" is the address of a server, and how it is asked depends on the policy behind "
            f"it. Add --libero-max-profile=NAME; for {address.scheme}:// there are {_fitting(address)}, or "
            "the path of your own.",
        )
    profile = load_profile(profile_text)
    if profile.protocol != _protocol(address):
        raise AdapterError.seen(
            "profile",
            profile_text,
            f" is for {profile.protocol}://, but the address is {str(address)!r}. "
            f"For {address.scheme}:// there are {_fitting(address)}.",
        )
    return profile


def _fitting(address: Address) -> str:
    """Return the profiles of this package for an address, for messages."""
    return ", ".join(name for name in profile_names() if load_profile(name).protocol == _protocol(address))


def _protocol(address: Address) -> str:
    """Return the name of an address's protocol in profiles: for ``https`` it is ``http``."""
    return PROTOCOLS[address.protocol].profiles or address.protocol


def parse_address(text: str) -> Address:
    """Read the address of a policy server, ``SCHEME://HOST:PORT/PATH?timeout=SECONDS&patience=SECONDS``."""
    scheme = text.partition("://")[0].lower()
    if scheme in _REFUSED and scheme not in PROTOCOLS:
        raise refusal(
            text,
            f" {_REFUSED[scheme]}. Whoever answers with a pickle can run any code here, so "
            "none is ever read. Put the model behind one of the protocols that are spoken "
            f"({', '.join(PROTOCOLS)}): a server is a few lines around it.",
        )
    if scheme in ("ws", "wss"):
        raise refusal(
            text,
            " names a WebSocket, but not what is spoken over it. Write openpi://, vla-eval:// or starvla:// "
            f"instead, with TLS openpi{TLS}:// and so on.",
        )
    protocol = scheme.removesuffix(TLS)
    if protocol not in PROTOCOLS:
        raise refusal(text, f": {scheme!r} is no protocol that is spoken. {did_you_mean(scheme, PROTOCOLS)}")
    usual_port = PROTOCOLS[protocol].port
    if scheme != protocol:
        usual_port = _secure_port(text, protocol)
    try:
        parts = urlsplit(text)
        port = parts.port
    except ValueError as error:
        raise refusal(text, f" is no address: {error}. Write {scheme}://HOST:PORT.") from None
    if not parts.hostname or parts.username or parts.fragment:
        raise refusal(text, f": an address is {scheme}://HOST:PORT, without a user name or a fragment.")
    seconds = _seconds(text, parts)
    return Address(
        text,
        scheme,
        parts.hostname,
        usual_port if port is None else port,
        parts.path.rstrip("/"),
        seconds.get("timeout", TIMEOUT_S),
        seconds.get("patience", PATIENCE_S),
    )


def _secure_port(text: str, protocol: str) -> int:
    """Return the port of a protocol with TLS."""
    port = PROTOCOLS[protocol].secure_port
    if port is not None:
        return port
    usual = PROTOCOLS[protocol].port
    if f"{protocol}s" in PROTOCOLS:
        raise refusal(text, f": with TLS, {protocol}:// is {protocol}s://. Write that.")
    raise refusal(
        text,
        f": {protocol}:// has no form with TLS, because its servers have none. Reach the server through a "
        f"tunnel, for example `ssh -N -L {usual}:127.0.0.1:{usual} HOST`, and write "
        f"{protocol}://127.0.0.1:{usual}.",
    )


def _seconds(text: str, parts: SplitResult) -> dict[str, float]:
    limits: dict[str, float] = {}
    for name, value in parse_qsl(parts.query, keep_blank_values=True):
        if name not in ("timeout", "patience"):
            raise refusal(text, f": {name!r} is no option. {did_you_mean(name, ('timeout', 'patience'))}")
        try:
            limits[name] = float(value)
        except ValueError:
            limits[name] = math.nan
        if not 0.0 < limits[name] < math.inf:
            raise refusal(text, f": {name}={value!r}, but must be a number of seconds above 0.")
    return limits
