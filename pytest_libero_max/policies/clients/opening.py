"""Opens a policy behind a server: its address, its profile, and the protocol between them."""

from __future__ import annotations

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.policies.clients.address import Address, parse_address
from pytest_libero_max.policies.clients.protocols import PROTOCOLS, Opening
from pytest_libero_max.policies.clients.reply import Reply
from pytest_libero_max.policies.clients.request import Request
from pytest_libero_max.policies.clients.served import ServedPolicy
from pytest_libero_max.policies.clients.transport import Client
from pytest_libero_max.policies.contract import PolicySpec
from pytest_libero_max.policies.profile import Profile, load_profile, profile_names


def load_served(
    text: str, profile_text: str | None, horizon: int | None = None, query_interval: int | None = None
) -> ServedPolicy:
    """Return the policy at an address, connected.

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
    protocol = PROTOCOLS[address.scheme]
    opening = Opening(address, profile, spec, request, horizon, query_interval)
    link, adapt = protocol.link(opening), protocol.adapt(opening)

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
    return policy


def require_profile(text: str, profile_text: str | None) -> Profile:
    """Return the profile for an address.

    Raises:
        AdapterError: None is named, there is none of that name, or it is for another protocol.
    """
    address = parse_address(text)
    if profile_text is None:
        raise AdapterError.seen(
            "policy",
            text,
            f" is the address of a server, and how it is asked depends on the policy behind "
            f"it. Add --libero-max-profile=NAME; for {address.scheme}:// there are {_fitting(address)}, or "
            "the path of your own.",
        )
    profile = load_profile(profile_text)
    if profile.protocol != address.protocol:
        raise AdapterError.seen(
            "profile",
            profile_text,
            f" is for {profile.protocol}://, but the address is {str(address)!r}. "
            f"For {address.scheme}:// there are {_fitting(address)}.",
        )
    return profile


def _fitting(address: Address) -> str:
    """Return the profiles of this package for an address, for messages."""
    return ", ".join(name for name in profile_names() if load_profile(name).protocol == address.protocol)
