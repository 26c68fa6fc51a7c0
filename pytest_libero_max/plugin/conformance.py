"""A session that examines a subject: each rule is an item, and what was found is written at the end.

Workers of xdist examine with a subject of their own; their findings come to the controller as properties of
the reports, which are in the JUnit file as well.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from pytest_libero_max.errors import counted, did_you_mean
from pytest_libero_max.plugin import options
from pytest_libero_max.plugin.collection import settings_of
from pytest_libero_max.plugin.options import usage_errors
from pytest_libero_max.substrates.registry import DEFAULT

if TYPE_CHECKING:
    from pytest_libero_max.conformance.results import Conformance, Expected, RuleResult
    from pytest_libero_max.conformance.rules import Examination, Outcome, Rule
    from pytest_libero_max.evaluation.settings import Settings

RULES_FILE = Path(__file__)
"""Path on the command line that stands for the rules."""

NODE = "libero-max-conform"
"""Beginning of the items' node ids, and the argument that stands for the rules."""

_PROPERTY = "libero_max_rule"
_LETTERS = {"should": ("should", "S", "SHOULD"), "note": ("note", "n", "NOTE")}


def is_asked(config: pytest.Config) -> bool:
    """Return True if this session examines a subject, which only the command line asks for."""
    return config.getoption("libero_max_conform", None) is not None


def aim(config: pytest.Config) -> None:
    """Let the session collect the rules, where no other tests are named."""
    unaimed = config.args_source is not pytest.Config.ArgsSource.ARGS
    named = [NODE] if unaimed else config.args
    config.args = [f"{RULES_FILE}{arg.removeprefix(NODE)}" if arg.startswith(NODE) else arg for arg in named]


def configure(config: pytest.Config) -> None:
    """Check the subject, and set up what examines it and what reports of it, or raise pytest.UsageError."""
    if options.policy_on_command_line(config):
        raise pytest.UsageError(
            "--libero-max-conform examines a subject and --libero-max-policy plays pairs. Give one of them; "
            "the policy to examine is named as --libero-max-conform=policy:ADAPTER."
        )
    settings = settings_of(config)
    assert settings.conform is not None
    with usage_errors():
        settings.conform.check(settings.profile)
        session = ConformanceSession(settings)
    config.pluginmanager.register(session)
    for marker in session.markers:
        config.addinivalue_line("markers", marker)
    if not hasattr(config, "workerinput"):
        config.pluginmanager.register(ConformanceController(session))


class ConformanceSession:
    """Collects the rules and examines them, in each process."""

    def __init__(self, settings: Settings) -> None:
        from pytest_libero_max.conformance.registry import rules_for
        from pytest_libero_max.conformance.results import read_expected

        assert settings.conform is not None
        self.settings = settings
        self.subject = settings.conform
        self.rules = {rule.id: rule for rule in rules_for(self.subject.kind)}
        self.expected: Mapping[str, Expected] = (
            {} if settings.xfails is None else read_expected(settings.xfails)
        )

    @property
    def markers(self) -> Iterator[str]:
        """The lines that declare the markers of the rules: levels and areas."""
        for level in ("must", "should", "note"):
            yield f"{level}: rules of this level"
        for area in dict.fromkeys(rule.area for rule in self.rules.values()):
            yield f"{area}: rules about {area}"

    @property
    def options(self) -> list[str]:
        """The options that the subject is examined with, as they are written on a command line."""
        settings = self.settings
        values = {
            "profile": settings.profile,
            "horizon": settings.horizon,
            "query-interval": settings.query_interval,
            "substrate": None if str(settings.substrate) == DEFAULT else settings.substrate,
        }
        return [f"--libero-max-{name}={value}" for name, value in values.items() if value is not None]

    @cached_property
    def examination(self) -> Examination:
        """The examination of the subject in this process."""
        from pytest_libero_max.conformance.subjects import examination

        settings = self.settings
        return examination(
            self.subject,
            horizon=settings.horizon,
            query_interval=settings.query_interval,
            profile=settings.profile,
            substrate=str(settings.substrate),
        )

    @pytest.hookimpl(tryfirst=True)
    def pytest_pycollect_makemodule(
        self, module_path: Path, parent: pytest.Collector
    ) -> pytest.Module | None:
        """Return the collector of the rules; None for any other module."""
        if module_path != RULES_FILE:
            return None
        module = RuleModule.from_parent(parent, path=module_path, nodeid=NODE)
        module.examining = self
        return module


