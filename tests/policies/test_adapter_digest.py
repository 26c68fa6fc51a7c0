from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.policies.adapter_digest import adapter_digest, adapter_files
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


def test_of_this_package_only_the_scripted_policies_count() -> None:
    assert names("noop") == ["__init__.py", "noop.py"]
    found = names("stale_expert")
    assert {"expert.py", "motion.py", "scene_view.py", "stale_expert.py"} < set(found)
    assert "contract.py" not in found
    assert adapter_digest("expert") != adapter_digest("stale_expert")


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
    with pytest.raises(AdapterError, match="there is no file"):
        adapter_digest("no_such.py")

    def refuse(path: Path) -> bytes:
        raise PermissionError(13, "Permission denied", str(path))

    path = write("adapter.py", "")
    monkeypatch.setattr(Path, "read_bytes", refuse)
    with pytest.raises(AdapterError, match=r"cannot be read .*Permission denied.* Check the file's perm"):
        adapter_digest(str(path))
