"""Commands in documents, and what can be said of each without playing a track."""

from __future__ import annotations

import argparse
import ast
import contextlib
import importlib.util
import io
import re
import shlex
import tempfile
import tomllib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.keywords import matches
from pytest_libero_max.benchmark.tracks import load_cases
from pytest_libero_max.cli import parser
from pytest_libero_max.cli.commands import CommandPlace
from pytest_libero_max.errors import LiberoMaxError
from pytest_libero_max.evaluation.run_cases import markers_of
from pytest_libero_max.plugin.options import resolve

ROOT = Path(__file__).parents[1]
FOLDERS = ("docs", "pytest_libero_max", "cases", "fixtures", "reports", "tests")

ELSEWHERE = {
    "apt-get": "alters the machine; .ci/run does it",
    "cp": "of the system",
    "eval": "of the shell, for completion",
    "head": "of the system",
    "find": "of the system, to leave models out",
    "git": "publishes a release, or clones",
    "mkdocs": "run by .ci/run",
    "podman": "of a machine with containers",
    "pre-commit": "of a developer's own machine",
    "register-python-argcomplete": "of the shell, for completion",
    "rm": "of the system",
    "ruff": "run by .ci/run",
    "mypy": "run by .ci/run",
    "sha256sum": "of the system",
    "uv": "of a model's own environment",
    "xdg-open": "opens a browser",
    "vla-eval": "of vla-eval's environment: tests/scripts/evaluation_loops.py",
    "lerobot-eval": "of LeRobot's environment: tests/scripts/evaluation_loops.py",
    ".ci/run": "runs these tests",
    ".": "of the shell",
}
"""Programs of others, with the reason why a test of this page does not run them."""

PROVED = {
    "libero-max check": "tests/cli/test_check.py",
    "libero-max compare": "tests/cli/test_compare.py",
    "libero-max dev build": "tests/makers/construction/test_unmodified_tracks.py",
    "libero-max dev certify": "tests/makers/construction/test_examiner.py",
    "libero-max dev eligibility": "tests/makers/construction/test_unmodified_tracks.py",
    "libero-max doctor": "tests/test_doctor.py",
    "libero-max film": "tests/test_documented_commands.py",
    "libero-max gate": "tests/plugin/test_gates.py",
    "libero-max init": "tests/cli/test_init.py",
    "libero-max lab bisect": "tests/lab/commands/test_bisect.py",
    "libero-max lab demos": "tests/lab/demos",
    "libero-max lab recovery": "tests/lab/commands/test_recovery.py",
    "libero-max lab rerun": "tests/lab/test_rerun_file.py",
    "libero-max list cases": "tests/cli/test_cases.py",
    "libero-max list": "tests/cli/test_lists.py",
    "libero-max plan gates": "tests/test_documented_commands.py",
    "libero-max publish": "tests/cli/test_publish.py",
    "libero-max report": "tests/cli/test_report.py",
    "libero-max serve": "tests/policies/server",
    "libero-max shards merge": "tests/runs/test_merge.py",
    "libero-max shards slurm": "tests/cli/test_slurm.py",
    "libero-max view": "tests/cli/test_view.py",
    "pip install": ".ci/run",
    "pytest": "tests/plugin",
    "python -m venv": ".ci/run",
    "python3 -m venv": ".ci/run",
    "python make_cases.py": "tests/test_documents.py",
}
"""What plays each command of the tutorial and the how-tos, by its beginning; :data:`ELSEWHERE` has others."""

MODULES_ELSEWHERE = {
    "build": "makes the distribution; the release workflow does it",
    "deploy": "of X-VLA's repository",
}
"""The same for modules that Python runs."""

SCRIPTS_ELSEWHERE = ("vla-scripts/", "deployment/", "gr00t/")
"""Folders of the models' own repositories."""

_FETCH = (
    "pytest --libero-max-substrate=fetch --libero-max-manifest=fetch.json --libero-max-policy=fetch-scripted"
)
_OF_ITS_PACKAGE = "of a package that is installed in tests/plugin/test_fetch_world.py alone, which plays it"

