"""What a policy behind restoration saw, in its films."""

from __future__ import annotations

from pathlib import Path

from msgspec import structs

from pytest_libero_max.films.policy_view import caption, shown_by
from pytest_libero_max.lab.wrappers.restoration import RestoringPolicy
from pytest_libero_max.worlds.robot import CAMERAS
from tests.films.conftest import short
from tests.films.short_run import play
from tests.films.test_policy_view import ADAPTER, _image, _ticks
from tests.pairing.actors import Approaching

__all__ = ["short"]  # a fixture


def test_restored_images_are_those_that_the_policy_was_shown(short: None, tmp_path: Path) -> None:
    policy = Approaching(horizon=5, interval=3, cameras=CAMERAS)
    played = play(tmp_path, policy=RestoringPolicy(policy, "always"), event="sensor_noise_onset")
    given = {(query.step, view.tobytes()) for query, view in zip(policy.queries, policy.views, strict=True)}
    for tick in _ticks(played, ADAPTER):
        if tick.step in (0, 3, 6):
            assert (tick.step, _image(tick, "dynamic").tobytes()) in given
    shown = shown_by(ADAPTER)
    assert "after restore=always" in caption(played.record, shown)
    other = structs.replace(played.record, policy={**played.record.policy, "wrappers": ["blur=2"]})
    assert "what blur=2 does" in caption(other, shown)
