"""``libero-max serve``: a policy of an adapter behind a socket."""

from __future__ import annotations

import argparse
import sys
from contextlib import suppress

from pytest_libero_max.cli.arguments import PORT, Commands, add_cadence, number, option, switch, whole_number
from pytest_libero_max.errors import AdapterError


def add_command(commands: Commands) -> None:
    """Add ``serve`` to the parser."""
    serve = commands.add_parser(
        "serve", help="Serve a policy of an adapter, for workers here or elsewhere, until Ctrl-C"
    )
    serve.add_argument("adapter", metavar="ADAPTER", help="As for pytest --libero-max-policy")
    option(serve, "--host", "Interface to listen at", default="127.0.0.1")
    option(serve, "--port PORT", "Default: %(default)s", type=PORT, default=8000)
    add_cadence(serve)
    option(
        serve,
        "--max-batch N",
        "Queries that a policy with predict_batch answers together (default: %(default)s, each alone)",
        type=whole_number(1),
        default=1,
    )
    option(
        serve,
        "--max-wait-ms MS",
        "Longest time that the first query of a batch waits for others",
        type=number(0, 60_000),
        default=5.0,
    )
    switch(
        serve,
        "--pad-batch",
        "Fill every batch up to --max-batch, so that the arithmetic always has the same shape",
    )
    serve.set_defaults(run=_serve)


def _serve(options: argparse.Namespace) -> None:
    from pytest_libero_max.policies.adapter_digest import adapter_digest, shown_identity
    from pytest_libero_max.policies.clients.address import TOKEN_VARIABLE, is_served, server_token
    from pytest_libero_max.policies.loading import load_policy
    from pytest_libero_max.policies.server.batching import Batching
    from pytest_libero_max.policies.server.host import Host
    from pytest_libero_max.policies.server.metrics import Metrics
    from pytest_libero_max.policies.server.sockets import serving

    if is_served(options.adapter):
        raise AdapterError.seen(
            "policy", options.adapter, " is a server already. Give its address to pytest."
        )
    batching = Batching(options.max_batch, options.max_wait_ms / 1000.0, options.pad_batch)
    policy = load_policy(options.adapter, horizon=options.horizon, query_interval=options.query_interval)
    revision, metrics = f"adapter {shown_identity(adapter_digest(options.adapter))}", None
    with suppress(AdapterError):  # the library may be missing, which /metrics says
        metrics = Metrics()
    host, token = Host(policy, revision, batching, metrics), server_token()
    with serving(host, options.host, options.port, token) as (port, never):
        if token is None and options.host not in ("127.0.0.1", "::1", "localhost"):
            print(
                f"Whoever reaches {options.host}:{port} can ask this policy. {TOKEN_VARIABLE}=... here "
                "and for pytest makes it ask for a token.",
                file=sys.stderr,
            )
        print(
            f"Serving {policy.spec.name}. Play it from here or, with the name of this machine, from "
            "elsewhere:"
        )
        print(f"pytest --libero-max-policy=openpi://127.0.0.1:{port} --libero-max-profile=served")
        print(f"Harnesses of vla-eval: ws://127.0.0.1:{port}/vla-eval", flush=True)
        never.wait()
