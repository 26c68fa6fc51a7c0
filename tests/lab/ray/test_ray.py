"""Runs on a real Ray cluster of several nodes on this machine, of which a node and an actor are killed."""

from __future__ import annotations

import importlib.util
import io
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.evaluation.work_queue import WorkQueue
from pytest_libero_max.lab.ray.connection import actor_capacity
from pytest_libero_max.lab.ray.remote import RemoteSession
from pytest_libero_max.pairing.record import PairRecord
from tests.plugin.conftest import results, run, short_sessions
from tests.plugin.processes.test_sending import HALF, SPELLED
from tests.plugin.test_run import Results, Run

__all__ = ["results", "run", "short_sessions"]  # fixtures

needs_ray = pytest.mark.skipif(
    importlib.util.find_spec("ray") is None, reason="Ray is not installed: pip install -r .ci/peers.txt"
)

CLUSTER = """
import sys
from ray.cluster_utils import Cluster

cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False})
for _ in range(2):
    cluster.add_node(num_cpus=1, wait=False)
cluster.wait_for_nodes()
print("address", cluster.address, flush=True)
sys.stdin.read()
cluster.shutdown()
"""

KILLING = """
import os
import re
import signal
import time

from adapter import Reacher


def parent(process):
    return int(re.search("PPid:\\\\s*([0-9]+)", open(f"/proc/{process}/status").read())[1])


class Killing(Reacher):
    def predict(self, observation, query):
        name = os.environ["PYTEST_CURRENT_TEST"].split("i00-")[1].split("]")[0]
        actor = os.getppid()
        victims = {"camera_shift-v0": [actor], "camera_shift-v1": [parent(actor), actor]}.get(name)
        if victims and not os.path.exists(name):
            open(name, "w").close()
            for victim in victims:  # the actor, or its whole node with the raylet, which started it
                os.kill(victim, signal.SIGKILL)
            time.sleep(60)
        if name == "illumination_switch-v0" and not os.path.exists("repaired"):
            os.write(2, b"I leave\\n")
            os._exit(3)
        return super().predict(observation, query)


policy = Killing
"""


BREAKING = """
import os
import time

from adapter import Reacher


class Breaking(Reacher):
    def reset(self, episode):
        time.sleep(0.3)  # so that a stop takes effect before all is played
        if "-v1]" in os.environ["PYTEST_CURRENT_TEST"]:
            raise RuntimeError("no")


policy = Breaking
"""


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """Address of a cluster with two nodes of one CPU each, and a head that plays nothing."""
    quiet = {"RAY_USAGE_STATS_ENABLED": "0", "RAY_worker_niceness": "0"}
    cluster = subprocess.Popen(
        [sys.executable, "-c", CLUSTER],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env={**os.environ, **quiet},
    )
    assert cluster.stdin is not None
    assert cluster.stdout is not None
    for line in cluster.stdout:
        if line.startswith("address "):
            yield line.split()[1]
            break
    else:
        pytest.fail("no cluster has started")
    cluster.communicate()


@needs_ray
def test_a_run_outlives_its_actors_and_nodes_and_equals_one_on_one_worker(
    run: Run, results: Results, address: str, pytester: pytest.Pytester
) -> None:
    pytester.makepyfile(killing=KILLING)
    nobody = run("--libero-max-ray=127.0.0.1:1", subprocess=True)
    assert nobody.ret == pytest.ExitCode.USAGE_ERROR
    nobody.stderr.fnmatch_lines(["*ray=127.0.0.1:1: no cluster can be used (*refused*). Start one with*"])
    too_large = run(f"--libero-max-ray={address},cpus=64", subprocess=True)
    assert too_large.ret == pytest.ExitCode.USAGE_ERROR
    too_large.stderr.fnmatch_lines(["*no actor has room in the cluster (3 nodes, 2 CPUs, 0 GPUs)*64 CPUs*"])
    assert not Path(pytester.path, "libero-max-results").exists()

    flags = ("--libero-max-policy=killing.py", "-k", "camera_shift or illumination", "--libero-max-retries=1")

    on_ray = run(f"--libero-max-ray={address}", "-v", *flags, policy=None, subprocess=True)
    text = on_ray.stdout.str()
    assert on_ray.ret == 11, text
    assert "3 retried" in text  # the killed actor's, the lost node's, and once the pair that ends its process
    assert "actor or node" in text
    errors = [line for line in results()[0] if line["line"] == "error"]
    assert [error["item_id"].split("i00-")[1] for error in errors] == ["illumination_switch-v0"]
    assert errors[0]["kind"] == "CrashError"
    assert "exit status 3" in errors[0]["message"]
    assert "'I leave'. Played 2 times." in errors[0]["message"]

    Path(pytester.path, "repaired").touch()
    resumed = run("--libero-max-resume", "-n", "0", *flags, policy=None, subprocess=True)
    assert resumed.ret == 0, resumed.stdout.str()
    plain = run("--libero-max-output=plain", "-n", "0", *flags, policy=None, subprocess=True)
    assert plain.ret == 0
    assert _identities(results()[0]) == _identities(results("plain")[0])


