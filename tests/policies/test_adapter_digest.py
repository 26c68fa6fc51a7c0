from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.experts import noop
from pytest_libero_max.policies.adapter_digest import (
    adapter_digest,
    adapter_files,
    code_digest,
    shown_identity,
)
from pytest_libero_max.policies.references import parse_reference

Writer = Callable[[str, str], Path]


@pytest.fixture
def write(tmp_path: Path) -> Writer:
    def write(name: str, text: str) -> Path:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return path

    return write


def names(reference: str) -> list[str]:
    return [path.name for path in adapter_files(parse_reference(reference))]


def test_helpers_beside_the_adapter_count_wherever_they_are_imported(write: Writer) -> None:
    adapter = write("adapter.py", "import top\ndef policy():\n    from pack.late import late\n")
    write("top.py", "import json, numpy")
    write("pack/__init__.py", "")
    write("pack/late.py", "from . import sibling\nfrom .deep.er import x")
    write("pack/sibling.py", "from .. import nothing")
    write("pack/deep/er.py", "import top")
    write("unused.py", "")
    expected = ["__init__.py", "adapter.py", "er.py", "late.py", "sibling.py", "top.py"]
    assert sorted(names(str(adapter))) == expected


def test_a_change_of_a_helper_changes_the_digest_and_a_comment_does_not(write: Writer) -> None:
    adapter = write("adapter.py", "from skills import policy")
    write("skills.py", "policy = 1")
    digest = adapter_digest(str(adapter))
    write("skills.py", '"""Skills."""\npolicy = 1  # the one')
    assert adapter_digest(str(adapter)) == digest
    write("skills.py", "policy = 2")
    assert adapter_digest(str(adapter)) != digest


def test_the_same_code_in_another_folder_has_the_same_digest(write: Writer) -> None:
    for folder in ("here", "there"):
        write(f"{folder}/adapter.py", "import skills\npolicy = other = skills")
        path = write(f"{folder}/skills.py", "x = 1")
    here = path.parents[1] / "here" / "adapter.py"
    assert adapter_digest(str(here)) == adapter_digest(str(path.with_name("adapter.py")))
    assert adapter_digest(str(here)) != adapter_digest(f"{here}:other")


def test_what_an_import_would_find_elsewhere_first_is_no_helper(write: Writer) -> None:
    adapter = write("random.py", "import json, random\npolicy = 1")
    write("json.py", "raise AssertionError")
    assert names(str(adapter)) == ["random.py"]


def test_of_a_package_its_own_modules_count(write: Writer, monkeypatch: pytest.MonkeyPatch) -> None:
    root = write("some_robot/__init__.py", "").parent.parent
    write("some_robot/policies/__init__.py", "from some_robot import tools\nfrom .. import more")
    write("some_robot/policies/libero.py", "import beside")
    write("some_robot/tools.py", "")
    write("some_robot/more.py", "")
    write("beside.py", "")
    monkeypatch.syspath_prepend(root)
    assert sorted(names("some_robot.policies.libero")) == [
        "__init__.py",
        "__init__.py",
        "libero.py",
        "more.py",
        "tools.py",
    ]
    assert "some_robot" not in sys.modules


