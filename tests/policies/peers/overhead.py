"""What a server costs a query: time to prepare the inputs, and time for codec and transport.

    python -m tests.policies.peers.overhead --queries 100 --episodes 3 --pairs 4

The policies cost nothing, and every server is a process of its own. They are asked in turn, query by query,
so that a busy machine is busy for all. ``LIBERO_MAX_TEST_PEERS`` names the Python of the published servers.
With ``--episodes``, each also plays 50 steps of an embedded scene as often, as does the policy in process;
with ``--pairs``, as many whole pairs of the ``smoke`` track, in turn and to the end of their budgets.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np

from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.pairing.rollout import Rollout
from pytest_libero_max.pairing.runner import play_pair
from pytest_libero_max.pairing.stage import Stage
from pytest_libero_max.policies.clients.opening import load_served
from pytest_libero_max.policies.clients.served import ServedPolicy
from pytest_libero_max.policies.contract import Policy
from pytest_libero_max.substrates.registry import open_substrate
from tests.pairing.actors import shorten
from tests.policies.clients import fakes
from tests.policies.peers.conftest import HERE, peer
from tests.policies.peers.reach import Reach


@contextmanager
def own_server() -> Iterator[int]:
    """`libero-max serve` in a process of its own; its port."""
    command = str(Path(sys.executable).with_name("libero-max"))
    with subprocess.Popen(
        [command, "serve", str(HERE / "reach.py"), "--port=0"], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        try:
            yield next(
                int(found[1])
                for line in process.stdout
                if (found := re.search(r"openpi://[\d.]+:(\d+)", line))
            )
        finally:
            process.terminate()


def timed(policy: ServedPolicy, index: int) -> tuple[float, float]:
    """Milliseconds to prepare the inputs of a query, and from there to its actions."""
    observation, query = fakes.observation(), fakes.query(index)
    began = time.perf_counter()
    request = policy.request(observation, query)
    prepared = time.perf_counter()
    policy.client.ask(request, policy.read)
    return 1e3 * (prepared - began), 1e3 * (time.perf_counter() - prepared)


def played(policies: Mapping[str, Policy], episodes: int) -> Iterator[str]:
    """Lines on how long an episode takes with each policy, in process first."""
    substrate = open_substrate("embedded")
    case = shorten(load_track("original").cases[0])
    seconds: dict[str, list[float]] = {name: [] for name in policies}
    for number in range(episodes + 1):
        for name, policy in policies.items():
            rollout = Rollout.start(Stage(case, substrate.world(case), policy))
            began = time.perf_counter()
            rollout.advance_to_end()
            if number:
                seconds[name].append(time.perf_counter() - began)
    substrate.close()
    own = np.array(seconds["in process"])
    for name, values in seconds.items():
        yield f"| {name} | {np.median(values):.2f} | {np.median(np.array(values) / own):.2f} |"


def paired(policies: Mapping[str, Policy], count: int) -> Iterator[str]:
    """Lines on how many pairs each policy plays in a minute, one at a time, in process first."""
    substrate = open_substrate("embedded")
    cases = load_track("smoke").cases
    seconds: dict[str, list[float]] = {name: [] for name in policies}
    for case in cases[:: len(cases) // count][:count]:
        proofs = set()
        world = substrate.world(case)
        Rollout.start(Stage(case, world, Reach())).advance()  # the scene is built, and its images drawn once
        for name, policy in policies.items():
            began = time.perf_counter()
            record = play_pair(case, world, policy)
            seconds[name].append(time.perf_counter() - began)
            proofs.add((record.base_steps, record.dynamic_steps))
            print(case.item_id, name, f"{seconds[name][-1]:.1f} s", file=sys.stderr, flush=True)
        assert len(proofs) == 1, f"the policies did not do the same: {proofs}"
    substrate.close()
    own = np.array(seconds["in process"])
    for name, values in seconds.items():
        ratio = np.median(np.array(values) / own)
        yield f"| {name} | {60 * count / sum(values):.1f} | {ratio:.2f} |"


def main() -> None:
    """Print a table, or several."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--queries", type=int, default=100)
    parser.add_argument("--episodes", type=int, default=0)
    parser.add_argument("--pairs", type=int, default=0)
    options = parser.parse_args()
    queries = options.queries
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
        all_of_them: dict[str, Policy] = {"in process": Reach(), **policies}
        lines = list(played(all_of_them, options.episodes)) if options.episodes else []
        pairs = list(paired(all_of_them, options.pairs)) if options.pairs else []
        for policy in policies.values():
            policy.client.close()
    print(
        "| Server | Inputs (ms) | Codec and transport (ms) | Fastest tenth (ms) |\n| --- | --- | --- | --- |"
    )
    for name, values in times.items():
        (prepare, ask), (_, fastest) = (np.quantile(values[5:], share, axis=0) for share in (0.5, 0.1))
        print(f"| {name} | {prepare:.1f} | {ask:.1f} | {fastest:.1f} |")
    if lines:
        print("\n| Policy | 50 steps (s) | beside in process |\n| --- | --- | --- |", *lines, sep="\n")
    if pairs:
        print("\n| Policy | Pairs a minute | beside in process |\n| --- | --- | --- |", *pairs, sep="\n")


if __name__ == "__main__":
    main()