NOT_YET = {
    "pytest --libero-max-conform=substrate:fetch": _OF_ITS_PACKAGE,
    _FETCH: _OF_ITS_PACKAGE,
    f"{_FETCH} --libero-max-prefix=replay": _OF_ITS_PACKAGE,
    **dict.fromkeys(
        (
            "libero-max dev eligibility --substrate fetch",
            "libero-max dev build cases/fetch --substrate fetch",
            "libero-max dev certify cases/fetch --expert fetch-scripted --substrate fetch",
        ),
        "of a package that is not installed here; tests/makers/construction builds and certifies",
    ),
    'pytest --libero-max-policy=noop --libero-max-limit=2 "--libero-max-gate=unanswered > 0"': "works after "
    "the change that the page describes",
    "libero-max NAME": "any command",
}
"""Commands that cannot be accepted, with the reason."""

PLACEHOLDERS = {
    "ASSETS": "assets",
    "CASES": "160",
    "FOLDER": "folder",
    "MANIFEST": "manifest.json",
    "NAME": "transient",
    "POLICY": "expert",
    "N": "4",
    "SCENE": "libero_goal/3",
    "SUITE": "libero_goal",
    "TRACK": "smoke",
    "FILE": "file",
    "MONITOR...": "image_change",
    "RUN...": "first",
    "FOLDER...": "folder",
    "...": "more.npz",
}
"""Words that a reader replaces, where the command wants a value of some form."""

_FENCE = re.compile(
    r"^(?P<indent> *)```(?P<language>\w*)(?: title=\"(?P<file>[\w./]+)\")?\n(?P<body>.*?)^(?P=indent)```",
    re.M | re.S,
)
_INLINE = re.compile(r"(`+)(?!`)(?P<text>[^`]+)\1(?!`)")
_STARTS = r"(?:\$ )?(?:\.venv/bin/)?(?:[A-Z_]+=\S+ )*(?:\.venv/bin/)?(?:libero-max|pytest|python|pip)"
_COMMAND = re.compile(rf"{_STARTS} \S")


@dataclass(frozen=True)
class Documented:
    """A command as a document prints it.

    Attributes:
        document: The file, relative to the repository.
        text: One line, continued lines joined, without its prompt and comment.
        mention: True within a sentence, which may leave out arguments that have to be given.
    """

    document: str
    text: str
    mention: bool = False


@cache
def documented() -> tuple[Documented, ...]:
    """Return every command of every document and docstring."""
    pages = sorted({*ROOT.glob("*.md"), *(path for name in FOLDERS for path in (ROOT / name).rglob("*.md"))})
    sources = sorted(
        path for name in ("pytest_libero_max", "fixtures") for path in (ROOT / name).rglob("*.py")
    )
    return (
        *(command for page in pages for command in _of_page(page)),
        *(command for source in sources for command in _of_source(source)),
    )


def _of_page(path: Path) -> Iterator[Documented]:
    text, name = path.read_text(encoding="utf-8"), str(path.relative_to(ROOT))
    for fence in _FENCE.finditer(text):
        lines = _joined(fence["body"])
        if fence["language"] == "sh":
            yield from (Documented(name, line) for line in _expanded(lines))
        elif not fence["language"]:  # output, of which the lines with a prompt are commands
            yield from (Documented(name, line[2:]) for line in lines if line.startswith("$ "))
    prose = _FENCE.sub("", text)
    yield from _literal_lines(name, prose)
    for inline in _INLINE.finditer(prose):
        words = " ".join(inline["text"].split())
        if _COMMAND.match(words):
            yield Documented(name, words, mention=True)


@cache
def files_of_pages() -> dict[str, str]:
    """Return the content of each file that a page in ``docs`` lets its reader write, by name."""
    pages = (path.read_text(encoding="utf-8") for path in sorted((ROOT / "docs").rglob("*.md")))
    return {
        fence["file"]: fence["body"] for page in pages for fence in _FENCE.finditer(page) if fence["file"]
    }


def _of_source(path: Path) -> Iterator[Documented]:
    name = str(path.relative_to(ROOT))
    tree = ast.parse(path.read_text(encoding="utf-8"))
    nodes = (ast.Module, ast.ClassDef, ast.FunctionDef)
    for node in (node for node in ast.walk(tree) if isinstance(node, nodes)):
        docstring = ast.get_docstring(node) or ""
        yield from _literal_lines(name, docstring)
        for inline in _INLINE.finditer(docstring):
            words = " ".join(inline["text"].split())
            if _COMMAND.match(words):
                yield Documented(name, words, mention=True)


