from __future__ import annotations

import json
import os
import subprocess
import sys
from typing import Any

import pytest

from tests.short_episodes import short_episodes

LOADED = (
    "import json\n"
    "from pytest_libero_max.worlds.threads import fingerprint, loaded_blas, use_one_blas_thread\n"
)
SHOW = "print(json.dumps([[blas.package, blas.kind, blas.threads] for blas in loaded_blas()]))\n"


def run(code: str, threads: str | None = None) -> Any:
    environment = {key: value for key, value in os.environ.items() if key != "OPENBLAS_NUM_THREADS"}
    if threads is not None:
        environment["OPENBLAS_NUM_THREADS"] = threads
    command = [sys.executable, "-c", LOADED + code]
    return json.loads(subprocess.run(command, env=environment, capture_output=True, check=True).stdout)


@pytest.fixture(scope="module")
def several() -> list[list[Any]]:
    """What is loaded if nobody limits it."""
    found: list[list[Any]] = run("import numpy.linalg, scipy.linalg\n" + SHOW)
    if not found or max(threads for _, _, threads in found) < 2:
        pytest.skip("needs OpenBLAS and two processors")
    return found


def test_a_blas_that_is_loaded_already_is_limited(several: list[list[Any]]) -> None:
    found = run("import numpy.linalg, scipy.linalg\nuse_one_blas_thread()\n" + SHOW)
    assert [package for package, _, _ in found] == ["numpy", "scipy"]
    assert [threads for _, _, threads in found] == [1, 1]
    assert [kind for _, kind, _ in found] == [kind for _, kind, _ in several]


def test_a_blas_that_is_loaded_later_is_limited(several: list[list[Any]]) -> None:
    found = run("import numpy.linalg\nuse_one_blas_thread()\nimport scipy.linalg\n" + SHOW)
    assert [threads for _, _, threads in found] == [1, 1]


def test_a_number_that_the_user_has_set_is_kept(several: list[list[Any]]) -> None:
    found = run("import numpy.linalg, scipy.linalg\nuse_one_blas_thread()\n" + SHOW, threads="2")
    assert [threads for _, _, threads in found] == [2, 2]


def test_the_fingerprint_does_not_depend_on_what_was_imported(several: list[list[Any]]) -> None:
    show = "use_one_blas_thread()\nprint(json.dumps(fingerprint()))\n"
    first, second = run(show), run("import scipy.linalg\n" + show)
    assert first == second == {"blas": several[0][1], "blas_threads": "1"}


def test_asking_imports_nothing() -> None:
    assert run("import sys\nuse_one_blas_thread()\nprint(json.dumps('numpy' in sys.modules))\n") is False


CONFTEST = """
import json
import numpy.linalg

def pytest_sessionfinish():
    from pytest_libero_max.worlds.threads import loaded_blas
    print("threads", sorted({blas.threads for blas in loaded_blas()}))
"""


def test_a_conftest_that_imports_numpy_first_does_not_change_the_threads(
    pytester: pytest.Pytester, several: list[list[Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    pytester.makeconftest(CONFTEST)
    flags = ("--libero-max-policy=noop", "--libero-max-substrate=tiny", "--libero-max-limit=1", "-s")
    result = pytester.runpytest_subprocess("-p", "no:cacheprovider", *short_episodes(pytester, 20), *flags)
    result.stdout.fnmatch_lines(["*threads [[]1[]]*"])
