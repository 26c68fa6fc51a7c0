"""HTTPS: HTTP with TLS."""

from __future__ import annotations

from pytest_libero_max.policies.clients.protocols.http import HttpProtocol


class HttpsProtocol(HttpProtocol):
    """JSON over HTTP with TLS."""

    scheme = "https"
    port = 443
