"""Controller of a run on a Ray cluster: hands out the pairs, and reports them as if they were played here."""

from __future__ import annotations

import json
import os
import sys
import time
import uuid
from dataclasses import dataclass
from itertools import zip_longest
from types import SimpleNamespace
from typing import Any

import pytest

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import OptionError, counted
from pytest_libero_max.evaluation.processes.crash_log import Death
from pytest_libero_max.evaluation.work_queue import WorkQueue
from pytest_libero_max.lab.ray.connection import Cluster
from pytest_libero_max.lab.ray.remote import identity
from pytest_libero_max.plugin.collection import PairItem, only_lists
from pytest_libero_max.plugin.controller import RunController
from pytest_libero_max.plugin.options import usage_errors
from pytest_libero_max.plugin.processes.workers import Retries
from pytest_libero_max.policies.clients.address import TOKEN_VARIABLE

CARRIED = (
    "MUJOCO_GL",
    "OPENBLAS_CORETYPE",
    "OPENBLAS_NUM_THREADS",
    "PYOPENGL_PLATFORM",
    "PYTEST_ADDOPTS",
    "PYTEST_PLUGINS",
    "PYTHONPATH",
    TOKEN_VARIABLE,
)
"""Variables of the environment that the actors get from here; the others are those of their node."""

_LOOK_S = 2.0
"""Time between two looks at the capacity of the cluster, s."""

_ALONE_S = 30.0
"""Time without an actor that plays, after which a line says that the run waits for one, s."""


@dataclass(eq=False)
class _Actor:
    """An actor, seen from the controller.

    Attributes:
        name: For people: ``ray1``.
        handle: Ray's handle of it.
        where: Its node, once it has started.
        pair: The pair that it plays; None while it starts and while it is idle.
    """

    name: str
    handle: Any
    where: str = ""
    pair: PairItem | None = None


