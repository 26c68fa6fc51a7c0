from __future__ import annotations

import copy
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from pytest_libero_max.cli import main
from pytest_libero_max.lab import fingerprint
from pytest_libero_max.lab.fingerprint import LAYERS, comparison_lines, fingerprint_lines
from pytest_libero_max.substrates.tiny.world import TinyWorld
from pytest_libero_max.worlds.rendering.context import RENDERER, VERSION
from tests.pairing.actors import make_case

MESA = "4.5 (Compatibility Profile) Mesa 22.3.6-1+deb12u2"


class Tiny:
    """A substrate with one world."""

    name = "tiny"

    def __init__(self) -> None:
        self.opened = TinyWorld()

    def world(self, case: Any) -> TinyWorld:
        return self.opened

    def fingerprint(self, images: bool = False) -> dict[str, str]:
        return {"mujoco": "3.3.7", **({RENDERER: "llvmpipe", VERSION: MESA} if images else {})}

    def close(self) -> None:
        self.opened.close()


Taken = dict[str, Any]


def take(alter: Callable[[TinyWorld], None] = lambda world: None) -> Taken:
    """The fingerprint of an installation with one world, of two cases."""
    substrate = Tiny()
    alter(substrate.opened)
    cases = [make_case("target_relocation"), make_case("camera_shift")]
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(fingerprint, "_cases", lambda: iter(cases))
        found = fingerprint.take(substrate)
    substrate.close()
    return found


@pytest.fixture(scope="module")
def first() -> Taken:
    return take()


def differing(first: Taken, second: Taken) -> dict[str, str]:
    """What is said of the layers that differ."""
    lines = comparison_lines(first, second)[1:-1]
    assert [line.split()[0] for line in lines] == list(LAYERS)
    return {line.split()[0]: line for line in lines if not line.endswith(" equal")}


def test_an_installation_has_one_hash_and_layers_are_told_apart(
    first: Taken, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert set(first["layers"]) == set(LAYERS)
    again = take()
    assert again["hash"] == first["hash"]
    assert comparison_lines(first, again)[0] == f"{first['hash']} equals {again['hash']}"
    assert not differing(first, again)
    assert fingerprint_lines(first)[0] == f"tiny {first['hash']}"
    assert f"gl_renderer llvmpipe, gl_version {MESA}; " in fingerprint_lines(first)[2]

    drawn = TinyWorld._drawn
    monkeypatch.setattr(TinyWorld, "_drawn", lambda *given: np.minimum(drawn(*given), 254) + 1)
    brighter = take()
    monkeypatch.undo()
    assert brighter["hash"] != first["hash"]


def test_another_renderer_and_other_physics_are_told_apart(
    first: Taken, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn = TinyWorld._drawn
    with monkeypatch.context() as other:
        other.setattr(TinyWorld, "_drawn", lambda *given: (drawn(*given) // 2).astype(np.uint8))
        found = differing(first, take())
    assert set(found) == {"drawing", "event_pictures"}
    assert " 2 of 2 " in found["drawing"]
    assert "grey levels" in found["drawing"]

    def lighter(world: TinyWorld) -> None:
        world.model.opt.gravity[2] = -1.0

    with monkeypatch.context() as other:  # a pair is not played in a world whose gravity was written
        other.setattr(fingerprint, "_queries", lambda *given: {"digest": "", "values": []})
        found = differing(first, take(lighter))
    assert "physics" in found
    assert {"drawing", "control", "events", "textures", "inputs"}.isdisjoint(found)


def test_another_resizing_is_told_apart_by_profile(first: Taken, monkeypatch: pytest.MonkeyPatch) -> None:
    resized = cv2.resize

    def rounded(*given: Any, **named: Any) -> Any:
        return resized(*given, **named) & 254

    monkeypatch.setattr(cv2, "resize", rounded)
    found = differing(first, take())
    assert set(found) == {"inputs"}
    assert f" of {len(first['inputs'])} profiles (" in found["inputs"]
    assert "largest difference" in found["inputs"]


def test_another_cadence_of_queries_is_told_apart(first: Taken, monkeypatch: pytest.MonkeyPatch) -> None:
    (queries,) = first["queries"].values()
    assert queries["values"][:4] == [0.0, 7.0, 14.0, 21.0]
    asked = fingerprint._Asked.__init__

    def late(self: Any) -> None:
        asked(self)
        self.spec = replace(self.spec, query_interval=8)

    monkeypatch.setattr(fingerprint._Asked, "__init__", late)
    assert set(differing(first, take())) == {"queries"}


def test_the_numbers_say_by_how_much(first: Taken) -> None:
    second = copy.deepcopy(first)
    name = next(iter(second["cases"]))
    layer = second["cases"][name]["replay"]
    layer["values"][5] += 0.25
    layer["digest"] = second["hash"] = "other"
    second["versions"]["mujoco"] = "3.4.0"
    assert differing(first, second) == {
        "replay": "  replay          differs in 1 of 2 cases: largest difference 0.25 m"
    }
    assert comparison_lines(first, second)[-1].endswith("mujoco 3.3.7 / 3.4.0")


def test_files_are_compared_and_others_are_refused(
    first: Taken, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, text in (
        ("a.json", json.dumps(first)),
        ("b.json", json.dumps({**first, "hash": "other"})),
        ("c.json", json.dumps({**first, "substrate": "libero"})),
        ("d.json", "{}"),
    ):
        (tmp_path / name).write_text(text)
    a, b, c, d = (str(tmp_path / name) for name in ("a.json", "b.json", "c.json", "d.json"))
    assert main(["lab", "fingerprint", "--compare", a, a]) == 0
    assert "equals" in capsys.readouterr().out
    assert main(["lab", "fingerprint", "--compare", a, b]) == 1
    assert "differs from other" in capsys.readouterr().out
    assert main(["lab", "fingerprint", "--compare", a, c]) == 1
    assert "same substrate" in capsys.readouterr().err
    assert main(["lab", "fingerprint", "--compare", a, d]) == 1
    assert "format 2" in capsys.readouterr().err