def _literal_lines(name: str, text: str) -> Iterator[Documented]:
    """Commands in blocks that are indented by four."""
    block = [line[4:] if line.startswith("    ") else "" for line in text.splitlines()]
    for line in _expanded(line for line in _joined("\n".join(block)) if _COMMAND.match(line.strip())):
        yield Documented(name, line.strip().removeprefix("$ "))


def _joined(body: str) -> list[str]:
    return re.sub(r"\s*\\\n\s*", " ", body).splitlines()


def _expanded(lines: Iterable[str]) -> Iterator[str]:
    """Yield lines with the variables that earlier lines set put in; a loop is its first turn."""
    values: dict[str, str] = {}

    def value_of(match: re.Match[str]) -> str:
        return values.get(match[1], match[0])

    for line in lines:
        text = re.sub(r"\$(\w+)", value_of, line.strip())
        if loop := re.fullmatch(r"for (\w+) in (\S+) .*; do", text):
            values[loop[1]] = loop[2]
        elif text.startswith("export "):
            values |= dict(word.split("=", 1) for word in shlex.split(text)[1:])
        elif text not in ("", "done") and not text.startswith(("#", "cd ")):
            yield text
        elif text.startswith("cd "):
            yield text.partition("&& ")[2]


def unproved(command: Documented) -> list[str]:
    """Return the parts of a command that nothing plays, and of which nobody says why."""
    parts = []
    for part in re.split(r" (?:&&|\|) ", command.text):
        words = shlex.split(part, comments=True)
        while words and (re.fullmatch(r"[A-Z_]+=.*", words[0]) or words[0] == "sudo"):
            words = words[1:]
        text = " ".join([re.sub(r"^[.\w-]+/bin/", "", words[0]), *words[1:]]) if words else "."
        proof = next((PROVED[begins] for begins in PROVED if f"{text} ".startswith(f"{begins} ")), None)
        elsewhere = text.split()[0] in ELSEWHERE or any(
            text.startswith((f"python -m {name}", f"python {name}"))
            for name in (*MODULES_ELSEWHERE, *SCRIPTS_ELSEWHERE)
        )
        if not elsewhere and (proof is None or not (ROOT / proof).exists()):
            parts.append(text)
    return parts


def fault_of(command: Documented, config: pytest.Config) -> str | None:
    """Return what is wrong with a command; None where it is sound or of another's environment."""
    if command.text in NOT_YET:
        return None
    for part in re.split(r" (?:&&|\|) ", command.text):
        words = shlex.split(part, comments=True)
        while words and (re.fullmatch(r"[A-Z_]+=.*", words[0]) or words[0] == "sudo"):
            words = words[1:]
        if not words:
            continue
        fault = _fault(re.sub(r"^[.\w-]+/bin/", "", words[0]), words[1:], command.mention, config)
        if fault is not None:
            return fault
    return None


def _fault(program: str, words: list[str], mention: bool, config: pytest.Config) -> str | None:
    if program == "libero-max":
        return _fault_of_ours(words, mention)
    if program == "pytest":
        return _fault_of_pytest(words, mention, config)
    if program in ("python", "python3"):
        return _fault_of_python(words)
    if program == "pip":
        return _fault_of_pip(words)
    return None if program in ELSEWHERE else f"nobody says why {program} is not run"


@cache
def _parser() -> argparse.ArgumentParser:
    return parser()


def _fault_of_ours(words: list[str], mention: bool) -> str | None:
    if mention and len(words) == 1:
        commands = next(action for action in _parser()._actions if isinstance(action, CommandPlace))
        known = {*commands.names(), "--help", "--version"}
        return None if words[0] in known else f"there is no command {words[0]}"
    error = io.StringIO()
    try:
        with contextlib.redirect_stderr(error), contextlib.redirect_stdout(io.StringIO()):
            _parser().parse_args(_filled(words))
    except SystemExit as end:
        message = error.getvalue().strip().rpartition("error: ")[2]
        bare = mention and not any(word.startswith("-") for word in words)
        may_lack = mention and re.match(
            rf"the following arguments are required: {'' if bare else '[A-Z]'}|one of the arguments", message
        )
        return None if end.code == 0 or may_lack else message
    return None


