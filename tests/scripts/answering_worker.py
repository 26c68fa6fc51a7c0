"""Worker of xdist that plays nothing: answers with the reports of pairs that were played before.

xdist sends this module to its workers in the place of its own, and it speaks the same protocol. It imports
neither pytest nor this package, so that a machine with two cores can hold hundreds of such workers.
"""

import collections
import json
import os
import sys
import threading
import time
from pathlib import Path
from typing import Any

FOLDER_VARIABLE, PAUSE_VARIABLE = "MEASURE_CONTROLLER_FOLDER", "MEASURE_CONTROLLER_PAUSE_S"
"""Folder of the known reports and of the pairs; time that a worker takes for a pair, s."""

REPORTS_NAME, PAIRS_NAME = "reports.json", "pairs.txt"
RESULT = "libero_max"
"""Attribute of a report that carries the record of its pair."""


class Known:
    """Reports of played pairs, by variant, to be sent under the names of others.

    Args:
        folder: Holds the reports, and the names of all pairs in lines of equal length.
    """

    def __init__(self, folder: Path) -> None:
        self._reports = json.loads((folder / REPORTS_NAME).read_text())
        self._pairs = folder / PAIRS_NAME
        with self._pairs.open("rb") as file:
            self._width = len(file.readline())

    def ids(self) -> list[str]:
        """Return the node ids of all pairs, in the order of play."""
        with self._pairs.open("rb") as file:
            return [json.loads(line)["nodeid"] for line in file]

    def reports(self, number: int) -> list[dict[str, Any]]:
        """Return the reports of the pair of this number, as they are sent."""
        with self._pairs.open("rb") as file:
            file.seek(number * self._width)
            pair = json.loads(file.readline())
        return [_renamed(data, pair) for data in self._reports[pair["nodeid"][-2]]]


def _renamed(data: dict[str, Any], pair: dict[str, Any]) -> dict[str, Any]:
    """Return a report under the name of another pair of the same variant."""
    before, after = (nodeid.partition("::")[2] for nodeid in (data["nodeid"], pair["nodeid"]))
    path, line, name = data["location"]
    now = time.time()
    renamed = {**data, "nodeid": pair["nodeid"], "start": now, "stop": now}
    renamed["location"] = (path, line, name.replace(before, after))
    renamed["keywords"] = {after if word == before else word: 1 for word in data["keywords"]}
    if data.get(RESULT) is not None:
        record = data[RESULT]
        known = json.loads(record)
        for key, value in pair.items():
            if key in known:
                old, new = (json.dumps({key: one})[1:-1] for one in (known[key], value))
                record = record.replace(old, new)
        renamed[RESULT] = record
    return renamed


class Worker:
    """Worker, seen from the controller like one of xdist's.

    Args:
        channel: To the controller.
        workerinput: Of the controller.
    """

    def __init__(self, channel: Any, workerinput: dict[str, Any]) -> None:
        self._channel, self._input = channel, workerinput
        self._known = Known(Path(os.environ[FOLDER_VARIABLE]))
        self._pause_s = float(os.environ[PAUSE_VARIABLE])
        self._queue: collections.deque[int | None] = collections.deque()
        self._filled = threading.Condition()

    def _send(self, name: str, **values: object) -> None:
        self._channel.send((name, values))

    def _hear(self, command: Any) -> None:
        with self._filled:
            name, values = command if isinstance(command, tuple) else ("shutdown", {})
            if name == "runtests":
                self._queue.extend(values["indices"])
            elif name == "shutdown":
                self._queue.append(None)
            elif name == "steal":
                asked = set(values["indices"])
                there = asked <= set(self._queue)
                if there:
                    self._queue = collections.deque(one for one in self._queue if one not in asked)
                self._send("unscheduled", indices=sorted(asked) if there else [])
            self._filled.notify()

    def _next(self) -> int | None:
        with self._filled:
            while not self._queue:
                self._filled.wait()
            return self._queue.popleft()

    def work(self) -> None:
        """Collect, and answer until the controller has no more pairs."""
        info = {"version": sys.version, "version_info": tuple(sys.version_info), "sysplatform": sys.platform}
        self._send("workerready", workerinfo={**info, "platform": "", "executable": "", "cwd": os.getcwd()})
        self._send("collectionstart")
        self._send("collectionfinish", topdir=os.getcwd(), ids=self._known.ids())
        self._channel.setcallback(self._hear, endmarker="shutdown")
        number = self._next()
        while number is not None:
            after = self._next()  # as xdist does, which has to know what to tear down
            begin = time.perf_counter()
            self._answer(number)
            self._send("runtest_protocol_complete", item_index=number, duration=time.perf_counter() - begin)
            number = after
        self._send("workerfinished", workeroutput={"exitstatus": 0, "shouldfail": False, "shouldstop": False})

    def _answer(self, number: int) -> None:
        reports = self._known.reports(number)
        name = {"nodeid": reports[0]["nodeid"], "location": reports[0]["location"]}
        self._send("logstart", **name)
        time.sleep(self._pause_s)
        shared = {"item_index": number, "worker_id": self._input["workerid"]}
        shared["testrun_uid"] = self._input["testrunuid"]
        for report in reports:
            now = time.time()
            self._send("testreport", data={**report, **shared, "start": now, "stop": now})
        self._send("logfinish", **name)


if __name__ == "__channelexec__":
    _channel = globals()["channel"]
    Worker(_channel, _channel.receive()[0]).work()
