"""Statuses of HTTP and redirects, as a client of policy servers takes them, over WebSockets as well."""

from __future__ import annotations

from dataclasses import replace
from urllib.parse import urljoin, urlsplit

from pytest_libero_max.errors import ServerError
from pytest_libero_max.policies.clients.address import TOKEN_VARIABLE, Address, server_token
from pytest_libero_max.policies.clients.codecs import shortened
from pytest_libero_max.policies.clients.transport import Refused, Unreachable

MOST_REDIRECTS = 3

_TOKENS = (401, 403, 407)
_NEVER = (*_TOKENS, 404, 405, 410, 426)
"""Statuses that the next request would get as well."""

_WAITING = (408, 425, 429, 502, 503, 504, *range(520, 531))
"""Statuses of servers that start, and of balancers before them."""


def status_error(status: int, reason: str, path: str, content: bytes, usual: str = "") -> ServerError:
    """Return the error of an answer that is none.

    Args:
        content: The body, which is quoted unless it is a page.
        usual: Path that an address without one stands for; empty for none.
    """
    words = content.strip()
    body = "" if not words or words[:1] == b"<" else f": {shortened(words.decode('utf-8', 'replace'))}"
    text = f"HTTP status {status} {reason} for {path or '/'}{body}"
    if status in _TOKENS:
        given = server_token() is not None
        reason_shown = (
            f"The token in {TOKEN_VARIABLE} is not accepted"
            if given
            else f"Give the token in {TOKEN_VARIABLE}"
        )
        also = ", or the path of the address is another" if status == 403 else ""
        return Refused(f"{text}. {reason_shown}{also}")
    if status in _NEVER and usual not in ("", path):
        return Refused(
            f"{text}. An address without a path stands for {usual}: leave {path} out, or give the path of "
            "the policy or the port of its server"
        )
    if status in _NEVER:
        return Refused(f"{text}. Give the path of the policy in the address, or the port of its server")
    if 300 <= status < 400:
        return Refused(f"{text}. Give the address to which it sends")
    return Unreachable(text) if status in _WAITING else ServerError(text)


def redirected(address: Address, location: str | None, status: int) -> Address:
    """Return the address to which a server sends, which is on the same host.

    Raises:
        Refused: It is on another host, without TLS where the first has it, or no address.
    """
    here = f"{'https' if address.secure else 'http'}://{address.where}{address.path or '/'}"
    there = urljoin(here, location or "")
    try:
        parts = urlsplit(there)
        port = parts.port
    except ValueError:
        raise Refused(f"HTTP status {status} sends to {shortened(there)}, which is no address") from None
    secure = parts.scheme in ("https", "wss")
    what = f"HTTP status {status} sends to {shortened(there)}"
    if location is None or parts.scheme not in ("http", "https", "ws", "wss"):
        raise Refused(f"{what}, which is no address of a server")
    if parts.hostname != address.host.lower():
        raise Refused(
            f"{what}, on another host, to which neither observations nor a token are sent. Give that address "
            "if it is that of the policy"
        )
    if address.secure and not secure:
        raise Refused(f"{what}, which is not encrypted. Give that address if it is the server")
    return replace(
        address.over(address.protocol, secure),
        port=port or (443 if secure else 80),
        path=parts.path + (f"?{parts.query}" if parts.query else ""),
    )
