"""Servers of a run as the user names them: one address, a list of equal servers, or a file that lists them.

The file is TOML with a table ``[[servers]]`` for each group of equal servers, which may be for some pairs
alone::

    name = "gr00t-n1.7"                       # of the policy, where the profiles of the groups have several
    [[servers]]
    for = ["libero_goal"]                     # suites, or other markers; without it: all other pairs
    addresses = ["gr00t://gpu-1:5555", "gr00t://gpu-2:5555"]
    profile = "gr00t_n17"                     # otherwise that of --libero-max-profile
    revision = "goal-20k 4f1c..."             # identity of the weights
"""

from __future__ import annotations

import hashlib
import json
import socket
import tomllib
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

from pytest_libero_max.benchmark.documents import read_text
from pytest_libero_max.benchmark.structs import Text, fits, rule, words
from pytest_libero_max.benchmark.suites import SUITES
from pytest_libero_max.errors import AdapterError, ServerError, did_you_mean
from pytest_libero_max.policies.clients.address import is_address
from pytest_libero_max.policies.clients.connection import look_up
from pytest_libero_max.policies.clients.opening import parse_address, require_profile
from pytest_libero_max.policies.profile import Profile, declares_weights
from pytest_libero_max.policies.references import refusal

_Listed = Annotated[list[Text], rule("a list of texts that are not empty", min_length=1)]
_FIELDS = MappingProxyType(
    {"address": Text, "addresses": _Listed, "for": _Listed, "profile": Text, "revision": Text}
)


@dataclass(frozen=True)
class ServerGroup:
    """Equal servers: the same policy with the same weights."""

    addresses: tuple[str, ...]
    profile: Profile
    profile_text: str
    """Name or path of the profile."""
    marks: tuple[str, ...] = ()
    """Markers of the pairs that they answer, for example suites; empty for all other pairs."""
    revision: str | None = None
    """Identity of the weights that the user declares."""

    @property
    def declared(self) -> str | None:
        """Identity of the weights that the user declares here or in the profile."""
        return self.revision or self.profile.get("policy", "revision")


@dataclass(frozen=True)
class Servers:
    """The servers of a run."""

    groups: tuple[ServerGroup, ...]
    """Groups of equal servers, in the order in which a pair looks for its own."""
    name: str | None = None

    @property
    def addresses(self) -> tuple[str, ...]:
        """All addresses, group by group."""
        return tuple(address for group in self.groups for address in group.addresses)

    @property
    def digest(self) -> str:
        """Identity of the way in which the servers are asked, without their addresses, hexadecimal.

        Groups of the same declared weights that are asked alike are one policy: which of them answers a pair
        is a matter of addresses.
        """
        policies = {(group.profile.digest, group.revision) for group in self.groups}
        if len(policies) > 1 or (len(self.groups) > 1 and self.revision is None):
            parts = [(group.marks, group.profile.digest, group.revision) for group in self.groups]
            return hashlib.sha256(json.dumps([self.name, *parts]).encode()).hexdigest()
        ((digest, revision),) = policies
        if revision is None:
            return digest
        return hashlib.sha256(json.dumps([None, ((), digest, revision)]).encode()).hexdigest()

    @property
    def revision(self) -> str | None:
        """Identity of the weights that the user declares; None where a group has none."""
        declared = [(group.marks, group.declared) for group in self.groups]
        if any(revision is None for _, revision in declared):
            return None
        return joined_revisions((marks, str(revision)) for marks, revision in declared)

    def group_of(self, marks: Collection[str]) -> int:
        """Return the number of the group, from 0, for a pair."""
        for number, group in enumerate(self.groups):
            if group.marks and not set(group.marks).isdisjoint(marks):
                return number
        for number, group in enumerate(self.groups):
            if not group.marks:
                return number
        known = sorted({mark for group in self.groups for mark in group.marks})
        raise AdapterError(
            f"No server is for the pair with the markers {', '.join(sorted(marks))}: the servers are for "
            f"{', '.join(known)}. Add one, or a [[servers]] without 'for', which answers all other pairs."
        )

    def resolved(self) -> Servers:
        """Return the servers with each host name of several IPv4 addresses as that many servers."""
        groups = [
            replace(
                group,
                addresses=tuple(dict.fromkeys(ip for text in group.addresses for ip in _resolved(text))),
            )
            for group in self.groups
        ]
        return replace(self, groups=tuple(groups))

    def to_list(self) -> list[dict[str, Any]]:
        """Return JSON types for the header of a run."""
        return [
            {
                "addresses": list(group.addresses),
                "profile": group.profile_text,
                **({"for": list(group.marks)} if group.marks else {}),
                **({"revision": group.revision} if group.revision else {}),
            }
            for group in self.groups
        ]


def joined_revisions(parts: Iterable[tuple[tuple[str, ...], str]]) -> str:
    """Return one text for the revisions of groups: the one that all declare, or ``marks: revision; ...``."""
    listed = list(parts)
    revisions = {revision for _, revision in listed}
    if len(listed) == 1 or (len(revisions) == 1 and all(map(declares_weights, revisions))):
        return listed[0][1]
    return "; ".join(f"{'+'.join(marks) or 'other'}: {revision}" for marks, revision in listed)