class RuleModule(pytest.Module):
    """Collector of the rules."""

    examining: ConformanceSession

    def collect(self) -> Iterator[pytest.Item]:
        for rule in self.examining.rules.values():
            item = RuleItem.from_parent(self, name=rule.id)
            item.rule, item.examining = rule, self.examining
            for marker in dict.fromkeys((rule.level, rule.area)):
                item.add_marker(marker)
            if (expected := self.examining.expected.get(rule.id)) is not None:
                item.add_marker(pytest.mark.xfail(reason=str(expected), strict=False))
            yield item


class RuleBroken(Exception):
    """A rule is broken; the message has observed, expected and cure."""


class RuleItem(pytest.Item):
    """Test of one rule: fails where a rule of level ``must`` is broken, or one that is expected to be."""

    rule: Rule
    examining: ConformanceSession

    def runtest(self) -> None:
        from pytest_libero_max.benchmark.structs import to_builtins
        from pytest_libero_max.conformance.lines import message
        from pytest_libero_max.conformance.results import RuleResult

        outcome: Outcome = self.examining.examination.outcome(self.rule.id)
        result = RuleResult.of(outcome, self.examining.expected.get(self.rule.id))
        self.user_properties.append((_PROPERTY, json.dumps(to_builtins(result))))
        if outcome.state == "unexamined":
            reasons = (finding.observed for finding in outcome.findings if finding.state == "unexamined")
            pytest.skip("; ".join(dict.fromkeys(reasons)) or "nothing to examine")
        if outcome.fails or (outcome.broken and result.expected_to_break):
            raise RuleBroken(message(outcome, str(self.examining.subject), self.examining.options))

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        if isinstance(excinfo.value, RuleBroken):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, None, str]:
        return self.path, None, f"{NODE}::{self.rule.id}"


class ConformanceController:
    """Gathers what was found, shows it, and writes it into the output folder."""

    def __init__(self, session: ConformanceSession) -> None:
        self._session = session
        self._results: dict[str, RuleResult] = {}

    def pytest_report_header(self) -> str:
        """Return the subject, and the number of rules."""
        return (
            f"libero-max: {self._session.subject} is examined by {counted(len(self._session.rules), 'rule')}"
        )

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Keep what was found of a rule."""
        result = _result_in(report)
        if result is not None and report.when == "call":
            self._results[result.id] = result

    def pytest_report_teststatus(self, report: pytest.TestReport) -> tuple[str, str, str] | None:
        """Return the letter of a broken rule that does not fail: S for ``should``, n for ``note``."""
        result = _result_in(report) if report.when == "call" and report.passed else None
        if result is None or result.state != "broken":
            return None
        return _LETTERS[result.level]

    @property
    def document(self) -> Conformance:
        """What was found so far."""
        from pytest_libero_max.conformance.results import conformance

        session = self._session
        shown = str(session.settings.substrate) if session.subject.kind == "policy" else None
        return conformance(str(session.subject), self._results, session.rules, shown)

    @property
    def unknown(self) -> list[str]:
        """Ids that are expected to be broken and are no rule's."""
        return [id for id in self._session.expected if id not in self._session.rules]

    @pytest.hookimpl(trylast=True)
    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Show what is broken, and write the files."""
        from pytest_libero_max.conformance.lines import summary_lines

        if not self._results:
            return
        document = self.document
        terminalreporter.section("libero-max")
        for line in summary_lines(document):
            terminalreporter.line(line)
        for id in self.unknown:
            terminalreporter.line(
                f"WARNING: {id} is expected to be broken, but is no rule. "
                f"{did_you_mean(id, self._session.rules)}"
            )
        terminalreporter.line(f"Written: {', '.join(map(str, self._write(document)))}")

    def _write(self, document: Conformance) -> list[Path]:
        from pytest_libero_max.conformance.results import CONFORMANCE_NAME, conformance_json
        from pytest_libero_max.report.page.conformance_page import CONFORMANCE_PAGE_NAME, conformance_html
        from pytest_libero_max.report.writers.badge import CONFORMANCE_BADGE_NAME, conformance_badge_json
        from pytest_libero_max.report.writers.report_files import make_folder, write_text

        folder = self._session.settings.output
        make_folder(folder)
        files = {
            folder / CONFORMANCE_NAME: conformance_json(document),
            folder / CONFORMANCE_PAGE_NAME: conformance_html(document),
            folder / CONFORMANCE_BADGE_NAME: conformance_badge_json(document),
        }
        for path, text in files.items():
            write_text(path, text)
        return [*files]


def _result_in(report: pytest.TestReport) -> RuleResult | None:
    text = next((value for name, value in report.user_properties if name == _PROPERTY), None)
    if text is None:
        return None
    from pytest_libero_max.benchmark.structs import decode
    from pytest_libero_max.conformance.results import RuleResult

    return decode(str(text).encode(), RuleResult)
