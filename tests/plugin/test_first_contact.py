"""What meets a user on the first day: a policy that cannot be played, a wrong name, an interruption."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest

from pytest_libero_max.evaluation.player import BROKEN_POLICY
from pytest_libero_max.worlds.rendering import gl
from pytest_libero_max.worlds.rendering.context import RENDERING
from tests.plugin.conftest import REACHER

Run = Callable[..., pytest.RunResult]
Results = Callable[..., tuple[list[dict[str, Any]], dict[str, Any]]]

WITHOUT_WEIGHTS = (
    "import os\nif 'NO_WEIGHTS' in os.environ:\n    raise OSError('no weights here')\n" + REACHER
)


def test_a_policy_that_cannot_be_constructed_stops_the_run_after_one_error(
    run: Run, results: Results, pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NO_WEIGHTS", "1")
    pytester.makepyfile(broken=WITHOUT_WEIGHTS)
    result = run(policy="broken.py")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(
        ["AdapterError: broken.py, line 3: OSError while importing it: no weights here.*",
         "INCOMPLETE: 0 of 16 planned pairs played, 1 invalid, 15 missing. No score. "
         "Stopped: the policy cannot be played.",
         "Exit status 11: the run is incomplete (1 invalid, 15 missing)*"]
    )  # fmt: skip
    assert result.ret == 11
    pairs, report = results()
    assert [pair["line"] for pair in pairs] == ["error", "stopped"]
    assert (pairs[0]["phase"], pairs[1]["reason"]) == ("policy", BROKEN_POLICY)
    assert report["pairs"]["missing"] == 15


def test_on_two_workers_it_stops_as_well(
    run: Run, results: Results, pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NO_WEIGHTS", "1")
    pytester.makepyfile(broken=WITHOUT_WEIGHTS)
    result = run("-n", "2", policy="broken.py", subprocess=True)
    assert result.ret == 11
    pairs, _ = results()
    assert sum(pair["line"] == "error" for pair in pairs) <= 2
    errors, _, _ = str(result.stdout).partition("short test summary info")  # which quotes them whole under CI
    assert errors.count("Traceback") == 1
    result.stdout.fnmatch_lines(["*Exit status 11: the run is incomplete (* invalid, * missing)*"])


def test_a_policy_that_fails_in_every_pair_stops_the_run_and_is_shown_once(
    run: Run, results: Results, pytester: pytest.Pytester
) -> None:
    pytester.makepyfile(
        broken=REACHER.replace("def predict(", "def predict(self, *asked): return {}['image']\n\n    def _(")
    )
    result = run(policy="broken.py")
    result.assert_outcomes(errors=8)
    errors, _, _ = str(result.stdout).partition("short test summary info")  # which quotes them whole under CI
    assert errors.count("Traceback") == 1
    result.stdout.fnmatch_lines(
        ["*Stopped: 8 pairs ended in the same error of the policy, and none was measured."]
    )
    assert result.ret == 11
    report = results()[1]
    assert (report["pairs"]["invalid"], report["pairs"]["missing"]) == (8, 8)


def test_nothing_that_was_measured_before_is_lost(
    run: Run, results: Results, pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytester.makepyfile(broken=WITHOUT_WEIGHTS)
    assert run("-k", "camera_shift", policy="broken.py").ret == 0
    path = pytester.path / "libero-max-results" / "pairs.jsonl"
    header, first, _ = path.read_text().splitlines()
    path.write_text(f"{header}\n{first}\n")
    monkeypatch.setenv("NO_WEIGHTS", "1")
    assert run("-k", "camera_shift", "--libero-max-resume", policy="broken.py").ret == 11
    _, report = results()
    assert (report["pairs"]["played"], report["pairs"]["invalid"]) == (1, 1)
    monkeypatch.delenv("NO_WEIGHTS")
    assert run("-k", "camera_shift", "--libero-max-resume", policy="broken.py").ret == 0
    assert results()[1]["pairs"]["played"] == 2


def test_a_misspelt_camera_stops_the_run_before_the_first_pair(run: Run, pytester: pytest.Pytester) -> None:
    pytester.makepyfile(broken=REACHER.replace("cameras=()", "cameras=('agentvew',)"))
    result = run(policy="broken.py")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(
        ["AdapterError: camera='agentvew' of policy 'reacher' does not exist in scene tiny/*. Did you mean "
         "'agentview'? Known: *"]
    )  # fmt: skip
    assert result.ret == 11


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("glfw", "MUJOCO_GL='glfw' is no backend for offscreen images.*Unset it to have one chosen."),
        ("osmesa", "MUJOCO_GL='osmesa', but its libraries do not load here. Install the Debian packages "
         "`libosmesa6`, or unset MUJOCO_GL to have a backend chosen."),
    ],
)  # fmt: skip
def test_a_backend_that_cannot_draw_is_one_sentence_before_anything_starts(
    run: Run, pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, value: str, message: str
) -> None:
    monkeypatch.setenv("MUJOCO_GL", value)
    monkeypatch.setattr(gl, "_library", lambda *names: None)
    pytester.makeconftest(
        "from pytest_libero_max.worlds.rendering import gl\ngl._library = lambda *names: None\n"
    )
    result = run()
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines([f"ERROR: {message}"])
    assert not (pytester.path / "libero-max-results").exists()


def test_a_device_that_does_not_exist_is_one_sentence_before_anything_starts(
    run: Run, pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not gl.loads("egl"):
        pytest.skip("needs EGL: the Debian packages libegl1 libgl1-mesa-dri libopengl0")
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setenv("MUJOCO_EGL_DEVICE_ID", "99")
    result = run()
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["ERROR: MUJOCO_EGL_DEVICE_ID='99', but EGL's devices are *unset it*"])
    assert not (pytester.path / "libero-max-results").exists()


def test_actions_beyond_one_are_counted_and_warned_of_once(
    run: Run, results: Results, pytester: pytest.Pytester
) -> None:
    pytester.makepyfile(wild=REACHER.replace("np.tile(action, (8, 1))", "np.tile(action * 40, (8, 1))"))
    result = run("-k", "camera_shift", policy="wild.py")
    assert result.ret == 0
    assert str(result.stdout).count("Actions outside [-1, 1] in 2 of 2 pairs, up to ") == 1
    pairs, report = results()
    counts = [arm["clipped_components"] for pair in pairs for arm in pair["arms"].values()]
    assert min(counts) > 0
    assert report["clipped_actions"]["pairs"] == 2
    assert 0 < report["clipped_actions"]["largest_share"] <= 3 / 7
    for name in ("report.md", "report.html"):
        text = (pytester.path / "libero-max-results" / name).read_text()
        assert "outside [-1, 1] in 2 of 2" in text


def test_actions_within_one_are_not_warned_of(run: Run, results: Results) -> None:
    result = run("-k", "camera_shift")
    assert "Actions outside" not in str(result.stdout)
    assert results()[1]["clipped_actions"] == {"pairs": 0, "largest_share": 0.0}


def test_a_noise_floor_that_was_asked_for_and_not_measured_is_said(run: Run) -> None:
    pytest.importorskip("pytest_libero_max.lab.sections.sham")
    asked = "--libero-max-noise=floor:4"
    run(asked, "-k", "camera_shift or illumination_switch or visual_theme_switch").stdout.fnmatch_lines(
        ["*asked for on 4 pairs, and measured on [0-3].*"]
    )
    whole = run(asked)
    whole.stdout.fnmatch_lines(["Noise floor: Base played twice*/4*"])
    assert "asked for" not in str(whole.stdout)


def test_the_code_of_the_adapter_is_in_the_header_and_in_every_record(
    run: Run, pytester: pytest.Pytester
) -> None:
    assert run("-k", "camera_shift").ret == 0
    path = pytester.path / "libero-max-results" / "pairs.jsonl"
    header, *pairs = map(json.loads, path.read_text().splitlines())
    code = header["provenance"]["policy"]["code"]
    assert len(code) == 64
    assert [pair["fingerprints"]["adapter"] for pair in pairs] == [code, code]


def test_a_wrong_id_is_told_the_closest(run: Run) -> None:
    result = run("libero-max::test_pair[libero-spatial-t00-i00-camera_shft-v0]")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(
        ["ERROR: libero-max::test_pair[[]libero-spatial-t00-i00-camera_shft-v0] is not in manifest tiny.json."
         " Did you mean 'libero-spatial-t00-i00-camera_shift-v0'?*"]
    )  # fmt: skip
    assert len(str(result.stderr)) < 2000


def test_an_id_that_an_option_leaves_out_says_so(run: Run) -> None:
    name = "libero-spatial-t00-i00-camera_shift-v0"
    assert run(f"libero-max::test_pair[{name}]").ret == 0
    result = run(f"libero-max::test_pair[{name}]", "--libero-max-shard=2/2")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["ERROR: *is in manifest tiny.json, but not among the 8 pairs that *"])


def test_an_interrupted_run_says_how_to_go_on(run: Run, pytester: pytest.Pytester) -> None:
    text = REACHER.replace("    def reset(self, episode):\n        pass", INTERRUPTS)
    pytester.makepyfile(adapter=text)
    result = run("-k", "camera_shift", subprocess=True)
    assert result.ret == pytest.ExitCode.INTERRUPTED
    result.stdout.fnmatch_lines(
        ["Interrupted. Measured and kept: 1 of 2 pairs. Give the same command with --libero-max-resume to "
         "play the others."]
    )  # fmt: skip


INTERRUPTS = """
    def reset(self, episode):
        from pathlib import Path

        pairs = Path("libero-max-results", "pairs.jsonl")
        if pairs.exists() and len(pairs.read_text().splitlines()) > 1:  # the run, and a pair
            raise KeyboardInterrupt
"""


def test_each_pair_of_a_policy_that_sees_says_what_drew_its_images(
    run: Run, results: Results, pytester: pytest.Pytester
) -> None:
    pytester.makepyfile(sees=REACHER.replace("cameras=()", "cameras=('agentview',)"))
    assert run("-k", "camera_shift", policy="sees.py").ret == 0
    first, later = (pair["fingerprints"] for pair in results()[0])
    assert first["gl_renderer"]
    assert [later[name] for name in RENDERING] == [first[name] for name in RENDERING]
    shown = f"{first['gl_renderer']}, OpenGL {first['gl_version']}"
    assert shown in (pytester.path / "libero-max-results/report.html").read_text()
    assert run("-k", "camera_shift", "--libero-max-output=blind").ret == 0
    for pair in results("blind")[0]:
        assert {"gl_renderer", "gl_version"}.isdisjoint(pair["fingerprints"])
