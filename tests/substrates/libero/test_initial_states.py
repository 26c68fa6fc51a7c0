from __future__ import annotations

import io
import pickle
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.libero.initial_states import read_states
from pytest_libero_max.substrates.libero.tasks import states_file
from tests.substrates.libero.data import DATA, needs_data


def write_archive(path: Path, value: Any) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("archive/data.pkl", pickle.dumps(value, protocol=2))
        archive.writestr("archive/version", "3\n")
    return path


class Surprise:
    """Unpickling it would run a command."""

    def __init__(self, marker: Path) -> None:
        self.marker = marker

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self.marker,)


def test_an_array_comes_back(tmp_path: Path) -> None:
    states = np.random.default_rng(0).normal(size=(3, 7))
    assert np.array_equal(read_states(write_archive(tmp_path / "a.pruned_init", states)), states)


def test_a_single_state_is_one_row(tmp_path: Path) -> None:
    assert read_states(write_archive(tmp_path / "a.pruned_init", np.arange(4.0))).shape == (1, 4)


def test_npy_files_are_read_as_well(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.eye(2))
    assert np.array_equal(read_states(tmp_path / "a.npy"), np.eye(2))


def test_nothing_in_a_pickle_is_run(tmp_path: Path) -> None:
    marker = tmp_path / "surprise"
    path = write_archive(tmp_path / "a.pruned_init", Surprise(marker))
    with pytest.raises(SubstrateError, match="no array"):
        read_states(path)
    assert not marker.exists()


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (np.array([object()], dtype=object), "values of type 'O8'"),
        (np.array([1, 2]), "values of type 'i8'"),
        (np.array([np.nan]), "finite numbers"),
        (np.zeros((2, 2, 2)), r"shape \(2, 2, 2\)"),
        ({"states": 1}, "finite numbers"),
    ],
)
def test_anything_but_an_array_of_numbers_is_refused(tmp_path: Path, value: Any, message: str) -> None:
    path = write_archive(tmp_path / "a.pruned_init", value)
    with pytest.raises(SubstrateError, match=message):
        read_states(path)


def test_objects_in_a_npy_file_are_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.array([{}], dtype=object), allow_pickle=True)
    with pytest.raises(SubstrateError, match="initial states"):
        read_states(tmp_path / "a.npy")


def test_other_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.pruned_init").write_bytes(b"text")
    with pytest.raises(SubstrateError, match="initial states"):
        read_states(tmp_path / "a.pruned_init")
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("other", "")
    (tmp_path / "b.pruned_init").write_bytes(buffer.getvalue())
    with pytest.raises(SubstrateError, match="0 pickles"):
        read_states(tmp_path / "b.pruned_init")
    with pytest.raises(SubstrateError, match="Cannot read"):
        read_states(tmp_path / "missing.pruned_init")


@needs_data
def test_every_file_of_the_package_gives_the_array_that_torch_would() -> None:
    paths = sorted((DATA / "init_files").rglob("*.pruned_init"))
    assert len(paths) == 40
    for path in paths:
        states = read_states(path)
        assert np.array_equal(states, np.load(path.with_suffix(".npy"), allow_pickle=False)), path.name
        assert not states[:, 0].any()


def test_numpys_own_archives_are_read_without_unpickling(tmp_path: Path) -> None:
    states = np.random.default_rng(0).normal(size=(3, 7))
    np.savez(tmp_path / "a.pruned_init.npz", states=states)
    assert np.array_equal(read_states(tmp_path / "a.pruned_init.npz"), states)
    assert states_file(tmp_path / "a.pruned_init") == tmp_path / "a.pruned_init.npz"
    marker = tmp_path / "ran"
    np.savez(tmp_path / "b.pruned_init.npz", states=np.array([Surprise(marker)], dtype=object))
    with pytest.raises(SubstrateError, match="initial states"):
        read_states(tmp_path / "b.pruned_init.npz")
    assert not marker.exists()
    np.savez(tmp_path / "c.pruned_init.npz", other=states)
    with pytest.raises(SubstrateError, match="initial states"):
        read_states(tmp_path / "c.pruned_init.npz")
    (tmp_path / "a.pruned_init").write_bytes(b"")
    assert states_file(tmp_path / "a.pruned_init") == tmp_path / "a.pruned_init"


@pytest.mark.parametrize(
    "content",
    [
        b"r\xff\xff\xff\x7f.",  # a place in the memo that takes gigabytes
        b"\x80\x02K\x01K\x02R.",
        b"(0.",
        b"\x8d" + b"\xff" * 8,
    ],
)
def test_a_damaged_pickle_is_refused_whatever_it_says(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.pruned_init"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("archive/data.pkl", b"N" + content if content[:1] == b"r" else content)
    with pytest.raises(SubstrateError, match=r"initial states|holds"):
        read_states(path)
    archived = path.read_bytes()
    path.write_bytes(archived[:36] + b"\xff\xff" + archived[38:])
    with pytest.raises(SubstrateError, match=r"initial states|holds"):
        read_states(path)
