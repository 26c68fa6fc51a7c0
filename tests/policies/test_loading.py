from __future__ import annotations

import os
import random
import subprocess
import sys
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.policies.contract import PolicySpec
from pytest_libero_max.policies.loading import check_reference, forget_adapter, load_policy

Writer = Callable[..., Path]

SOUND = """
from pytest_libero_max.policies.contract import PolicySpec

class Sound:
    spec = PolicySpec("sound", horizon=8, query_interval=4)

    def reset(self, episode):
        pass

    def predict(self, observation, query):
        return [[0.0] * 7] * self.spec.horizon
"""


@pytest.fixture
def write(tmp_path: Path) -> Writer:
    """Write a file below the test's folder and return its path."""

    def write(text: str, name: str = "adapter.py") -> Path:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(textwrap.dedent(text))
        return path

    return write


@pytest.fixture(autouse=True)
def _imports_are_left_alone() -> Any:
    forget_adapter()  # of a test elsewhere
    path, modules = list(sys.path), set(sys.modules)
    yield
    forget_adapter()
    assert sys.path == path
    assert not [
        name
        for name in set(sys.modules) - modules
        if getattr(sys.modules[name], "__file__", None) and "pytest-of" in str(sys.modules[name].__file__)
    ]


# What can be loaded.


@pytest.mark.parametrize(
    ("line", "name"),
    [
        ("policy = Sound()", ""),
        ("policy = Sound", ""),
        ("def policy(): return Sound()", ""),
        ("def make(seed=0): return Sound()", ":make"),
        ("", ":Sound"),
    ],
    ids=["instance", "class", "function", "named function", "named class"],
)
def test_a_policy_may_be_given_in_several_ways(write: Writer, line: str, name: str) -> None:
    path = write(SOUND + line)
    policy = load_policy(f"{path}{name}")
    assert type(policy).__name__ == "Sound"
    assert policy.spec == PolicySpec("sound", horizon=8, query_interval=4)


