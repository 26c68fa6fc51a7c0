from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec import structs

from pytest_libero_max.cli import main
from pytest_libero_max.errors import AdapterError, ReportError
from pytest_libero_max.films.policy_view import fitted, policy_look, shown_by
from pytest_libero_max.films.replay import Tick, play_again
from pytest_libero_max.policies.adapter_digest import adapter_digest
from pytest_libero_max.policies.profile import load_profile
from pytest_libero_max.worlds.contract import Image
from pytest_libero_max.worlds.robot import CAMERAS
from tests.pairing.actors import Approaching

from .short_run import BUDGET, SIZE, Played, leave_out_shadows, play, shorten_episodes, store

ADAPTER = {"reference": "adapter.py", "code": None}
MODULE = """
import numpy as np
from pytest_libero_max import PolicySpec

class Dark:
    spec = PolicySpec("dark")

    def reset(self, episode):
        self.episode = episode

    def predict(self, observation, query):
        return np.zeros((1, 7))

    def model_inputs(self, observation, query):
        assert self.episode.instruction == query.instruction
        return {"image": observation["agentview_image"][::-1, ::-1] // 2, "state": np.zeros(8)}

policy = Dark
"""


@pytest.fixture(scope="module")
def seen_once(tmp_path_factory: pytest.TempPathFactory) -> tuple[Played, Approaching, Path]:
    folder, policy = tmp_path_factory.mktemp("seen"), Approaching(horizon=5, interval=3, cameras=CAMERAS)
    with pytest.MonkeyPatch.context() as patch:
        leave_out_shadows(patch)
        shorten_episodes(patch)
        return play(folder, policy=policy, event="sensor_noise_onset"), policy, folder / "tiny.json"


@pytest.fixture
def seeing(seen_once: tuple[Played, Approaching, Path], tmp_path: Path) -> tuple[Played, Approaching]:
    played, policy, manifest = seen_once
    shutil.copy(manifest, tmp_path)
    return played, policy


def _ticks(played: Played, ran: dict[str, Any], every: int = 1, **options: str) -> list[Tick]:
    shown = shown_by(ran, **options)
    look, also = policy_look(played.case, played.record, played.traces, shown, SIZE)
    return list(play_again(played.case, played.world, played.record, played.traces, look, every, also))


def _image(tick: Tick, arm: str) -> Image:
    return next(iter(tick.views[arm].images.values()))


def test_every_image_is_the_one_that_the_policy_was_given(seeing: tuple[Played, Approaching]) -> None:
    played, policy = seeing
    given = {(query.step, view.tobytes()) for query, view in zip(policy.queries, policy.views, strict=True)}
    event, answer = played.record.trigger_step, played.record.response_step
    assert (event, answer) == (4, 6)
    shown = set()
    for tick in _ticks(played, ADAPTER):
        for view in tick.views.values():
            assert list(view.images) == [f"{camera} {SIZE}x{SIZE}" for camera in CAMERAS]
        query = tick.step - tick.step % 3 if tick.step < BUDGET else 6
        shown |= {(query, _image(tick, arm).tobytes()) for arm in ("base", "dynamic")}
        assert tick.views["dynamic"].words == (f"query {query // 3} at step {query}",)
        same = np.array_equal(_image(tick, "base"), _image(tick, "dynamic"))
        assert same == (tick.step < 6), "the policy first sees the noise at its next query"
    assert shown == given


def test_queries_between_the_frames_are_seen(seeing: tuple[Played, Approaching]) -> None:
    every = _ticks(seeing[0], ADAPTER)
    for tick in _ticks(seeing[0], ADAPTER, every=4):
        for arm in ("base", "dynamic"):
            assert np.array_equal(_image(tick, arm), _image(every[tick.step], arm))


def test_a_profile_tells_what_the_server_is_sent(seeing: tuple[Played, Approaching], tmp_path: Path) -> None:
    played, policy = seeing
    profile = load_profile("pi05_libero")
    ran = {"reference": "openpi://gpu:8000", "code": profile.digest}
    tick = _ticks(played, ran)[0]
    assert list(tick.views["base"].images) == ["image 224x224", "wrist 224x224"]
    small = fitted(np.kron(policy.views[0][::-1, ::-1], np.ones((7, 7, 1), dtype=np.uint8)), SIZE)
    assert np.abs(_image(tick, "base").astype(int) - small).mean() < 12  # resized by the profile's own rule
    assert "profile pi05_libero sends" in shown_by(ran).words
    assert shown_by(ran, profile="pi05_libero").words == shown_by(ran).words
    assert "--profile" in shown_by({**ran, "code": "0" * 64}).words
    served = {**ran, "code": load_profile("served").digest}
    assert "unchanged" in shown_by(served).words
    with pytest.raises(AdapterError, match="not what the run"):
        shown_by(ran, profile="served")
    own = tmp_path / "own.toml"
    own.write_text('extends = "pi05_libero"\n[policy]\nname = "mine"\n')
    mine = {**ran, "code": load_profile(str(own)).digest, "profile": str(own)}
    assert "--profile" in shown_by(mine).words  # a file that results name is not opened
    assert "profile own sends" in shown_by(mine, profile=str(own)).words
    own.write_text('extends = "pi05_libero"\n[policy]\nname = "other"\n')
    with pytest.raises(AdapterError, match="not what the run"):
        shown_by(mine, profile=str(own))
    with pytest.raises(AdapterError, match="no server"):
        shown_by(ADAPTER, profile="served")