class RayRun:
    """A plugin beside the controller of a run that plays on a Ray cluster.

    Raises:
        pytest.UsageError: Other options hand out the tests as well, or no cluster answers.
    """

    def __init__(self, controller: RunController) -> None:
        self._config, self._settings = config, settings = controller.config, controller.settings
        _require_alone(config)
        self._cases, self._stop = controller.cases, controller.stop
        assert settings.ray is not None
        self._asked = asked = settings.ray
        self._cluster: Cluster | None = None
        self._retries = Retries(settings, asked.actors or 1, "actors", self._stop)
        config.pluginmanager.register(self._retries)
        self._pending: dict[Any, _Actor] = {}  # by the answer that is awaited of them
        self._idle: list[_Actor] = []
        self._count = 0
        self._wanted = 0
        self._looked_at = -_LOOK_S
        self._played_at = time.monotonic()
        self._run_id = uuid.uuid4().hex
        self._items: dict[str, PairItem] = {}
        self._queue = WorkQueue(())
        self._identity: Json = {}

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionstart(self) -> None:
        """Connect, so that a wrong address is said before anything is collected."""
        if only_lists(self._config):
            return
        asked, here = self._asked, str(self._config.invocation_params.dir)
        output = self._settings.output
        inside = [str(output.relative_to(here))] if output.is_relative_to(here) else []
        with usage_errors():
            self._cluster = Cluster(
                asked.address,
                asked.cpus,
                asked.gpus,
                here if asked.ship else None,
                [".git", ".venv", *inside],
            )
            if asked.actors is None and not self._cluster.capacity():
                raise OptionError(
                    f"--libero-max-ray={asked.address}: no actor has room in the cluster "
                    f"({self._cluster.resources()}), which takes "
                    f"{counted(asked.cpus, 'CPU')} and {counted(asked.gpus, 'GPU')}. Lower cpus= or gpus=, "
                    "or name a number of actors with actors=N, which waits for room."
                )

    def pytest_report_header(self) -> str | None:
        if self._cluster is None:
            return None
        asked = self._asked.actors
        actors = f"as many as have room, now {self._cluster.capacity()}" if asked is None else asked
        return f"libero-max: Ray at {self._asked.address} ({self._cluster.resources()}), actors: {actors}"

    def pytest_runtestloop(self, session: pytest.Session) -> bool | None:
        """Play the pairs on the cluster, and then all other tests here."""
        failed = session.testsfailed and not self._config.option.continue_on_collection_errors
        pairs = [item for item in session.items if isinstance(item, PairItem)]
        if failed or not pairs or self._cluster is None:
            return None
        self._items = {item.nodeid: item for item in pairs}
        self._queue = WorkQueue(self._items, steal=not self._settings.in_order)
        self._identity = identity(self._config)
        try:
            self._play_all(session, self._cluster)
        finally:
            for actor in (*self._pending.values(), *self._idle):
                self._cluster.end(actor.handle)
        self._require_going_on(session)
        others = [item for item in session.items if not isinstance(item, PairItem)]
        for item, after in zip_longest(others, others[1:]):
            self._config.hook.pytest_runtest_protocol(item=item, nextitem=after)
            self._require_going_on(session)
        return True

    def _require_going_on(self, session: pytest.Session) -> None:
        if session.shouldfail:
            raise session.Failed(session.shouldfail)
        if session.shouldstop:
            raise session.Interrupted(session.shouldstop)

    def _play_all(self, session: pytest.Session, cluster: Cluster) -> None:
        while True:
            stops = self._stop.stopped is not None
            if stops:
                self._end_starting(cluster)
            else:
                self._request_actors(cluster)
                self._assign()
            plays = any(actor.pair for actor in self._pending.values())
            if not plays and (stops or not self._queue):
                break
            if not self._pending:
                time.sleep(_LOOK_S)  # no node has room: wait until one has
            else:
                for answer in cluster.wait(list(self._pending), _LOOK_S):
                    self._receive(session, cluster, answer)
            self._report_waiting()
        cluster.finish([actor.handle for actor in self._idle])

    # The actors.

    def _request_actors(self, cluster: Cluster) -> None:
        """Request as many actors as there are pairs left and slots in the cluster."""
        if time.monotonic() - self._looked_at >= _LOOK_S:
            self._looked_at = time.monotonic()
            self._wanted = self._asked.actors or cluster.capacity()
            self._retries.processes = max(self._wanted, 1)
        busy = sum(actor.pair is not None for actor in self._pending.values())
        there = len(self._pending) + len(self._idle)
        for _ in range(min(self._wanted, len(self._queue) + busy) - there):
            self._count += 1
            actor = _Actor(f"ray{self._count}", cluster.new_actor(self._plan(f"ray{self._count}")))
            self._pending[actor.handle.start.remote()] = actor

    def _plan(self, name: str) -> str:
        config, settings = self._config, self._settings
        here = str(config.invocation_params.dir)
        node = SimpleNamespace(workerinput={}, config=config, gateway=SimpleNamespace(id=name))
        node.workerinput.update(workerid=name, workercount=1, testrunuid=self._run_id, mainargv=sys.argv)
        if config.pluginmanager.has_plugin("xdist"):
            config.hook.pytest_configure_node(node=node)  # what other plugins tell the workers of xdist
        arguments = [*map(str, config.invocation_params.args), f"--libero-max-output={settings.output}"]
        if settings.shard is not None:  # which env means on this machine
            arguments.append("--libero-max-shard={}/{}".format(*settings.shard))
        plan = {
            "arguments": arguments,
            "environment": {name: os.environ[name] for name in CARRIED if name in os.environ},
            "folder": None if self._asked.ship else here,
            "folder_on_path": bool({"", here} & set(sys.path)),
            "workerinput": node.workerinput,
            "cpus": self._asked.cpus,
            "gpus": self._asked.gpus,
        }
        return json.dumps(plan, default=repr)

    def _assign(self) -> None:
        for actor in tuple(self._idle):
            name = self._queue.take(actor)
            if name is None:
                return
            item = self._items[name]
            self._idle.remove(actor)
            actor.pair, self._played_at = item, time.monotonic()
            self._config.hook.pytest_runtest_logstart(nodeid=name, location=item.location)
            self._pending[actor.handle.play.remote(name)] = actor

    def _end_starting(self, cluster: Cluster) -> None:
        for answer in [answer for answer, actor in self._pending.items() if actor.pair is None]:
            cluster.end(self._pending.pop(answer).handle)

    def _report_waiting(self) -> None:
        if any(actor.pair for actor in self._pending.values()):
            self._played_at = time.monotonic()
        elif time.monotonic() - self._played_at > _ALONE_S:
            self._played_at = time.monotonic()
            reporter = self._config.pluginmanager.get_plugin("terminalreporter")
            if reporter is not None:
                reporter.write_line("\nlibero-max: no actor plays; waiting for a node that has room for one")

    # What arrives.

    def _receive(self, session: pytest.Session, cluster: Cluster, answer: Any) -> None:
        actor = self._pending.pop(answer)
        try:
            told = cluster.get(answer)
        except OptionError as error:
            self._stop.stop(str(error))
            return
        content: Json = {"died": told} if isinstance(told, Death) else json.loads(told)
        if "died" in content:
            self._lost(cluster, actor, content["died"])
            return
        for warning in content.get("warnings", ()):
            self._warn(warning)
        if actor.pair is None:
            self._started(cluster, actor, content)
            return
        item, actor.pair = actor.pair, None
        if "unknown" in content:
            self._stop.stop(
                f"{actor.where} collects no {item.nodeid}. Its options, ini file or plugins are others than "
                "those here."
            )
            cluster.end(actor.handle)
            return
        for data in content["reports"]:
            report = self._config.hook.pytest_report_from_serializable(config=self._config, data=data)
            self._log(report, actor)
        self._config.hook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
        if content["stop"] and not session.shouldfail:
            session.shouldfail = content["stop"]
        self._idle.append(actor)

    def _started(self, cluster: Cluster, actor: _Actor, hello: Json) -> None:
        """Let an actor play that has collected the same as the controller; stop the run for any other."""
        actor.where = hello["where"]
        if "refused" in hello:
            self._stop.stop(f"{hello['refused']} {_CURE}")
        elif hello["errors"]:
            self._stop.stop(f"{actor.where} cannot collect the tests: {hello['errors'][0][-2000:]} {_CURE}")
        else:
            other = [what for what, value in self._identity.items() if hello["identity"].get(what) != value]
            if not other:
                self._idle.append(actor)
                return
            self._stop.stop(f"{actor.where} differs from this machine: {', '.join(other)}. {_CURE}")
        cluster.end(actor.handle)

    def _lost(self, cluster: Cluster, actor: _Actor, death: Any) -> None:
        """Retry the pair of an actor that is lost, or whose process died, on another actor."""
        if not isinstance(death, Death):
            death = Death.from_dict(death)
        cluster.end(actor.handle)
        self._queue.leave(actor)
        self._looked_at -= _LOOK_S  # its node may be gone too
        self._retries.died(death)
        item = actor.pair
        if item is None:
            return
        report = pytest.TestReport(
            nodeid=item.nodeid,
            location=item.location,
            keywords={},
            outcome="failed",
            longrepr="",
            when="???",  # type: ignore[arg-type]
        )

        def play_again() -> bool:
            self._queue.give_back(item.nodeid)
            return True

        self._retries.report_death(report, self._cases[item.case.item_id], death, play_again)
        self._log(report, actor)

    def _log(self, report: Any, actor: _Actor) -> None:
        # As xdist does, for the terminal and for the heading of a failure.
        info = {"id": actor.name, "sysplatform": sys.platform, "version_info": sys.version_info}
        info["executable"] = actor.where
        report.node = SimpleNamespace(gateway=SimpleNamespace(id=actor.name), workerinfo=info)
        self._config.hook.pytest_runtest_logreport(report=report)

    def _warn(self, warning: Json) -> None:
        from xdist.workermanage import unserialize_warning_message

        told = {"warning_message": unserialize_warning_message(warning["told"])}
        told |= {name: warning[name] for name in ("when", "nodeid", "location")}
        self._config.hook.pytest_warning_recorded.call_historic(kwargs=told)

    def pytest_unconfigure(self) -> None:
        if self._cluster is not None:
            self._cluster.close()


_CURE = (
    "The nodes need the same code, adapter and cases, at the same paths: share the folder with them, or send "
    "it with --libero-max-ray=ADDRESS,ship."
)


def _require_alone(config: pytest.Config) -> None:
    if config.getoption("tx", None):
        raise pytest.UsageError(
            "--libero-max-ray and -n both hand out the pairs. Leave -n away; where the ini file has it, add "
            "-n 0."
        )
    if config.getoption("cov_source", None):
        raise pytest.UsageError(
            "--cov measures nothing in the actors of --libero-max-ray. Leave --cov away, or play with -n."
        )
    if config.getoption("usepdb", False):
        raise pytest.UsageError(
            "--pdb cannot stop in a pair that another machine plays. Leave --libero-max-ray away to debug it."
        )