def _identities(lines: list[dict[str, Any]]) -> dict[str, Any]:
    pairs = [dict(line) for line in lines if line.pop("line") == "pair"]
    records = [PairRecord.from_dict(pair) for pair in pairs]
    return {record.item_id: json.dumps(record.identity(), sort_keys=True) for record in records}


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (("-n", "2"), "*--libero-max-ray and -n both hand out the pairs. Leave -n away*"),
        (("--pdb",), "*--pdb cannot stop in a pair that another machine plays*"),
    ],
)
def test_what_cannot_go_with_a_cluster_is_refused(run: Run, args: tuple[str, ...], message: str) -> None:
    refused = run("--libero-max-ray=auto", *args)
    assert refused.ret == pytest.ExitCode.USAGE_ERROR
    refused.stderr.fnmatch_lines([message])


@pytest.mark.skipif(importlib.util.find_spec("ray") is not None, reason="Ray is installed")
def test_what_is_missing_is_said(run: Run) -> None:
    refused = run("--libero-max-ray=auto")
    assert refused.ret == pytest.ExitCode.USAGE_ERROR
    refused.stderr.fnmatch_lines(["*Ray is not installed: `pip install -e '.[[]ray]'`*"])


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (("--libero-max-ray-gpus=1",), "*--libero-max-ray=ADDRESS,gpus=N*"),
        (("--libero-max-ray=x,cpus=0",), "*nothing says how many actors have room*"),
        (("--libero-max-ray=x,gpus=1.5",), "*expected a number of at least 0, whole above 1*"),
    ],
)
def test_options_of_actors_are_checked(run: Run, args: tuple[str, ...], message: str) -> None:
    refused = run(*args)
    assert refused.ret == pytest.ExitCode.USAGE_ERROR
    refused.stderr.fnmatch_lines([message])


@pytest.mark.parametrize(
    ("cpus", "gpus", "expected"),
    [(1, 0, 12), (2, 0, 5), (0, 1, 2), (0, 0.25, 8), (1, 0.3, 6), (16, 0, 0), (0, 2, 1)],
)
def test_room_is_counted_node_by_node(cpus: float, gpus: float, expected: int) -> None:
    nodes = [
        {"Alive": True, "Resources": {"CPU": 8.0, "GPU": 2.0}},
        {"Alive": True, "Resources": {"CPU": 3.0}},
        {"Alive": True, "Resources": {"CPU": 1.0}},
        {"Alive": True, "Resources": {}},
        {"Alive": False, "Resources": {"CPU": 64.0, "GPU": 8.0}},
    ]
    assert actor_capacity(nodes, cpus, gpus) == expected


def test_an_actor_plays_neighbours_and_an_idle_one_steals_half_of_the_longest_part() -> None:
    queue = WorkQueue("abcdefgh")
    assert [queue.take("one") for _ in range(2)] == ["a", "b"]
    assert [queue.take("two") for _ in range(2)] == ["f", "g"]
    assert [queue.take("three"), queue.take("one")] == ["d", "c"]
    queue.leave("two")  # it was to play h next
    queue.give_back("g")
    assert len(queue) == 3
    assert sorted(str(queue.take("one")) for _ in range(3)) == ["e", "g", "h"]
    assert queue.take("one") is None
    assert queue.take("three") is None


def test_pairs_are_handed_out_in_order_where_the_order_counts() -> None:
    queue = WorkQueue("abcdef", steal=False)
    assert [queue.take(actor) for actor in ("one", "two", "one", "three")] == ["a", "b", "c", "d"]
    queue.give_back("b")
    queue.leave("two")
    assert [queue.take("three") for _ in range(4)] == ["b", "e", "f", None]
    assert len(queue) == 0


@needs_ray
def test_a_rule_stops_a_run_on_a_cluster_at_the_pair_at_which_it_stops_workers(
    run: Run, results: Results, address: str, pytester: pytest.Pytester
) -> None:
    pytester.makepyfile(breaking=BREAKING)
    seen = "camera_shift or illumination or theme or noise"
    arguments = ("--libero-max-stop=errors:2", "--libero-max-order=blocks:7", "-k", seen)
    ends = []
    for workers in ("-n2", f"--libero-max-ray={address}"):
        spread = run(*arguments, workers, policy="breaking.py", subprocess=True)
        assert spread.ret == 11, spread.stdout.str()
        (*_, end), report = results()
        assert (end["line"], end["rule"]) == ("stopped", "errors:2")
        played = report["pairs"]["played"] + report["pairs"]["invalid"]
        assert end["at"] <= played < end["of"]  # what was in flight is kept
        ends.append(end)
    assert ends[0] == ends[1]


def test_an_actor_of_ray_sends_the_same() -> None:
    answers = io.BytesIO()
    RemoteSession({}, io.BytesIO(), answers).answer(
        {"reports": [{"longrepr": HALF, "sections": [(HALF, HALF)]}]}
    )
    (report,) = json.loads(answers.getvalue())["reports"]
    assert report == {"longrepr": SPELLED, "sections": [[SPELLED, SPELLED]]}