def test_an_adapter_tells_what_its_model_is_handed(
    seeing: tuple[Played, Approaching], tmp_path: Path
) -> None:
    played, policy = seeing
    adapter = tmp_path / "dark.py"
    adapter.write_text(MODULE)
    ran = {"reference": "dark.py", "code": adapter_digest(str(adapter))}
    ticks = _ticks(played, ran, adapter=str(adapter))
    assert np.array_equal(_image(ticks[0], "base"), policy.views[0][::-1, ::-1] // 2)
    with pytest.raises(AdapterError, match="not what the run"):
        shown_by({**ran, "code": "0" * 64}, adapter=str(adapter))
    adapter.write_text(MODULE.replace("def model_inputs", "def inputs"))
    with pytest.raises(AdapterError, match="has no model_inputs"):
        _ticks(played, {**ran, "code": None}, adapter=str(adapter))


def test_an_image_keeps_its_proportions_in_its_picture() -> None:
    wide = np.full((10, 20, 3), 255, dtype=np.uint8)
    picture = fitted(wide, 40)
    assert picture.shape == (40, 40, 3)
    assert (picture[10:30] == 255).all()
    assert (picture[:10] != 255).all()
    assert fitted(picture, 8).shape == (8, 8, 3)


def test_a_policy_that_asks_for_no_images_saw_nothing(played: Played) -> None:
    with pytest.raises(ReportError, match="no images"):
        _ticks(played, ADAPTER)


def test_what_was_seen_is_filmed_beside_the_film_of_the_pair(
    seeing: tuple[Played, Approaching], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    played = seeing[0]
    run = store(played, tmp_path / "run", tmp_path / "tiny.json")
    cases = f"--cases={tmp_path / 'tiny.json'}"
    film = ["film", str(run), "--select=all", f"--size={SIZE}", "--format=webp", cases]
    assert main([*film, "--view=policy"]) == 0
    assert main(film) == 0
    item = played.record.item_id
    assert sorted(path.name for path in (run / "films").iterdir()) == [
        f"{item}--base-dynamic--policy.webp",
        f"{item}--base-dynamic.webp",
    ]
    assert main([*film, "--adapter=expert"]) == 1
    assert "--view=policy" in capsys.readouterr().err


def test_an_instruction_that_has_changed_is_said(
    seeing: tuple[Played, Approaching], monkeypatch: pytest.MonkeyPatch
) -> None:
    played, _ = seeing
    other = replace(played, case=replace(played.case, instruction="put it away"))
    monkeypatch.setattr(type(other.case), "digest", played.record.case_digest)
    assert _ticks(other, ADAPTER)[0].views["base"].words == ("query 0 at step 0", "put it away")


def test_wide_images_are_shown_as_the_policy_got_them(short: None, tmp_path: Path) -> None:
    policy = Approaching(horizon=5, interval=3, cameras=("agentview",))
    policy.spec = replace(policy.spec, image_size=(24, SIZE))
    played = play(tmp_path, policy=policy)
    ticks = _ticks(played, ADAPTER)
    assert {name for tick in ticks for view in tick.views.values() for name in view.images} == {
        f"agentview {SIZE}x24"
    }
    shown = next(iter(ticks[0].views["base"].images.values()))
    assert np.array_equal(shown[4:28], policy.views[0][::-1]) or np.array_equal(shown[4:28], policy.views[0])


def test_a_policy_that_was_shown_every_step_is_followed_step_by_step(
    seeing: tuple[Played, Approaching],
) -> None:
    played, _ = seeing
    ran = {"reference": "openpi://gpu:8000", "code": load_profile("mimic_video").digest}
    assert "every step as profile mimic_video" in shown_by(ran).words
    ticks = _ticks(played, ran)
    assert [tick.views["base"].words[0] for tick in ticks[:5]] == [
        "query 0 at step 0",
        "step 1",
        "step 2",
        "query 1 at step 3",
        "step 4",
    ]
    assert not np.array_equal(_image(ticks[1], "base"), _image(ticks[2], "base"))
    frames = structs.replace(played.record, policy=played.record.policy | {"memory": "frames"})
    delivered = _ticks(replace(played, pair=replace(played.pair, record=frames)), ADAPTER)
    assert delivered[1].views["base"].words == ("step 1",)