def test_a_module_is_loaded_by_its_dotted_name(write: Writer, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(SOUND + "policy = Sound()\nother = Sound()", "some_robot/policies.py")
    monkeypatch.syspath_prepend(path.parent.parent)
    assert load_policy("some_robot.policies").spec.name == "sound"
    assert load_policy("some_robot.policies:other").spec.name == "sound"
    del sys.modules["some_robot.policies"], sys.modules["some_robot"]


def test_horizon_and_interval_can_be_overridden_and_the_adapter_follows(write: Writer) -> None:
    path = write(SOUND + "policy = Sound()")
    for horizon, interval, expected in (
        (20, None, (20, 4)),
        (None, 1, (8, 1)),
        (2, 2, (2, 2)),
        (None, None, (8, 4)),
    ):
        policy = load_policy(str(path), horizon=horizon, query_interval=interval)
        assert (policy.spec.horizon, policy.spec.query_interval) == expected
        assert len(policy.predict({}, None)) == expected[0]  # type: ignore[arg-type]


def test_every_load_of_a_file_is_a_new_policy(write: Writer) -> None:
    path = write(SOUND + "policy = Sound()")
    first, second = load_policy(str(path)), load_policy(str(path))
    assert first is not second
    assert type(first) is not type(second)


def test_a_relative_path_is_relative_to_the_working_directory(
    write: Writer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(write(SOUND + "policy = Sound()").parent)
    assert load_policy("adapter.py").spec.name == "sound"
    assert load_policy("./adapter.py:policy").spec.name == "sound"


# Helpers beside the adapter, and names that collide.


def test_an_adapter_may_import_what_lies_beside_it(write: Writer) -> None:
    write(SOUND, "skills.py")
    write("from skills import Sound\n", "nested/inner.py")
    path = write(
        """
        from dataclasses import dataclass
        from nested.inner import Sound

        @dataclass
        class Later(Sound):
            speed: "float" = 1.0

            def __post_init__(self):
                import skills
                self.skills = skills

        policy = Later
        """
    )
    policy: Any = load_policy(str(path))
    assert policy.skills.Sound is type(policy).__mro__[1]


def test_two_adapters_may_each_have_a_helper_of_the_same_name(write: Writer) -> None:
    paths = []
    for folder in ("one", "two"):
        write(f"NAME = {folder!r}", f"{folder}/skills.py")
        paths.append(
            write(SOUND + "import skills\nSound.skill = skills.NAME\npolicy = Sound", f"{folder}/adapter.py")
        )
    assert [load_policy(str(path)).skill for path in paths] == ["one", "two"]  # type: ignore[attr-defined]


def test_a_helper_is_forgotten_also_where_another_of_its_name_can_be_imported(write: Writer) -> None:
    write("NAME = 'importable'", "importable/skills.py")
    write("NAME = 'own'", "own/skills.py")
    text = SOUND + "import skills\nSound.skill = skills.NAME\npolicy = Sound"
    first, second = write(text, "own/adapter.py"), write(text, "other/adapter.py")
    assert load_policy(str(first)).skill == "own"  # type: ignore[attr-defined]
    sys.path.insert(0, str(first.parents[1] / "importable"))
    try:
        assert load_policy(str(second)).skill == "importable"  # type: ignore[attr-defined]
    finally:
        del sys.path[0], sys.modules["skills"]


def test_an_adapter_called_random_hides_nothing(write: Writer) -> None:
    path = write("import random, json\n" + SOUND + "Sound.module = random\npolicy = Sound", "random.py")
    write("raise AssertionError('not the real one')", "json.py")
    policy: Any = load_policy(str(path))
    assert policy.module is random
    # And in a process in which nobody has imported the real one yet.
    script = (
        "import sys\nfrom pytest_libero_max.policies.loading import load_policy\n"
        "for name in ('random', 'json'): sys.modules.pop(name, None)\n"
        f"print(load_policy({str(path)!r}).module.Random)"
    )
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=root, capture_output=True, text=True, timeout=120
    )
    assert done.stdout == "<class 'random.Random'>\n", done.stderr


def test_what_an_adapter_imports_from_elsewhere_stays_imported(
    write: Writer, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A checkout that holds the adapter and an importable package alike.
    folder = write("", "some_package/__init__.py").parent.parent
    path = write("import some_package\n" + SOUND + "policy = Sound")
    monkeypatch.syspath_prepend(folder)
    load_policy(str(path))
    assert "some_package" in sys.modules
    del sys.modules["some_package"]


LAZY = (
    SOUND
    + """
class Lazy(Sound):
    def predict(self, observation, query):
        import skills
        return skills.actions()

policy = Lazy
"""
)


def test_an_adapter_that_imports_what_answers_for_every_name_is_told_its_own_error(write: Writer) -> None:
    # As torch.classes: a module without a path, whose __getattr__ never says no.
    path = write(
        """
        import sys
        import types

        class Always(types.ModuleType):
            def __getattr__(self, name):
                return object()

        sys.modules["always"] = Always("always")
        import not_installed
        """
    )
    try:
        with pytest.raises(AdapterError, match="No module named 'not_installed'"):
            load_policy(str(path))
    finally:
        sys.modules.pop("always", None)


def test_a_helper_may_be_imported_within_predict(write: Writer) -> None:
    write("def actions():\n    return [[0.5] * 7] * 4", "skills.py")
    policy = load_policy(str(write(LAZY)))
    for _ in range(2):
        assert policy.predict({}, None)[3][6] == 0.5  # type: ignore[arg-type]


def test_an_adapter_may_spawn_processes(write: Writer, tmp_path: Path) -> None:
    write("def double(x):\n    return 2 * x", "skills.py")
    path = write(
        SOUND
        + """
import multiprocessing

def work(x):
    import skills
    return skills.double(x)

class Spawns(Sound):
    def predict(self, observation, query):
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            return pool.map(work, [1, 2])

policy = Spawns
""",
        "spawning_adapter.py",
    )
    script = (
        "from pytest_libero_max.policies.loading import load_policy\n"
        "if __name__ == '__main__':\n"
        f"    print(load_policy({str(path)!r}).predict({{}}, None))\n"
    )
    main = write(script, "elsewhere/main.py")
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, str(main)],
        cwd=root,
        env={**os.environ, "PYTHONPATH": str(root)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.stdout == "[2, 4]\n", done.stderr


def test_an_optional_import_that_fails_part_way_is_the_adapters_own_business(write: Writer) -> None:
    # heavy.part stays in sys.modules when heavy itself does not.
    write("import heavy.part\nimport no_such_thing", "heavy/__init__.py")
    write("", "heavy/part.py")
    path = write("try:\n    import heavy\nexcept ImportError:\n    heavy = None\n" + SOUND + "policy = Sound")
    assert load_policy(str(path)).spec.name == "sound"


def test_an_import_that_fails_part_way_shows_its_own_error(write: Writer) -> None:
    write("import heavy.part\nimport no_such_thing", "heavy/__init__.py")
    write("", "heavy/part.py")
    with pytest.raises(AdapterError, match=r"^adapter\.py, line 1: ModuleNotFoundError .* 'no_such_thing'\."):
        load_policy(str(write("import heavy")))


def test_a_package_beside_the_adapter_with_its_name_is_imported(write: Writer) -> None:
    write("WHAT = 'package'", "robot/__init__.py")
    path = write(SOUND + "import robot\nSound.what = robot.WHAT\npolicy = Sound", "robot.py")
    assert load_policy(str(path)).what == "package"  # type: ignore[attr-defined]


# What cannot be loaded: text, reference, and what the message must name. {p} is the adapter's path.

BROKEN: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "address": ("", "http://localhost:8000", ("policy='http://localhost:8000'", "profile")),
    "websocket": ("", "ws://localhost", ("policy='ws://localhost'", "openpi://")),
    "missing file": ("policy = 1", "{d}/adaptor.py", ("no file '{d}/adaptor.py'", "'{d}/adapter.py'")),
    "missing folder": ("", "{d}/no/a.py", ("no folder '{d}/no'",)),
    "not a name": ("", "{p}:my-policy", ("'my-policy'", "FILE.py")),
    "not a file": ("", "{d}/adapter.txt", ("'{d}/adapter.txt'", "FILE.py")),
    "missing module": ("", "no_such.policies", ("no module 'no_such'", "PYTHONPATH", "no_such/policies.py")),
    "missing name": ("class Sound: pass\nPolcy = Sound()", "{p}", ("'policy'", "'Polcy'?", "Sound")),
    "empty": ("", "{p}:other", ("{p}:other", "no public name")),
    "broken import": (
        "import json\nimport no_such_thing",
        "{p}",
        ("adapter.py, line 2: ModuleNotFoundError", "'no_such_thing'", "`python adapter.py`"),
    ),
    "broken syntax": ("\n\ndef policy(:\n", "{p}", ("adapter.py, line 3: SyntaxError",)),
    "broken code": ("def f():\n    return 1 / 0\nf()", "{p}", ("adapter.py, line 2: ZeroDivisionError",)),
    "exit": ("raise SystemExit(3)", "{p}", ("adapter.py, line 1: SystemExit", ": 3.")),
    "arguments": (SOUND + "def policy(path): pass", "{p}", ("{p}:policy", "argument: 'path'")),
    "broken factory": (
        "def policy():\n    raise OSError('no weights')",
        "{p}",
        ("adapter.py, line 2: OSError", "{p}:policy(): no weights"),
    ),
    "nothing made": ("def policy(): pass", "{p}", ("{p}:policy (NoneType)", "'spec'", "PolicySpec")),
    "a number": ("policy = 3", "{p}", ("{p}:policy (int)", "'spec'")),
    "Q > H": (
        "from pytest_libero_max.policies.contract import PolicySpec\nPolicySpec('x', 2, 3)",
        "{p}",
        ("adapter.py, line 2: AdapterError", "query_interval=3 > horizon=2"),
    ),
}
EXECUTED = (
    *("missing module", "broken import", "broken code", "exit", "arguments", "broken factory"),
    *("nothing made", "a number", "Q > H"),
)
"""Those of them that show only when the adapter is executed."""


def require_named(act: Callable[[str], object], path: Path, reference: str, named: tuple[str, ...]) -> None:
    places = {"p": str(path), "d": str(path.parent)}
    with pytest.raises(AdapterError) as caught:
        act(reference.format(**places))
    assert not [part for part in named if part.format(**places) not in str(caught.value)], caught.value


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_adapter_is_told_what_is_wrong(write: Writer, name: str) -> None:
    text, reference, named = BROKEN[name]
    require_named(load_policy, write(text), reference, named)


# What can be found out without executing anything.


@pytest.mark.parametrize(
    ("text", "reference"),
    [
        (SOUND + "policy = Sound()\nraise AssertionError('executed')", "{p}"),
        ("def make(): pass", "{p}:make"),
        ("class Make: pass", "{p}:Make"),
        ("from somewhere import policy", "{p}"),
        ("import somewhere.far as policy", "{p}"),
        ("from somewhere import *", "{p}"),
        ("try:\n    policy, other = 1, 2\nexcept OSError:\n    policy = 3", "{p}"),
        ("if True:\n    policy: object = 1", "{p}:policy"),
        ("", "pytest_libero_max.no_such:thing"),
        ("", "expert"),
    ],
)
def test_a_reference_that_may_be_right_passes(write: Writer, text: str, reference: str) -> None:
    check_reference(reference.format(p=write(text)))


@pytest.mark.parametrize("name", [name for name in BROKEN if name not in EXECUTED])
def test_a_reference_is_checked_without_executing_it(write: Writer, name: str) -> None:
    text, reference, named = BROKEN[name]
    path = write(text + "\nraise AssertionError('executed')" if "def policy(:" not in text else text)
    require_named(check_reference, path, reference, named)


def test_the_adapters_own_error_is_chained(write: Writer) -> None:
    with pytest.raises(AdapterError) as caught:
        load_policy(str(write("raise OverflowError('too big')")))
    assert isinstance(caught.value.__cause__, OverflowError)


def test_a_module_that_fails_to_import_says_so_and_not_that_it_is_missing(
    write: Writer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(write("import no_such_thing", "half_there.py").parent)
    with pytest.raises(AdapterError, match=r"^half_there\.py, line 1: ModuleNotFoundError"):
        load_policy("half_there")


@pytest.mark.parametrize(
    ("override", "named"),
    [
        ({"horizon": 3}, ("query_interval=4", "horizon=3", "--libero-max-query-interval")),
        ({"query_interval": 9}, ("query_interval=9", "horizon=8", "--libero-max-horizon")),
        ({"horizon": 0, "query_interval": 0}, ("horizon=0", "at least 1")),
    ],
    ids=["H below Q", "Q above H", "zero"],
)
def test_overrides_that_contradict_are_refused(write: Writer, override: Any, named: tuple[str, ...]) -> None:
    with pytest.raises(AdapterError) as caught:
        load_policy(str(write(SOUND + "policy = Sound")), **override)
    assert all(part in str(caught.value) for part in ("'sound'", *named))


def test_a_spec_that_cannot_be_assigned_is_told_about_the_flags(write: Writer) -> None:
    path = write(
        SOUND
        + "class Fixed(Sound):\n    spec = property(lambda self: PolicySpec('fixed', 8, 4))\npolicy = Fixed"
    )
    assert load_policy(str(path)).spec.name == "fixed"
    with pytest.raises(AdapterError, match=r"'fixed'.*plain attribute"):
        load_policy(str(path), horizon=20)
