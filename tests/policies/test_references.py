from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.policies import references
from pytest_libero_max.policies.loading import check_reference, load_policy
from pytest_libero_max.policies.references import GROUP, parse_reference, shipped_names

Offer = Callable[..., None]

OWN = "class Own:\n    spec = None\npolicy = Own"


@pytest.fixture
def offer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Offer:
    """Install a package that offers policies by name."""

    def offer(package: str, *points: str) -> None:
        info = tmp_path / "site" / f"{package}-1.0.dist-info"
        info.mkdir(parents=True)
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text("\n".join([f"[{GROUP}]", *points]))
        (info.parent / f"{package}.py").write_text(OWN)
        monkeypatch.syspath_prepend(info.parent)
        monkeypatch.setattr(references, "POLICIES", references.registry())

    return offer


@pytest.mark.parametrize("name", shipped_names())
def test_built_in_policies_are_loaded_by_name_from_an_empty_folder(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    check_reference(name)
    assert load_policy(name).spec.name.replace("-", "_") == name.replace("-", "_")


def test_a_built_in_name_wins_over_a_file_and_a_module_which_are_named_otherwise(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "expert.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    assert parse_reference("expert").target == "pytest_libero_max.experts.expert"
    assert parse_reference("expert.py").target == "expert.py"
    assert parse_reference("./expert.py").target == "./expert.py"
    assert parse_reference("expert:policy").target == "expert"
    assert parse_reference("random:policy").target == "random"


@pytest.mark.parametrize(("text", "meant"), [("exper", "expert"), ("stale-expert", None), ("noob", "noop")])
def test_a_misspelt_name_is_told_the_closest(text: str, meant: str | None) -> None:
    with pytest.raises(AdapterError) as caught:
        check_reference(text)
    if meant is not None:
        assert f"Did you mean {meant!r}?" in str(caught.value)
        assert all(name in str(caught.value) for name in (*shipped_names(), f"{text}.py"))


def test_a_package_offers_a_policy_by_name(offer: Offer) -> None:
    offer("my_vla", "my-vla = my_vla:Own")
    reference = parse_reference("my-vla")
    assert (reference.target, reference.name) == ("my_vla", "Own")
    assert "my_vla" not in sys.modules
    with pytest.raises(AdapterError, match=r"my_vla:Own\.spec=None.* PolicySpec"):
        load_policy("my-vla")
    with pytest.raises(AdapterError, match=r"mean 'my-vla'\? Known: expert, .*my-vla, noop"):
        check_reference("my_vl")


@pytest.mark.parametrize("taken", ["expert", "other"])
def test_a_name_that_is_offered_twice_is_an_error(taken: str, offer: Offer) -> None:
    offer("one_package", "other = one_package:Own")
    offer("two_package", f"{taken} = two_package:Own")
    with pytest.raises(AdapterError, match=f"'{taken}' is offered twice.*two_package"):
        parse_reference("noop")


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("{d}/robot", ("'{d}/robot' is a folder", "FILE.py")),
        ("{d}/robot/", ("'{d}/robot' is",)),
        ("{d}/adapter", ("'{d}/adapter.py'?", "FILE.py")),
        ("{d}/adapter:Own", ("'{d}/adapter.py:Own'?",)),
        ("{d}/robot.py", ("'{d}/robot.py' is a folder",)),
    ],
)
def test_folders_and_missing_endings_are_explained(text: str, named: tuple[str, ...], tmp_path: Path) -> None:
    (tmp_path / "robot").mkdir()
    (tmp_path / "robot.py").mkdir()
    (tmp_path / "adapter.py").write_text(OWN)
    for check in (check_reference, load_policy):
        with pytest.raises(AdapterError) as caught:
            check(text.format(d=tmp_path))
        assert all(part.format(d=tmp_path) in str(caught.value) for part in (f"policy={text!r}", *named))


def test_a_folder_beside_the_adapter_that_is_no_package_is_not_taken_for_a_module(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "my_robot").mkdir()
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(AdapterError, match=r"'my_robot' .*__init__\.py"):
        check_reference("my_robot")


def test_a_file_that_cannot_be_read_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "adapter.py"
    path.write_text(OWN)

    def refuse(path: Path) -> bytes:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "read_bytes", refuse)
    with pytest.raises(AdapterError, match=r"read: .*Permission denied"):
        check_reference(str(path))
