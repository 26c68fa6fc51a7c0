"""The side that owns the run: it receives every record, writes them down, and reports at the end."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.cases import Json
from pytest_libero_max.errors import LiberoMaxError, SimulatorError
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.plugin.collection import case_of, manifest_of, settings_of
from pytest_libero_max.plugin.keys import RESULT_ATTRIBUTE
from pytest_libero_max.policies.loading import check_reference
from pytest_libero_max.report import provenance
from pytest_libero_max.report.plan import Run
from pytest_libero_max.report.store import PairStore, require_writable


class RunController:
    """Registered on the controller of a distributed run, or on the only process of a plain one.

    Raises:
        pytest.UsageError: The adapter cannot exist as named, or the output folder cannot be written to.
    """

    def __init__(self, config: pytest.Config) -> None:
        self.config = config
        self.settings = settings_of(config)
        self.manifest = manifest_of(config)
        self.cases = {case.item_id: case for case in self.manifest.cases}
        self.store: PairStore | None = None
        self.report: Json | None = None
        self.written: list[Path] = []
        self._reported: set[str] = set()
        try:
            check_reference(self.settings.reference)
            if not config.option.collectonly:
                require_writable(self.settings.output)
        except LiberoMaxError as error:
            raise pytest.UsageError(str(error)) from None

    def pytest_report_header(self) -> list[str]:
        settings = self.settings
        return [
            f"libero-max: policy {settings.policy}, {settings.case_set} ({len(self.manifest)} pairs, "
            f"digest {self.manifest.digest[:12]}), substrate {settings.substrate}, prefix {settings.prefix}"
        ]

    # What is planned: the pairs left after -k and -m, seen here or by the workers.

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        self._plan(item.nodeid for item in session.items)

    @pytest.hookimpl(optionalhook=True)
    def pytest_xdist_node_collection_finished(self, node: Any, ids: list[str]) -> None:
        self._plan(ids)

    def _plan(self, node_ids: Iterable[str]) -> None:
        planned = [self.cases[name] for name in map(case_of, node_ids) if name in self.cases]
        if planned and self.store is None and not self.config.option.collectonly:
            self.store = PairStore(self.settings.output, Run.of(planned, self._provenance()))

    def _provenance(self) -> Json:
        settings = self.settings
        return provenance.collect(
            policy={
                "reference": settings.reference,
                "horizon": settings.horizon,
                "query_interval": settings.query_interval,
            },
            substrate={"name": settings.substrate},
            case_set={"name": settings.case_set, "digest": self.manifest.digest},
            protocol={"prefix": settings.prefix},
            command=["pytest", *map(str, self.config.invocation_params.args)],
            folder=self.config.rootpath,
        )

    # What arrives.

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        name = case_of(report.nodeid)
        if name is None or self.store is None or name in self._reported:
            return
        result = getattr(report, RESULT_ATTRIBUTE, None)
        if result is not None:
            pair = PairError.from_dict(result) if "kind" in result else PairRecord.from_dict(result)
        elif report.failed:
            pair = PairError.of(self.cases[name], *_crash(report))
        else:
            return
        self._reported.add(name)
        self.store.append(pair)

    # What is said at the end.

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        if self.store is None:
            return
        from pytest_libero_max.report.output import write_reports

        self.store.close()
        self.report, self.written = write_reports(self.settings.output)

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        if self.report is None or terminalreporter.verbosity < 0:
            return
        from pytest_libero_max.report.summary import summary_lines

        terminalreporter.section("libero-max")
        here = self.config.invocation_params.dir
        for line in summary_lines(self.report, [str(_relative(path, here)) for path in self.written]):
            terminalreporter.write_line(line)


def _relative(path: Path, start: Path) -> Path:
    return path.relative_to(start) if path.is_relative_to(start) else path


def _crash(report: pytest.TestReport) -> tuple[BaseException, str]:
    """The error of a pair that ended without a word: its worker died, or somebody's hook failed it."""
    text = str(report.longrepr).strip().splitlines()
    return SimulatorError(text[-1] if text else "the item failed without a message"), "crash"
