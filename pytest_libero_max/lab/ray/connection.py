"""Connection to a Ray cluster, and the number of actors that it has room for.

Ray is imported when a session asks for it, and never before.
"""

from __future__ import annotations

import importlib.util
import logging
import socket
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from typing import Any

from pytest_libero_max.errors import CrashError, OptionError, counted, install_extra
from pytest_libero_max.evaluation.processes.crash_log import Death
from pytest_libero_max.lab.ray.actor import PairActor, actors_on

_REACH_S = 20.0
"""Time for the head of the cluster to accept a connection, s."""

_FINISH_S = 12.0
"""Time for the actors to end their sessions in order, s."""


class Cluster:
    """Connection of a session to a Ray cluster. It ends with the session.

    Args:
        address: ``auto``, ``HOST:PORT`` or ``ray://HOST:PORT``.
        cpus: Of an actor, like ``gpus``.
        ship: A folder that is sent to the nodes, in which the actors play; None for none.
        kept_back: Paths in it that are not sent.

    Raises:
        OptionError: Ray is not installed, or there is no cluster at the address.
    """

    def __init__(
        self, address: str, cpus: float, gpus: float, ship: str | None, kept_back: Sequence[str]
    ) -> None:
        if importlib.util.find_spec("ray") is None:
            raise OptionError(f"--libero-max-ray={address}: Ray is not installed: {install_extra('ray')}.")
        import ray

        self._ray: Any = ray
        self._cpus, self._gpus = cpus, gpus
        self._options: dict[str, Any] = {"num_cpus": cpus, "num_gpus": gpus}
        sent = {} if ship is None else {"working_dir": ship, "excludes": [*kept_back]}
        try:
            _require_answer(address)
            ray.init(address=address, runtime_env=sent, log_to_driver=False, logging_level=logging.ERROR)
        except Exception as error:  # of Ray, of gRPC, of the system: whatever it is, there is no cluster
            raise OptionError(
                f"--libero-max-ray={address}: no cluster can be used ({_line(error)}). Start one with "
                "`ray start --head`, or give the address of yours. Its Ray and its Python have to be the "
                f"same as here: Ray {ray.__version__}."
            ) from None

    def capacity(self) -> int:
        return actor_capacity(self._ray.nodes(), self._cpus, self._gpus)

    def resources(self) -> str:
        """Return a line about nodes, CPUs and GPUs of the cluster."""
        there = self._ray.cluster_resources()
        nodes = sum(node["Alive"] for node in self._ray.nodes())
        cpus, gpus = (counted(there.get(kind, 0), kind) for kind in ("CPU", "GPU"))
        return f"{counted(nodes, 'node')}, {cpus}, {gpus}"

    def new_actor(self, plan: str) -> Any:
        """Request an actor, which Ray places on a node with room, now or later."""
        return self._ray.remote(PairActor).options(**self._options).remote(plan)

    def wait(self, answers: Sequence[Any], timeout_s: float) -> list[Any]:
        """Return the answers that have arrived, after a wait of at most ``timeout_s``."""
        return list(self._ray.wait(list(answers), num_returns=1, timeout=timeout_s)[0])

    def get(self, answer: Any) -> str | Death:
        """Return an answer that has arrived, or the death of its actor.

        Raises:
            OptionError: No actor like this one can start.
        """
        from ray import exceptions

        try:
            return str(self._ray.get(answer))
        except exceptions.RayError as error:
            hopeless = (exceptions.RuntimeEnvSetupError, exceptions.ActorUnschedulableError)
            if isinstance(error, hopeless) or "creation task" in str(error):
                raise OptionError(
                    f"No actor can start: {_line(error, -1)}. The nodes need pytest-libero-max, in the same "
                    "version and for the same Python."
                ) from None
            return Death(CrashError(f"Its actor or node was lost: {_line(error)}"), "", "")

    def end(self, actor: Any) -> None:
        with suppress(Exception):  # it is gone already, or the whole cluster is
            self._ray.kill(actor, no_restart=True)

    def finish(self, actors: Sequence[Any]) -> None:
        answers = [actor.finish.remote() for actor in actors]
        if answers:
            self._ray.wait(answers, num_returns=len(answers), timeout=_FINISH_S)

    def close(self) -> None:
        self._ray.shutdown()


def actor_capacity(nodes: Iterable[Mapping[str, Any]], cpus: float, gpus: float) -> int:
    """Return the number of actors that the living nodes have room for, whatever else runs there."""
    return sum(actors_on(node.get("Resources", {}), cpus, gpus) for node in nodes if node.get("Alive"))


def _require_answer(address: str) -> None:
    """Connect to the address, because Ray itself takes minutes to find that nothing listens."""
    host, colon, port = address.removeprefix("ray://").rpartition(":")
    if colon and port.isdigit():
        socket.create_connection((host.strip("[]"), int(port)), _REACH_S).close()


def _line(error: BaseException, number: int = 0) -> str:
    """Return the first line of an error's text, or the last one (-1)."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[number][:300] if lines else type(error).__name__
