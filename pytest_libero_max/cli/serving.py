"""The command that serves a policy: serve."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from pytest_libero_max.errors import AdapterError

if TYPE_CHECKING:
    Commands = argparse._SubParsersAction[argparse.ArgumentParser]


def add_commands(commands: Commands) -> None:
    """Add ``serve`` to the parser."""
    serve = commands.add_parser(
        "serve", help="Serve a policy of an adapter, for workers here or elsewhere, until Ctrl-C"
    )
    serve.add_argument("adapter", metavar="ADAPTER", help="As for pytest --libero-max-policy")
    serve.add_argument("--host", default="127.0.0.1", help="Interface to listen at (default: %(default)s)")
    serve.add_argument("--port", type=int, default=8000, metavar="PORT", help="Default: %(default)s")
    serve.add_argument("--horizon", type=int, metavar="ACTIONS", help="Override H")
    serve.add_argument("--query-interval", type=int, metavar="ACTIONS", help="Override Q")
    serve.set_defaults(run=_serve)


def _serve(options: argparse.Namespace) -> None:
    from pytest_libero_max.policies.code import adapter_digest
    from pytest_libero_max.policies.loading import load_policy
    from pytest_libero_max.policies.servers.address import is_address
    from pytest_libero_max.policies.servers.host import Host, serving

    if is_address(options.adapter):
        raise AdapterError(f"policy={options.adapter!r} is a server already. Give its address to pytest.")
    policy = load_policy(options.adapter, horizon=options.horizon, query_interval=options.query_interval)
    host = Host(policy, f"adapter {adapter_digest(options.adapter)[:12]}")
    with serving(host, options.host, options.port) as (port, never):
        if options.host not in ("127.0.0.1", "::1", "localhost"):
            print(f"Whoever reaches {options.host}:{port} can ask this policy.", file=sys.stderr)
        print(
            f"Serving {policy.spec.name}. Play it from here or, with the name of this machine, from "
            "elsewhere:"
        )
        print(f"pytest --libero-max-policy=openpi://127.0.0.1:{port} --libero-max-profile=served", flush=True)
        never.wait()
