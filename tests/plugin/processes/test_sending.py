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
    "log": "logging.getLogger('model').warning('loading %s', HALF); warnings.warn(HALF, stacklevel=1)",
    "error": "raise RuntimeError(HALF)",
    "chain": "raise RuntimeError(HALF) from OSError(HALF)",
    "death": "os.write(2, b'caf\\xe9\\n'); os._exit(3)",
}


CONFTEST = """
import numpy

def pytest_collection_modifyitems(items):
    for item in items:
        item.user_properties.append(("gpu", {"memory": numpy.float32(1.5), "name": "caf\\udce9"}))

def pytest_sessionfinish(session):
    session.config.__dict__.get("workeroutput", {})["mine"] = object
"""


@pytest.mark.parametrize(
    ("what", "workers"), [("log", "-n2"), ("error", "-n2"), ("death", "-n1"), ("chain", "-n0")]
)
def test_text_that_is_no_utf8_costs_no_pair_and_no_report(
    run: Run,
    results: Results,
    pytester: pytest.Pytester,
    monkeypatch: pytest.MonkeyPatch,
    what: str,
    workers: str,
) -> None:
    monkeypatch.setenv("PYTHONIOENCODING", "utf-8:backslashreplace")  # pytester reads UTF-8
    pytester.makepyfile(half=ADAPTER.replace("WHAT", WHAT[what]))
    pytester.makeconftest(CONFTEST)
    done = run(
        *(workers, "-rA", "--junitxml=junit.xml", "--libero-max-retries=0", "-k", "camera_shift"),
        policy="half.py",
        subprocess=True,
    )
    assert "INTERNALERROR" not in done.stdout.str() + done.stderr.str()
    lines, report = results()
    measured = what == "log"
    assert done.ret == (0 if measured else 11)
    assert [line["line"] for line in lines] == ["pair" if measured else "error"] * 2
    assert report["pairs"]["played" if measured else "invalid"] == 2
    assert len(ET.parse(pytester.path / "junit.xml").findall(".//testcase")) == 2
    for name in ("report.md", "report.html"):
        (pytester.path / "libero-max-results" / name).read_bytes().decode()