def _filled(words: list[str]) -> list[str]:
    """Return words with values in the place of placeholders, alone or behind the = of an option."""
    filled = []
    for word in words:
        flag, equals, value = word.partition("=") if word.startswith("--") else ("", "", word)
        filled.append(f"{flag}{equals}{_written(value) or PLACEHOLDERS.get(value, value)}")
    return filled


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory()


def _written(name: str) -> str | None:
    """Return the path of a settings file that a page lets its reader write; None for anything else."""
    if not name.endswith(".toml") or name not in files_of_pages():
        return None
    path = Path(_folder().name, name)
    path.write_text(files_of_pages()[name], encoding="utf-8")
    return str(path)


def _fault_of_pytest(words: list[str], mention: bool, config: pytest.Config) -> str | None:
    if mention and words == ["-n"]:
        return None
    words = _filled(words)
    try:
        options = config._parser.parse(words)
        settings = resolve(_asked(options))
        cases = () if settings.manifest else _cases_of(settings.track or "smoke")
    except (LiberoMaxError, pytest.UsageError, SystemExit) as error:
        return str(error)
    missing = [
        str(path)
        for path in options.file_or_dir
        if path.startswith(("tests/", "fixtures/")) and not (ROOT / path).exists()
    ]
    if missing:
        return f"there is no {', '.join(missing)}"
    if settings.manifest or settings.substrate.name != "embedded" or "NAME" in options.keyword:
        return None
    if options.markexpr == "quick":  # tests, and no cases
        return None
    chosen = [
        case
        for case in cases
        if (not options.keyword or matches(options.keyword, (case.item_id, *markers_of(case))))
        and (not options.markexpr or matches(options.markexpr, markers_of(case)))
    ]
    return None if chosen else "it selects no case"


@cache
def _cases_of(track: str) -> tuple[Case, ...]:
    return load_cases(track).cases


def _asked(options: Any) -> Any:
    """A configuration of pytest with these options and an empty ini file."""
    many = {name for name, value in vars(options).items() if isinstance(value, list)}
    return SimpleNamespace(
        option=options,
        getoption=lambda name, default=None: getattr(options, name, default),
        getini=lambda name: [] if name in many else None,
        invocation_params=SimpleNamespace(dir=ROOT),
        rootpath=ROOT,
        inipath=None,
        _inicfg={},
    )


def _fault_of_python(words: list[str]) -> str | None:
    if words[0] == "-m":
        module, arguments = words[1], words[2:]
        if module in MODULES_ELSEWHERE or module.endswith(".NAME"):
            return None
        if module == "venv":
            return None
        found = importlib.util.find_spec(module)
        if found is None:
            return f"there is no module {module}"
        if found.submodule_search_locations:
            found = importlib.util.find_spec(f"{module}.__main__")
        assert found is not None
        assert found.origin is not None
        return _fault_of_script(Path(found.origin), arguments)
    if words[0].startswith(SCRIPTS_ELSEWHERE):
        return None
    return None if words[0] in files_of_pages() else _fault_of_script(ROOT / words[0], words[1:])


def _fault_of_script(path: Path, arguments: list[str]) -> str | None:
    """Every option stands in the script: its parser is made where it runs."""
    if not path.exists():
        return f"there is no {path.name}"
    source = path.read_text()
    own = arguments[: arguments.index("--")] if "--" in arguments else arguments
    missing = [word for word in own if word.startswith("--") and f'"{word.partition("=")[0]}' not in source]
    return f"{path.name} has no {', '.join(missing)}" if missing else None


def _fault_of_pip(words: list[str]) -> str | None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    for word, after in zip(words, [*words[1:], ""], strict=True):
        if word.startswith("pytest-libero-max"):
            return "the package is on no index: pip install -e '.[...]' in the clone"
        if word in ("-r", "--requirement") and not (ROOT / after).exists():
            return f"there is no {after}"
        unknown = [name for name in re.findall(r"\w+", word) if word.startswith(".[") and name not in extras]
        if unknown:
            return f"there is no extra {unknown}"
    return None
