from __future__ import annotations

from pathlib import Path

import pytest

from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.runs import kept_fingerprint
from pytest_libero_max.runs.kept_fingerprint import keep, kept
from tests.report.made_up import PROVENANCE, plan, records_of

SUBSTRATE = {"name": "embedded"}


@pytest.fixture(autouse=True)
def of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def test_what_was_kept_is_found_by_the_same_installation_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    assert kept(SUBSTRATE) is None
    keep(SUBSTRATE, "bc025597906d")
    assert kept(SUBSTRATE) == "bc025597906d"
    assert kept({"name": "libero"}) is None
    with monkeypatch.context() as other:
        other.setenv("GALLIUM_DRIVER", "softpipe")
        assert kept(SUBSTRATE) is None
    with monkeypatch.context() as other:
        other.setattr(kept_fingerprint, "package_versions", lambda: {"mujoco": "3.9.0"})
        assert kept(SUBSTRATE) is None
    with monkeypatch.context() as other:
        other.setattr(kept_fingerprint, "_code", lambda: "another")
        assert kept(SUBSTRATE) is None
    assert kept(SUBSTRATE) == "bc025597906d"


def test_without_a_place_to_write_to_nothing_is_kept(tmp_path: Path) -> None:
    (tmp_path / "cache").write_text("a file")
    keep(SUBSTRATE, "bc025597906d")
    assert kept(SUBSTRATE) is None


def test_reports_print_it_or_say_how_it_is_taken() -> None:
    pairs = plan()
    for found, said in (
        ("bc025597906d", "| fingerprint | bc025597906d |"),
        (None, "not taken before the run"),
    ):
        report = build_report(records_of(pairs), [], pairs, {**PROVENANCE, "fingerprint": found})
        assert said in markdown(report)
    old = build_report(records_of(pairs), [], pairs, PROVENANCE)
    assert "fingerprint" not in markdown(old)
