from __future__ import annotations

import enum
import json
import xml.etree.ElementTree as ET

import execnet
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_libero_max.plugin.processes.sending import encodable, sendable
from tests.plugin.test_run import Results, Run

HALF = "/data/caf\udce9.ckpt"
"""A path whose name is no UTF-8, as ``os.fsdecode`` returns it."""

SPELLED = "/data/caf\\udce9.ckpt"


class Level(enum.IntEnum):
    HIGH = 3


class Word(str):
    __slots__ = ()


any_text = st.text(st.characters(codec=None))
values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.binary() | any_text | st.just(object()),
    lambda inner: st.lists(inner) | st.tuples(inner, inner) | st.dictionaries(any_text, inner),
)


@given(values)
def test_whatever_is_sent_can_be_sent_by_execnet_and_as_json(value: object) -> None:
    sent = sendable(value)
    execnet.dumps(sent)
    json.dumps(sent, default=repr).encode()


@given(st.dictionaries(st.text(), st.lists(st.integers(-(2**31)) | st.text() | st.none())))
def test_what_can_be_sent_stays_as_it_is(value: object) -> None:
    assert sendable(value) == value


def test_half_characters_are_spelled_and_foreign_types_are_text_or_their_base() -> None:
    assert encodable(HALF) == SPELLED
    assert sendable({HALF: [(HALF, b"\xe9")]}) == {SPELLED: [(SPELLED, b"\xe9")]}
    sent = sendable([np.float64(0.5), Level.HIGH, Word("a"), np.array([1])])
    assert sent == [0.5, 3, "a", "array([1])"]
    assert [type(one) for one in sent] == [float, int, str, str]


ADAPTER = """
import logging, os, sys, warnings
from adapter import Reacher
from pytest_libero_max import PolicySpec

HALF = os.fsdecode(b"/data/caf\\xe9.ckpt") + "\\x01\\x1b[31m"

class Half(Reacher):
    spec = PolicySpec(name="half", horizon=8, query_interval=4, cameras=(), image_size=64)

    def reset(self, episode):
        WHAT

policy = Half
"""

WHAT = {
    "log": "logging.getLogger('model').warning('loading %s', HALF)",
    "warning": "warnings.warn(HALF, stacklevel=1)",
    "output": "print(HALF.encode(errors='backslashreplace').decode()); os.write(1, b'caf\\xe9')",
    "error": "raise RuntimeError(HALF)",
    "chain": "raise RuntimeError(HALF) from OSError(HALF)",
    "exit": "sys.exit(HALF)",
    "death": "os.write(2, b'caf\\xe9\\n'); os._exit(3)",
}
MEASURED = ("log", "warning", "output")


@pytest.mark.parametrize(
    ("what", "workers"),
    [*((what, "-n2") for what in WHAT), ("log", "-n0"), ("chain", "-n0"), ("chain", "--libero-max-isolate")],
)
def test_text_that_is_no_utf8_costs_no_pair_and_no_report(
    run: Run,
    results: Results,
    pytester: pytest.Pytester,
    monkeypatch: pytest.MonkeyPatch,
    what: str,
    workers: str,
) -> None:
    monkeypatch.setenv(
        "PYTHONIOENCODING", "utf-8:backslashreplace"
    )  # pytester reads what is written as UTF-8
    pytester.makepyfile(half=ADAPTER.replace("WHAT", WHAT[what]))
    done = run(
        *(workers, "-rA", "--junitxml=junit.xml", "--libero-max-retries=0", "-k", "camera_shift"),
        policy="half.py",
        subprocess=True,
    )
    assert "INTERNALERROR" not in done.stdout.str() + done.stderr.str()
    lines, report = results()
    measured = what in MEASURED
    assert done.ret == (0 if measured else 11)
    assert [line["line"] for line in lines] == ["pair" if measured else "error"] * 2
    assert report["pairs"]["played" if measured else "invalid"] == 2
    assert len(ET.parse(pytester.path / "junit.xml").findall(".//testcase")) == 2
    for name in ("report.md", "report.html"):
        (pytester.path / "libero-max-results" / name).read_bytes().decode()


def test_a_run_whose_log_is_no_utf8_is_resumed(
    run: Run, results: Results, pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONIOENCODING", "utf-8:backslashreplace")
    pytester.makepyfile(half=ADAPTER.replace("WHAT", WHAT["log"]).replace('"half"', "HALF[:14]"))
    for more in ("--libero-max-stop=errors:1", "--libero-max-resume"):
        done = run("-n2", "-k", "camera_shift", more, policy="half.py", subprocess=True)
        assert done.ret == 0
    assert [line["line"] for line in results()[0]] == ["pair", "pair"]


def test_a_property_that_another_plugin_gives_a_pair_travels_as_text(
    run: Run, results: Results, pytester: pytest.Pytester
) -> None:
    pytester.makeconftest(
        """
        import numpy
        def pytest_collection_modifyitems(items):
            for item in items:
                gpu = {"memory": numpy.float32(1.5), "name": "caf\\udce9"}
                item.user_properties.append(("gpu", gpu))
        def pytest_sessionfinish(session):
            session.config.__dict__.get("workeroutput", {})["mine"] = object
        """
    )
    done = run("-n2", "-k", "camera_shift", "--junitxml=junit.xml", subprocess=True)
    assert done.ret == 0
    assert results()[1]["pairs"]["played"] == 2
    values = [one.get("value") or "" for one in ET.parse(pytester.path / "junit.xml").iterfind(".//property")]
    assert sum("caf" in value for value in values) == 2
