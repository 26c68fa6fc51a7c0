"""Process of an actor: a pytest session that plays the pairs it is sent.

It reads one line of JSON for each command from its stdin, and writes one line for each answer to what is its
stdout when it starts.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

import pytest

import pytest_libero_max
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import LiberoMaxError
from pytest_libero_max.evaluation.policy_source import PolicySource
from pytest_libero_max.evaluation.processes.pair_process import close_in_children
from pytest_libero_max.machine import end_with_parent
from pytest_libero_max.plugin.collection import cases_of_run, settings_of
from pytest_libero_max.plugin.processes.sending import sendable


class RemoteSession:
    """A plugin that makes the session a worker, which plays the pairs that arrive.

    Args:
        workerinput: Values that the controller sends its workers, as xdist's does.
        commands: Stream of commands, a line of JSON each, like ``answers``.
    """

    def __init__(self, workerinput: Json, commands: BinaryIO, answers: BinaryIO) -> None:
        self._workerinput = workerinput
        self._commands, self._answers = commands, answers
        self._reports: list[Any] = []
        self._warnings: list[Json] = []
        self._errors: list[str] = []
        self._config: pytest.Config | None = None

    @pytest.hookimpl(tryfirst=True)
    def pytest_cmdline_main(self, config: pytest.Config) -> None:
        """Make the session a worker, which leaves the tasks of the controller's session to that."""
        self._config = config
        config.workerinput = self._workerinput  # type: ignore[attr-defined]
        config.workeroutput = {}  # type: ignore[attr-defined]
        option = config.option
        option.usepdb, option.basetemp, option.numprocesses, option.dist = False, None, None, "no"
        for name in ("lf", "failedfirst", "newfirst", "stepwise"):  # of a cache that the nodes do not share
            setattr(option, name, False)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.failed:
            self._errors.append(str(report.longrepr))

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        items = {item.nodeid: item for item in session.items}
        self.answer({"identity": identity(session.config), "errors": self._errors})
        while (command := self._next()) is not None:
            self._play(session, items, command["play"])
        return True

    def _next(self) -> Json | None:
        line = self._commands.readline()
        command: Json | None = json.loads(line) if line else None
        return command

    def _play(self, session: pytest.Session, items: dict[str, pytest.Item], name: str) -> None:
        self._reports.clear()
        item = items.get(name)
        if item is None:
            self.answer({"unknown": True})
            return
        # Whatever is played next: what belongs to the session stays loaded until its end.
        after = next(
            (other for other in items.values() if other.parent is item.parent and other is not item), None
        )
        session.config.hook.pytest_runtest_protocol(item=item, nextitem=after)
        self.answer({"reports": self._reports, "stop": str(session.shouldfail or session.shouldstop or "")})

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        assert self._config is not None
        hook = self._config.hook.pytest_report_to_serializable
        self._reports.append(hook(config=self._config, report=report))

    def pytest_warning_recorded(
        self, warning_message: warnings.WarningMessage, when: str, nodeid: str, location: Any
    ) -> None:
        # Here, because pytest warns of a plugin's module that is imported before it is registered.
        from xdist.remote import serialize_warning_message

        told = serialize_warning_message(warning_message)
        self._warnings.append({"told": told, "when": when, "nodeid": nodeid, "location": location})

    def answer(self, answer: Json) -> None:
        text = json.dumps(sendable({**answer, "warnings": self._warnings}), default=repr)
        self._warnings.clear()
        self._answers.write(text.encode() + b"\n")
        self._answers.flush()


def identity(config: pytest.Config) -> Json:
    """Digests that have to be the same wherever pairs of a run are played, by name."""
    try:
        adapter = PolicySource(settings_of(config)).identity()
    except LiberoMaxError as error:
        adapter = str(error)
    return {
        "code of pytest-libero-max": _own_digest(),
        "case set": cases_of_run(config).manifest.digest,
        "adapter": adapter,
    }


def _own_digest() -> str:
    """SHA-256 of this package's own Python files, hexadecimal."""
    folder = Path(pytest_libero_max.__file__).parent
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*.py")):
        digest.update(f"{path.relative_to(folder)}|".encode() + path.read_bytes())
    return digest.hexdigest()


def _own_pipes() -> tuple[BinaryIO, BinaryIO]:
    """Return the pipes to the actor, which nothing else in this process reads from or writes to."""
    commands, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nowhere = os.open(os.devnull, os.O_RDWR)
    os.dup2(nowhere, 0)
    os.dup2(nowhere, 1)
    os.close(nowhere)
    return commands, answers


def main(arguments: Sequence[str]) -> int:
    """Play pairs until the stdin ends."""
    end_with_parent()
    commands, answers = _own_pipes()
    close_in_children([commands.fileno(), answers.fileno()])
    session = RemoteSession(json.loads(commands.readline()), commands, answers)
    return int(pytest.main([*arguments], plugins=[session]))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
