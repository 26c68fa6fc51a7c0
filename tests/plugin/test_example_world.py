"""A package with another benchmark plays pairs, with report, film, gate and profile; ours never names it."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pytest_libero_max
from pytest_libero_max.policies.clients.messages import Reply, Request
from pytest_libero_max.policies.contract import Episode, PolicySpec, Query
from pytest_libero_max.policies.profile import load_profile
from pytest_libero_max.worlds.robot import ROBOTS
from tests.plugin.conftest import TINY_TASK, tiny_manifest
from tests.plugin.strangers import install

Results = Callable[[], tuple[list[dict[str, Any]], dict[str, Any]]]

PACKAGE = Path(__file__).with_name("example_world")

ADAPTER = """
import numpy as np
from pytest_libero_max.policies.contract import PolicySpec


class Reacher:
    spec = PolicySpec(
        "reacher", horizon=8, query_interval=4, cameras=("overview",), image_size=16, robot="{robot}"
    )

    def reset(self, episode):
        self.noop = episode.robot.noop

    def predict(self, observation, query):
        assert observation["overview_image"].shape == (16, 16, 3)
        action = np.array(self.noop)
        action[:3] = np.clip((np.array([0.1, -0.1, 0.5]) - observation["palm_eef_pos"]) / 0.05, -1, 1)
        return np.tile(action, (8, 1))


policy = Reacher
"""

PROFILE = """
[policy]
name = "floating"
protocol = "http-json"
horizon = 8
query_interval = 4
robot = "floater"

[inputs.picture]
from = "overview_image"

[inputs.place]
from = "palm_eef_pos"

[request]
image = "$picture"
state = "$place"

[reply]
at = ["actions"]
"""


@pytest.fixture
def installed(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> pytest.Pytester:
    """A folder with the package installed and a manifest of its suites."""
    install(pytester, monkeypatch, PACKAGE)
    task = replace(TINY_TASK, camera="overview")
    manifest = tiny_manifest(suites=("boxes_four", "boxes_six"), task=task)
    pytester.path.joinpath("boxes.json").write_text(json.dumps(manifest))
    return pytester


RUN = (
    "-p",
    "no:cacheprovider",
    "--libero-max-policy=adapter.py",
    "--libero-max-manifest=boxes.json",
    "--libero-max-substrate=boxes",
)


def check_records(lines: list[dict[str, Any]], suite: str, robot: str, components: int) -> None:
    for record in (line for line in lines if line["line"] == "pair"):
        assert record["suite"] == suite
        assert record["item_id"].startswith(f"boxes-{suite.removeprefix('boxes_')}-t00")
        assert (record["max_steps"], record["policy"]["robot"]) == (14, robot)
        assert record["arms"]["dynamic"]["firings"]
        for arm in record["arms"].values():
            assert (arm["components"], arm["control_hz"]) == (components, 10)


def test_all_events_are_played_with_four_components_and_gated(
    installed: pytest.Pytester, results: Results
) -> None:
    installed.makepyfile(adapter=ADAPTER.format(robot="floater"))
    done = installed.runpytest_subprocess(
        *RUN,
        "--libero-max-suites=boxes_four",
        "--libero-max-probe=motion",
        "--libero-max-gate=dynamic_sr <= 99%",
    )
    done.assert_outcomes(passed=16)
    done.stdout.fnmatch_lines(["gate pass *dynamic_sr*"])
    lines, report = results()
    assert report["provenance"]["substrate"]["name"] == "boxes"
    check_records(lines, "boxes_four", "floater", 4)


def test_a_pair_is_filmed_with_six_components(installed: pytest.Pytester, results: Results) -> None:
    installed.makepyfile(adapter=ADAPTER.format(robot="turner"))
    done = installed.runpytest_subprocess(
        *RUN,
        "-m",
        "boxes_six",
        "-k",
        "target_relocation and v1",
        "--libero-max-film=all",
        "--libero-max-latency=200ms",
    )
    done.assert_outcomes(passed=1, deselected=31)
    lines = results()[0]
    check_records(lines, "boxes_six", "turner", 6)
    assert {arm["latency"] for line in lines if line["line"] == "pair" for arm in line["arms"].values()} == {
        "2steps"
    }
    assert len([*Path(installed.path, "libero-max-results", "films").iterdir()]) == 1


def test_it_keeps_the_rules_of_substrates(installed: pytest.Pytester) -> None:
    done = installed.runpytest_subprocess(
        "-p", "no:cacheprovider", "--libero-max-conform=substrate:boxes", "-k", "not process"
    )
    outcomes = done.parseoutcomes()
    assert "failed" not in outcomes
    assert outcomes["passed"] >= 18


def test_a_substrate_of_other_suites_refuses_it(installed: pytest.Pytester) -> None:
    installed.makepyfile(adapter=ADAPTER.format(robot="floater"))
    done = installed.runpytest_subprocess(
        "-p", "no:cacheprovider", "--libero-max-policy=noop", "--libero-max-manifest=boxes.json"
    )
    done.stderr.fnmatch_lines(["*embedded has no suite boxes_four, but libero_spatial*"])
    assert done.ret == pytest.ExitCode.USAGE_ERROR


def test_a_policy_for_another_robot_is_refused(installed: pytest.Pytester) -> None:
    installed.makepyfile(adapter=ADAPTER.format(robot="turner"))
    done = installed.runpytest_subprocess(*RUN, "-m", "boxes_four and camera_shift")
    done.stdout.fnmatch_lines(["*robot='turner'*'floater'*"])
    assert done.ret != 0


def test_a_profile_reads_its_keys_and_brings_its_actions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(PACKAGE))
    from boxes_world import FLOATER, NumpyWorld  # type: ignore[import-not-found]

    monkeypatch.setattr(ROBOTS, "_loaded", {**ROBOTS._loaded, "floater": FLOATER})
    monkeypatch.setattr(ROBOTS, "_loaders", {**ROBOTS._known(), "floater": lambda: FLOATER})
    path = tmp_path / "floating.toml"
    path.write_text(PROFILE)
    profile = load_profile(str(path))
    request = Request(profile)
    assert request.cameras == ("overview",)
    observation = NumpyWorld(FLOATER).observe(request.cameras, 16)
    built = request.build(observation, Query(0, 0, "put it there", 1), Episode("boxes_four", 0, "", 1, 14))
    assert built["image"].shape == (16, 16, 3)
    assert built["state"].shape == (3,)
    assert Reply(profile).read({"actions": np.zeros((8, 4)).tolist()}, 4, 8).shape == (8, 4)
    assert PolicySpec("it", robot="floater").components == 4


def test_no_file_of_the_package_names_it() -> None:
    folder = Path(pytest_libero_max.__file__).parent
    words = re.compile(r"boxes_(four|six|world)|\bfloater\b|\bturner\b")
    naming = [file for file in folder.rglob("*.py") if words.search(file.read_text(encoding="utf-8"))]
    assert naming == []
