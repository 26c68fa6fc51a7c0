"""pytest --libero-max-conform: each rule is an item, whatever plays it."""

from __future__ import annotations

import json
from xml.etree import ElementTree

import pytest

from pytest_libero_max.conformance.registry import rules_for
from pytest_libero_max.conformance.results import read_conformance

ADAPTER = """
from tests.conformance.policies import ClosingFirst, Small, WideGripper


class Policy(Small, WideGripper):
    pass


policy, closing = Policy, ClosingFirst
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
    assert "policy:adapter.py does not conform" in text
    assert "breaks policy/gripper/units (must): Open the gripper with -1, close it with +1." in text
    assert "expected: -1 opens, +1 closes" in text
    assert "policy/images/turned is expected to be broken, but is no rule. Did you mean" in text
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
    assert "was examined in part: 1 kept of 2 rules that could be examined" in text
    assert f"{RULES - 2} of {RULES} rules were not run" in text
    assert "should policy/gripper/opens: closes at once, far from any object" in text
    document = read_conformance((pytester.path / "libero-max-results" / "conformance.json").read_text())
    assert (document.conforms, len(document.rules)) == (None, 2)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--libero-max-conform=adaptor.py"], "adaptor.py"),
        (["--libero-max-conform=substrate:embeded"], "embedded"),
        (["--libero-max-conform=policy:"], "expected a policy"),
        (["--libero-max-conform=env:package"], "names no factory"),
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
    assert 'reason = "trained on images' in result.stderr.str()