def test_a_module_by_itself_counts_with_what_lies_beside_it(
    write: Writer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(write("some_robot.py", "import beside").parent)
    write("beside.py", "")
    assert sorted(names("some_robot")) == ["beside.py", "some_robot.py"]


def test_a_policy_that_ships_with_the_package_has_a_version() -> None:
    assert adapter_digest("noop") == adapter_digest("pytest_libero_max.experts.noop") == "noop version 1"
    assert adapter_digest("pytest_libero_max.experts.expert:ExpertPolicy") == "expert:ExpertPolicy version 1"
    assert adapter_digest(noop.__file__) == code_digest_of("policy", Path(noop.__file__))
    assert len(adapter_digest("pytest_libero_max.experts.motion")) == 64


def code_digest_of(name: str, *paths: Path) -> str:
    return hashlib.sha256(f"{name}|{code_digest(paths)}".encode()).hexdigest()


def test_a_version_is_shown_in_full_and_a_digest_by_its_beginning(write: Writer) -> None:
    assert shown_identity(adapter_digest("stale_expert")) == "stale_expert version 1"
    digest = adapter_digest(str(write("adapter.py", "policy = 1")))
    assert shown_identity(digest) == digest[:12]


def test_the_digest_of_a_name_does_not_depend_on_the_working_directory(
    write: Writer, monkeypatch: pytest.MonkeyPatch
) -> None:
    digest = adapter_digest("expert")
    monkeypatch.chdir(write("expert.py", "policy = None").parent)
    assert adapter_digest("expert") == digest
    assert adapter_digest("expert.py") != digest


def test_what_leads_nowhere_or_cannot_be_read_is_an_error(
    write: Writer, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(AdapterError, match="no file"):
        adapter_digest("no_such.py")

    def refuse(path: Path) -> bytes:
        raise PermissionError(13, "Permission denied", str(path))

    path = write("adapter.py", "")
    monkeypatch.setattr(Path, "read_bytes", refuse)
    with pytest.raises(AdapterError, match=r"read .*Permission denied"):
        adapter_digest(str(path))


CODE = """
import math

LIMIT = 3


def way(x: float) -> float:
    return math.sqrt(x) + LIMIT
"""

SAME = '''
"""A module."""

import math  # for the root

LIMIT = (
    3
)
"""How far."""


def way(x: float) -> float:
    """The way."""
    # that is all
    return math.sqrt( x ) + LIMIT
'''


def digest(folder: Path, *texts: str | bytes, name: str = "code.py") -> str:
    paths = []
    for number, text in enumerate(texts):
        path = folder / str(number) / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        paths.append(path)
    return code_digest(paths)


def test_comments_docstrings_and_layout_do_not_count(tmp_path: Path) -> None:
    assert digest(tmp_path, CODE) == digest(tmp_path, SAME)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("LIMIT = 3", "LIMIT = 4"),
        ("LIMIT = 3", "LIMIT = 3.0"),
        ("LIMIT = 3", "LIMIT = '3'"),
        ("LIMIT = 3", "LIMIT = -3"),
        ("+ LIMIT", "- LIMIT"),
        ("math.sqrt", "math.cbrt"),
        ("return math", "math"),
        ("import math", "import cmath as math"),
    ],
)
def test_everything_that_is_executed_counts(tmp_path: Path, old: str, new: str) -> None:
    assert old in CODE
    assert digest(tmp_path, CODE) != digest(tmp_path, CODE.replace(old, new))


def test_a_string_that_is_used_counts(tmp_path: Path) -> None:
    assert digest(tmp_path, "name = 'one'") != digest(tmp_path, "name = 'two'")
    assert digest(tmp_path, "def f():\n    'one'") == digest(tmp_path, "def f():\n    'two'")


def test_order_of_the_files_does_not_count_but_name_and_number_do(tmp_path: Path) -> None:
    assert digest(tmp_path, CODE, "x = 1") == digest(tmp_path, "x = 1", CODE)
    assert digest(tmp_path, CODE) != digest(tmp_path, CODE, CODE)
    assert digest(tmp_path, CODE) != digest(tmp_path, CODE, name="other.py")


def test_what_is_not_python_counts_by_its_bytes(tmp_path: Path) -> None:
    for name in ("code.so", "code.py"):
        assert digest(tmp_path, b"def \xff(", name=name) == digest(tmp_path, b"def \xff(", name=name)
        assert digest(tmp_path, b"def \xff(", name=name) != digest(tmp_path, b"def \xff( # 1", name=name)


def test_the_digest_is_the_same_with_every_version_of_python(tmp_path: Path) -> None:
    # Written down with 3.11. Versions differ in the empty fields that they give a function.
    text = "def f(a, *, b=1, **c) -> int:\n    return [a, f'{b!r:>3}', *c]\n\n\nclass G(dict): pass\n"
    assert digest(tmp_path, text).startswith("cc38c91d2d27")