def read_servers(text: str, profile: str | None, revision: str | None = None) -> Servers:
    """Return the servers that a reference names. Nothing is connected to."""
    if is_address(text):
        return Servers((_group(text, [part.strip() for part in text.split(",")], profile, (), revision),))
    try:
        table = tomllib.loads(read_text(Path(text).expanduser()))
    except (OSError, ValueError, RecursionError) as error:
        raise refusal(text, f" cannot be read: {error}. Repair the file of servers.") from None
    return _from_table(text, table, profile, revision)


def _from_table(text: str, table: dict[str, Any], profile: str | None, revision: str | None) -> Servers:
    entries = table.get("servers")
    if not isinstance(entries, list) or not entries or not all(isinstance(entry, dict) for entry in entries):
        raise refusal(text, ": the file lacks [[servers]] tables, one for each group.")
    _check(text, table, {"name": Text, "servers": list[dict[str, Any]]})
    groups = []
    for number, entry in enumerate(entries):
        where = f"{text}: servers[{number}]"
        _check(where, entry, _FIELDS)
        if ("address" in entry) == ("addresses" in entry):
            raise AdapterError(f"{where} must have either 'address' or 'addresses'.")
        addresses = entry.get("addresses") or [entry["address"]]
        marks = tuple(entry.get("for", ()))
        groups.append(
            _group(where, addresses, _profile(text, entry, profile), marks, entry.get("revision", revision))
        )
    servers = Servers(tuple(groups), table.get("name"))
    _require_one_policy(text, servers)
    return servers


def _profile(text: str, entry: dict[str, Any], profile: str | None) -> str | None:
    """Return name or path of the profile of a group; a path in the file may be that of a file beside it."""
    own: str | None = entry.get("profile", profile)
    if "profile" in entry and own and own.endswith(".toml") and not Path(own).expanduser().is_file():
        return str(Path(text).expanduser().parent / own)
    return own


def _check(where: str, table: dict[str, Any], known: Mapping[str, Any]) -> None:
    """Check that a table has known fields alone, each of its type."""
    for field, value in table.items():
        if field not in known:
            raise AdapterError(f"{where}: {field!r} is unknown. {did_you_mean(field, known)}")
        if not fits(value, known[field]):
            raise AdapterError(f"{where}: {field}={value!r}, but must be {words(known[field])}.")


def _require_one_policy(text: str, servers: Servers) -> None:
    seen: set[str] = set()
    for group in servers.groups:
        for mark in group.marks or ("",):
            if mark in seen:
                whom = f"'for' names {mark!r} twice" if mark else "two groups have no 'for'"
                raise AdapterError(
                    f"{text}: {whom}. Each pair has one group of servers; list them as its addresses."
                )
            seen.add(mark)
    names = sorted({str(group.profile.get("policy", "name")) for group in servers.groups})
    if len(names) > 1 and servers.name is None:
        raise AdapterError(
            f"{text}: the profiles are of several policies ({', '.join(names)}), but a run measures one. If "
            "they are "
            "one, give its `name` in the first line; otherwise play them as runs of their own and compare "
            "these."
        )


def _group(
    where: str, addresses: list[str], profile: str | None, marks: tuple[str, ...], revision: str | None
) -> ServerGroup:
    if not addresses:
        raise AdapterError(f"{where}: no address is listed.")
    for address in addresses:
        if not is_address(address):
            raise refusal(
                address, f" in {where!r} is no address. Write SCHEME://HOST:PORT, several with commas."
            )
    read = [require_profile(address, profile) for address in addresses]
    twice = sorted({address for address in addresses if addresses.count(address) > 1})
    if twice:
        raise AdapterError(f"{where}: {twice[0]} is listed twice.")
    assert profile is not None
    suites = read[0].suites
    for mark in marks:
        if suites is not None and mark in SUITES and mark not in suites:
            raise AdapterError(
                f"{where} is for {mark!r}, but profile {read[0].name!r} is for {', '.join(suites)} alone. "
                "Name the profile of this suite."
            )
    return ServerGroup(tuple(addresses), read[0], profile, marks, revision)


def _resolved(text: str) -> list[str]:
    """Return an address for each IPv4 address of a host name; the address itself where there is one."""
    address = parse_address(text)
    if address.secure:  # its certificate is issued for the name
        return [text]
    try:
        entries = look_up(address.host, address.port, socket.AF_INET)
    except ServerError:  # no such name, or an IPv6 address: connecting says so
        return [text]
    hosts = sorted({str(entry[4][0]) for entry in entries})
    if len(hosts) < 2:
        return [text]
    query = text.partition("?")[2]
    end = f"{address.path}{f'?{query}' if query else ''}"
    return [f"{address.scheme}://{host}:{address.port}{end}" for host in hosts]


def require_known_marks(servers: Servers, known: Collection[str]) -> None:
    """Check that each group is for markers that a pair can have."""
    for group in servers.groups:
        for mark in group.marks:
            if mark not in known:
                raise AdapterError(
                    f"Servers are for {mark!r}, which is no marker of a pair. {did_you_mean(mark, known)}"
                )
