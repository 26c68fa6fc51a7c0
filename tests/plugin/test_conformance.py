"""pytest --libero-max-conform: each rule is an item, whatever plays it."""

from __future__ import annotations

import json
import shlex
from xml.etree import ElementTree

import pytest

from pytest_libero_max.conformance.registry import rules_for
from pytest_libero_max.conformance.results import read_conformance
from pytest_libero_max.conformance.server import clients
from tests.conformance.test_server_rules import PROFILE, MixedUp

ADAPTER = """
from tests.conformance.policies import ClosingFirst, scaled

policy, closing = scaled("Policy", 0.05, 0.05, 255.0), ClosingFirst
"""
EXPECTED = """
["policy/actions/large"]
reason = "it moves slowly on purpose"
link = "https://example.org/1"

["policy/contract/answers"]
reason = "never seen"

["policy/images/turned"]
reason = "no such rule"
"""
RULES = len(rules_for("policy"))


@pytest.fixture
def adapter(pytester: pytest.Pytester) -> str:
    pytester.syspathinsert()
    pytester.makepyfile(adapter=ADAPTER)
    pytester.path.joinpath("expected.toml").write_text(EXPECTED)
    return "--libero-max-conform=adapter.py"


def test_each_rule_is_an_item_and_must_decides(pytester: pytest.Pytester, adapter: str) -> None:
    result = pytester.runpytest_inprocess(
        adapter,
        "--libero-max-substrate=tiny",
        "--libero-max-xfails=expected.toml",
        "--junitxml=junit.xml",
        "-rxX",
    )
    assert result.ret == 1
    result.assert_outcomes(passed=RULES - 4, skipped=1, failed=1, xfailed=1, xpassed=1)
    text = result.stdout.str()
    assert "policy:adapter.py" in text
    assert "-1, close it with +1." in text
    assert "expected: -1 opens, +1 closes" in text
    assert "policy/images/turned is expected" in text
    folder = pytester.path / "libero-max-results"
    document = read_conformance((folder / "conformance.json").read_text())
    assert (document.conforms, document.not_run, document.substrate) == (False, [], "tiny")
    states = {rule.id: rule.state for rule in document.rules}
    assert [id for id, state in states.items() if state == "broken"] == [
        "policy/actions/large",
        "policy/gripper/units",
    ]
    assert document.rules[[*states].index("policy/actions/large")].expected_to_break is not None
    assert "1 must broken" in json.loads((folder / "conformance-badge.json").read_text())["message"]
    suite = ElementTree.parse(pytester.path / "junit.xml").getroot()
    cases = [*suite.iter("testcase")]
    assert len(cases) == RULES
    (failed,) = (case.get("name") for case in cases if case.find("failure") is not None)
    assert failed == "policy/gripper/units"


def test_workers_examine_and_a_part_is_called_a_part(pytester: pytest.Pytester, adapter: str) -> None:
    result = pytester.runpytest_subprocess(
        f"{adapter}:closing", "--libero-max-substrate=tiny", "-n2", "-kgripper"
    )
    assert result.ret == 0
    text = result.stdout.str()
    assert "part: 1 kept of 2" in text
    assert f"{RULES - 2} of {RULES} rules were not" in text
    assert "should policy/gripper/opens: closes" in text
    document = read_conformance((pytester.path / "libero-max-results" / "conformance.json").read_text())
    assert (document.conforms, len(document.rules)) == (None, 2)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--libero-max-conform=adaptor.py"], "adaptor.py"),
        (["--libero-max-conform=substrate:embeded"], "embedded"),
        (["--libero-max-conform=policy:"], "expected a policy"),
        (["--libero-max-conform=env:package"], "names no function"),
        (["--libero-max-conform=env:json:loads:x"], "are not TOML"),
        (["--libero-max-conform=env:no_such_package.envs:make"], "no such module or file"),
        (["--libero-max-conform=env:nowhere.py:make"], "no such module or file"),
        (["--libero-max-conform=expert", "--libero-max-policy=expert"], "Give one of them"),
        (["--libero-max-conform=expert", "--libero-max-xfails=no.toml"], "cannot be read"),
    ],
)
def test_what_cannot_be_examined_is_a_usage_error(
    pytester: pytest.Pytester, arguments: list[str], message: str
) -> None:
    result = pytester.runpytest_inprocess(*arguments)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    assert message in result.stderr.str()


@pytest.mark.parametrize("text", ["rules = 3", '["a"]\nlink = "x"', '["a"]\nreason = "x"\nmore = "y"', "["])
def test_a_file_of_expected_breaks_says_what_it_may_hold(pytester: pytest.Pytester, text: str) -> None:
    pytester.path.joinpath("expected.toml").write_text(text)
    result = pytester.runpytest_inprocess("--libero-max-conform=expert", "--libero-max-xfails=expected.toml")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    assert 'reason = "trained on' in result.stderr.str()


def test_junit_has_one_failure_for_a_server_with_one_defect(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(clients, "PAUSE_S", 0.3)
    pytester.path.joinpath("repeating.toml").write_text(PROFILE)
    with MixedUp().serving() as port:
        result = pytester.runpytest_inprocess(
            f"--libero-max-conform=server:openpi://127.0.0.1:{port}?patience=0.3&timeout=5",
            "--libero-max-profile=repeating.toml",
            "--libero-max-substrate=tiny",
            "--junitxml=junit.xml",
        )
    assert result.ret == 1
    suite = ElementTree.parse(pytester.path / "junit.xml").getroot()
    cases = {case.get("name"): case for case in suite.iter("testcase")}
    assert len(cases) == len(rules_for("server"))
    (failed,) = (name for name, case in cases.items() if case.find("failure") is not None)
    assert failed == "server/clients/at-once"
    text = "".join(cases[failed].itertext())
    assert "observed: 4 clients that" in text
    assert "expected: the answer" in text
    assert "keep each answer" in text
    (command,) = (line.removeprefix("Again: pytest ") for line in text.splitlines() if "Again:" in line)
    again = pytester.runpytest_inprocess(*shlex.split(command), "--collect-only")
    assert "1/" in again.stdout.str()
