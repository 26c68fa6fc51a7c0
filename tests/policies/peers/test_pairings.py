"""Published servers, asked in every protocol: what is wrong is named within 5 s."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.policies.clients.each_protocol import EACH
from tests.policies.clients.pairings import first_line
from tests.policies.peers.conftest import require
from tests.policies.peers.pairings import PUBLISHED


@pytest.fixture(scope="module", params=[("openpi", "openpi.serving"), ("vla-eval", "vla_eval")])
def server(request: pytest.FixtureRequest) -> Iterator[tuple[str, int]]:
    name, module = request.param
    require(module)
    with PUBLISHED[name].serve() as port:
        yield name, port


@pytest.mark.parametrize("client", EACH)
def test_a_published_server_is_named_to_every_other_client(client: str, server: tuple[str, int]) -> None:
    kind = PUBLISHED[server[0]]
    line, took_s = first_line(client, server[1])
    assert (line is None) == (client in kind.speaks)
    assert line is None or kind.named in line
    assert took_s < 5.0
