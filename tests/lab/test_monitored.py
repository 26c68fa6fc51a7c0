"""Monitors over recorded pairs give the scores that they gave while the pairs were played."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from pytest_libero_max.cli import main
from pytest_libero_max.errors import ReportError
from pytest_libero_max.films.recorded import open_recorded
from pytest_libero_max.lab.monitored import scored
from pytest_libero_max.lab.probes.monitors import ActionSpread, ChunkChange, ImageChange
from pytest_libero_max.pairing.probes.monitor import Monitor
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.policies.contract import Query
from pytest_libero_max.worlds.contract import Observation
from tests.films.short_run import Played, leave_out_shadows, play, shorten_episodes, store
from tests.pairing.actors import Approaching


class Wavering(Approaching):
    """Turns back and forth from the first action of each answer on."""

    def predict(self, observation: Observation, query: Query) -> Any:
        actions = np.array(super().predict(observation, query))
        actions[::2, 0] *= -0.5
        return actions


MONITORS: tuple[Monitor[Any], ...] = (ActionSpread(), ChunkChange(), ImageChange())
NAMES = tuple(monitor.name for monitor in MONITORS)


@pytest.fixture(scope="module", params=["positions", "actions"])
def watched(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A run whose pair was played with the monitors; drawn from positions, or from actions executed again."""
    with pytest.MonkeyPatch.context() as patch:
        leave_out_shadows(patch)
        shorten_episodes(patch)
        folder = tmp_path_factory.mktemp("watched")
        policy = Wavering(horizon=5, interval=3)
        kept = request.param == "positions"
        played = play(folder, policy=policy, films=kept, probes=NAMES, event="camera_shift")
        yield played, store(played, folder / "run", folder / "tiny.json")


def without(record: PairRecord) -> PairRecord:
    return replace(record, arms={name: replace(arm, probes={}) for name, arm in record.arms.items()})


def test_scores_are_those_of_the_played_pair(watched: tuple[Played, Path]) -> None:
    played, folder = watched
    with open_recorded(folder, str(folder.parent / "tiny.json")) as run:
        again = scored(run, without(played.record), MONITORS)
    assert played.record.arms["dynamic"].probes["image_change"]["score"][-1] > 0
    for monitor in NAMES:
        assert max(played.record.arms["base"].probes[monitor]["score"]) > 0
    for name, arm in played.record.arms.items():
        for monitor in NAMES:
            before, after = arm.probes[monitor], again.arms[name].probes[monitor]
            assert after["step"] == before["step"]
            # Positions are kept in single precision, so that a pixel may be another one.
            exact = monitor != "image_change" or played.traces[name].joints is None
            assert after["score"] == (before["score"] if exact else pytest.approx(before["score"], abs=0.02))


def test_monitors_of_answers_need_no_world(
    watched: tuple[Played, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    played, folder = watched
    with open_recorded(folder, str(folder.parent / "tiny.json")) as run:
        monkeypatch.setattr(type(run), "again", lambda *_: pytest.fail("a world was built"))
        again = scored(run, without(played.record), MONITORS[:2])
    assert {*again.arms["base"].probes} == {"action_spread", "chunk_change"}


def test_the_tables_are_printed_and_say_what_is_looked_at(
    watched: tuple[Played, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    cases = f"--cases={watched[1].parent / 'tiny.json'}"
    assert main(["lab", "monitors", str(watched[1]), "chunk_change", "image_change", cases]) == 0
    told = capsys.readouterr().out
    assert "Monitor chunk_change\nName " in told
    assert told.count("recorded answers alone") == 1
    assert "images of agentview, drawn again" in told
    assert "a threshold needs 9 pairs" in told
    assert "action_spread" not in told
    assert main(["lab", "monitors", str(watched[1]), "motion", cases]) == 1
    assert "'motion' is a probe that gives no scores, and no monitor." in capsys.readouterr().err


def test_a_trace_without_answers_is_refused_with_the_cure(tmp_path: Path) -> None:
    played = play(tmp_path, policy=Approaching(horizon=5, interval=3))
    folder = store(played, tmp_path / "run", tmp_path / "tiny.json")
    (path,) = (folder / "traces").iterdir()
    with np.load(path) as arrays:
        kept = {name: arrays[name] for name in arrays.files if not name.endswith("_answers")}
    np.savez_compressed(path, allow_pickle=False, **kept)
    with (
        open_recorded(folder, str(folder.parent / "tiny.json")) as run,
        pytest.raises(ReportError, match=r"early version and has no answers.*--libero-max-traces=all"),
    ):
        scored(run, played.record, MONITORS)
