"""What a server costs a query: time to prepare the inputs, and time for codec and transport.

    python -m tests.policies.peers.overhead --queries 100

The policies cost nothing, and every server is a process of its own. They are asked in turn, query by query,
so that a busy machine is busy for all. ``LIBERO_MAX_TEST_PEERS`` names the Python of the published servers.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np

from pytest_libero_max.policies.servers.served import ServedPolicy, load_served
from tests.policies.peers.conftest import HERE, peer
from tests.policies.servers import fakes


@contextmanager
def own_server() -> Iterator[int]:
    """`libero-max serve` in a process of its own; its port."""
    command = str(Path(sys.executable).with_name("libero-max"))
    with subprocess.Popen(
        [command, "serve", str(HERE / "nothing.py"), "--port=0"], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        yield next(
            int(found[1]) for line in process.stdout if (found := re.search(r"openpi://[\d.]+:(\d+)", line))
        )
        process.terminate()


def timed(policy: ServedPolicy, index: int) -> tuple[float, float]:
    """Milliseconds to prepare the inputs of a query, and from there to its actions."""
    observation, query = fakes.observation(), fakes.query(index)
    began = time.perf_counter()
    request = policy.request(observation, query)
    prepared = time.perf_counter()
    policy.client.ask(request, policy.read)
    return 1e3 * (prepared - began), 1e3 * (time.perf_counter() - prepared)


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--queries", type=int, default=100)
    queries = parser.parse_args().queries
    with ExitStack() as open_:
        port = open_.enter_context(own_server())
        openpi = open_.enter_context(peer("openpi_server.py"))
        whole = open_.enter_context(peer("vla_eval_server.py", "reach", "0"))
        buffered = open_.enter_context(peer("vla_eval_server.py", "reach", "8"))
        policies = {
            "`libero-max serve`, `served`": load_served(f"openpi://127.0.0.1:{port}", "served"),
            "`libero-max serve`, `vla_eval`": load_served(
                f"vla-eval://127.0.0.1:{port}/vla-eval", "vla_eval", 5, 5
            ),
            "openpi, `pi05_libero`": load_served(f"openpi://127.0.0.1:{openpi}", "pi05_libero"),
            "vla-eval, chunk as a whole": load_served(f"vla-eval://127.0.0.1:{whole}", "vla_eval_pi05"),
            "vla-eval, five actions one by one": load_served(
                f"vla-eval://127.0.0.1:{buffered}", "vla_eval_pi05"
            ),
        }
        times: dict[str, list[tuple[float, float]]] = {name: [] for name in policies}
        for policy in policies.values():
            policy.reset(fakes.EPISODE)
        for index in range(queries + 5):
            for name, policy in policies.items():
                times[name].append(timed(policy, index))
        for policy in policies.values():
            policy.client.close()
    print(
        "| Server | Inputs (ms) | Codec and transport (ms) | Fastest tenth (ms) |\n| --- | --- | --- | --- |"
    )
    for name, values in times.items():
        (prepare, ask), (_, fastest) = (np.quantile(values[5:], share, axis=0) for share in (0.5, 0.1))
        print(f"| {name} | {prepare:.1f} | {ask:.1f} | {fastest:.1f} |")


if __name__ == "__main__":
    main()
