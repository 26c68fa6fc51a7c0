from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from pytest_libero_max.cli import main
from pytest_libero_max.films import encoding, recorded
from pytest_libero_max.runs.store import read_pairs
from pytest_libero_max.worlds.contract import Image
from tests.films.short_run import leave_out_shadows

Run = Callable[..., pytest.RunResult]

# An in-process run forgets what it imported, and PyAV and NumPy cannot be imported twice.
IMPORTED_ONCE = (encoding, recorded)
with suppress(ImportError):
    import av  # noqa: F401

PAIR = "target_relocation and v0"


@pytest.fixture(autouse=True)
def fast(monkeypatch: pytest.MonkeyPatch) -> None:
    leave_out_shadows(monkeypatch)
    monkeypatch.setattr(recorded.film_pair, "__defaults__", (recorded.Drawn(size=32, every=9), None))


def _folder(pytester: pytest.Pytester) -> Path:
    return pytester.path / "libero-max-results"


def test_measured_pairs_are_filmed_and_the_report_links_the_films(
    run: Run, pytester: pytest.Pytester
) -> None:
    result = run("-k", "target_relocation", "--libero-max-film=all")
    assert result.ret == 0
    films = sorted(path.name for path in (_folder(pytester) / "films").iterdir())
    assert len(films) == 2
    page = (_folder(pytester) / "report.html").read_text()
    assert all(f"href='films/{film}'" in page for film in films)
    filmed = [record.identity() for record in read_pairs(_folder(pytester)).records]
    run("-k", "target_relocation")
    assert [record.identity() for record in read_pairs(_folder(pytester)).records] == filmed
    assert sorted(path.name for path in (_folder(pytester) / "films.1").iterdir()) == films
    assert "href='films/" not in (_folder(pytester) / "report.html").read_text()


def test_a_film_made_later_from_the_traces_is_the_same(run: Run, pytester: pytest.Pytester) -> None:
    run("-k", PAIR, "--libero-max-film=all", "--libero-max-traces=all").assert_outcomes(passed=1)
    folder = _folder(pytester)
    later = ["--select=all", "--size=32", "--every=9", f"--output={pytester.path / 'later'}"]
    later.append(f"--cases={pytester.path / 'tiny.json'}")
    assert main(["film", str(folder), *later]) == 0
    (one,), (other,) = (folder / "films").iterdir(), (pytester.path / "later").iterdir()
    assert one.name == other.name
    assert one.read_bytes() == other.read_bytes()


@pytest.mark.parametrize("which", ["none", "regressions", "changed"])
def test_a_pair_that_is_not_asked_for_is_not_filmed(run: Run, pytester: pytest.Pytester, which: str) -> None:
    run("-k", PAIR, f"--libero-max-film={which}").assert_outcomes(passed=1)
    assert not (_folder(pytester) / "films").exists()


def test_films_are_made_at_the_end_up_to_a_limit(run: Run, pytester: pytest.Pytester) -> None:
    result = run("-k", "target_relocation", "--libero-max-film=all:1")
    assert len(list((_folder(pytester) / "films").iterdir())) == 1
    (line,) = [line for line in result.outlines if line.startswith("Filmed: ")]
    assert line.startswith("Filmed: 1 of 2 all (")
    assert line.endswith("; for all of them: libero-max film libero-max-results --select=all")


@pytest.mark.parametrize("how", [("-n", "1"), ("--libero-max-isolate",)])
def test_films_are_made_where_other_processes_played_the_pairs(
    run: Run, pytester: pytest.Pytester, how: tuple[str, ...]
) -> None:
    result = run("-k", PAIR, "--libero-max-film=all", *how, subprocess=True)
    assert result.ret == 0
    result.stdout.fnmatch_lines(["Filmed: 1 of 1 all (* s)"])
    assert len(list((_folder(pytester) / "films").iterdir())) == 1


def test_a_film_that_cannot_be_made_costs_no_pair(
    run: Run, pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*arguments: object) -> Image:
        raise RuntimeError("no memory for pictures")

    monkeypatch.setattr("pytest_libero_max.films.recorded.film_frames", broken)
    result = run("-k", PAIR, "--libero-max-film=all")
    assert result.ret == 0
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines(
        ["Beside the pairs, which are measured: no film of *: RuntimeError: no memory for pictures*"]
    )
    assert len(read_pairs(_folder(pytester)).records) == 1
