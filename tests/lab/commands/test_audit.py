from __future__ import annotations

import json
from pathlib import Path

import pytest

from pytest_libero_max.cli import main
from tests.plugin.conftest import tiny_manifest

LOOKING = """
import numpy as np
from pytest_libero_max import PolicySpec


class Looking:
    spec = PolicySpec("looking", horizon=8, query_interval=8, cameras=("agentview",), image_size=64)

    def reset(self, episode):
        pass

    def predict(self, observation, query):
        return np.full((8, 7), 0.1 * observation["agentview_image"].any())


policy = Looking
"""


def test_a_policy_is_audited_on_one_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "looking.py").write_text(LOOKING)
    manifest = tiny_manifest(events=("camera_shift",))
    manifest["cases"] = manifest["cases"][:1]
    (tmp_path / "cases.json").write_text(json.dumps(manifest))
    monkeypatch.chdir(tmp_path)
    arguments = ["lab", "audit", "--jobs", "1", "--limit", "1", "--output", "audited", "looking.py", "--"]
    arguments += ["--libero-max-substrate=tiny", "--libero-max-manifest=cases.json", "-pno:cacheprovider"]
    assert main(arguments) == 0
    page = (tmp_path / "audited" / "audit.md").read_text()
    assert page.startswith("# Audit: what looking needs\n\n1 case; H=8, Q=8; cameras: agentview.\n")
    assert "- Nothing is known, because Base never succeeds: all images black (0/1); " in page
    for arm in ("black_images", "still_images", "no_state", "no_instruction"):
        assert f"| {arm} | " in page.replace("\\", "")
    assert "Written: audited/audit.md" in capfd.readouterr().out


def test_a_run_that_fails_gives_its_exit_status(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["lab", "audit", "missing.py", "--jobs", "1"]) == 4
    assert not (tmp_path / "libero-max-audit" / "audit.md").exists()
