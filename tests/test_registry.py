from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from pytest_libero_max.errors import ChangeError
from pytest_libero_max.registry import Registry, modules_in

GROUP = "pytest_libero_max.words"
Install = Callable[..., None]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Install:
    """Puts a distribution with entry points and one module on the path."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def put(name: str, *points: str, module: str = "") -> None:
        info = tmp_path / f"{name}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text("\n".join([f"[{GROUP}]", *points]))
        (tmp_path / f"{name}.py").write_text(module)

    return put


def accept_word(name: str, found: object) -> str:
    if not isinstance(found, str):
        raise ValueError(f"{name} is {found!r}, but must be a text")
    return found


def registry(own: Iterable[str] = ("second", "first")) -> Registry[str]:
    def loader(name: str) -> Callable[[], str]:
        return lambda: f"our {name}"

    return Registry("word", GROUP, lambda: {name: loader(name) for name in own}, accept_word, ChangeError)


def test_own_entries_keep_their_order_and_others_follow_by_name(install: Install) -> None:
    install(
        "their_words", "zeta = their_words:zeta", "alpha = their_words:alpha", module="alpha = zeta = 'x'"
    )
    words = registry()
    assert list(words) == ["second", "first", "alpha", "zeta"]
    assert len(words) == 4
    assert "alpha" in words
    assert "beta" not in words
    assert dict(words.items()) == {"second": "our second", "first": "our first", "alpha": "x", "zeta": "x"}
    assert list(words.values()) == ["our second", "our first", "x", "x"]


def test_names_are_known_before_anything_is_imported(install: Install) -> None:
    install("broken_words", "alpha = broken_words:alpha", module="raise RuntimeError('at import')")
    words = registry()
    assert "alpha" in words
    message = (
        r"The word 'alpha' of broken_words cannot be used: broken_words:alpha \(RuntimeError: at import\)\. "
        "Repair the package or uninstall it"
    )
    with pytest.raises(ChangeError, match=message):
        words["alpha"]
    assert words["first"] == "our first"


def test_an_unknown_name_suggests_the_closest() -> None:
    with pytest.raises(ChangeError, match=r"word='frist' .*'first'\?"):
        registry()["frist"]


def test_an_entry_that_breaks_the_rule_says_which(install: Install) -> None:
    install("odd_words", "alpha = odd_words:alpha", module="alpha = 3")
    with pytest.raises(ChangeError, match="3, but must be a"):
        registry()["alpha"]


def test_a_name_is_offered_once(install: Install) -> None:
    install("their_words", "first = their_words:word", module="word = 'x'")
    with pytest.raises(
        ChangeError,
        match="pytest-libero-max and by their_words",
    ):
        list(registry())


def test_two_packages_cannot_offer_the_same_name(install: Install) -> None:
    for name in ("one_package", "other_package"):
        install(name, f"alpha = {name}:word", module="word = 'x'")
    with pytest.raises(ChangeError, match=r"by .*_package and by .*_package"):
        list(registry())


def test_an_entry_is_loaded_once() -> None:
    loaded: list[str] = []

    def load() -> str:
        loaded.append("x")
        return "x"

    words = Registry("word", GROUP, lambda: {"alpha": load}, accept_word, ChangeError)
    assert words["alpha"] == words["alpha"] == "x"
    assert loaded == ["x"]


def test_the_modules_of_a_folder_are_found_without_importing_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "some_folder"
    folder.mkdir()
    (folder / "__init__.py").write_text("")
    (folder / "b.py").write_text("raise RuntimeError")
    (folder / "a.py").write_text("")
    monkeypatch.syspath_prepend(str(tmp_path))
    assert modules_in("some_folder") == ("a", "b")
    assert modules_in("no_such_folder") == ()


def test_an_entry_may_be_read_without_importing_it(install: Install) -> None:
    install("broken_words", "alpha = broken_words:alpha", module="raise RuntimeError('at import')")
    words = Registry("word", GROUP, dict, accept_word, ChangeError, lambda point: point.value)
    assert words["alpha"] == "broken_words:alpha"
