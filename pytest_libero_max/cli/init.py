"""``libero-max init``: the files to begin with: an adapter, gates in an ini file, a workflow."""

from __future__ import annotations

import argparse
from pathlib import Path

from pytest_libero_max.cli.arguments import Commands
from pytest_libero_max.cli.ini_file import settings_file

_INSTALLED = Path(__file__).resolve().parents[1] / "starter"
_CHECKOUT = Path(__file__).resolve().parents[2] / "fixtures"

ADAPTER = "adapter.py"
INI = "pytest.ini"
WORKFLOW = ".github/workflows/libero-max.yml"

SOURCES = {ADAPTER: "policies/vla.py", WORKFLOW: "github-action/workflow.yml"}
"""Files that are copied, by name, and their places in ``fixtures``, which the build copies as well."""

GATES = ("base_sr >= 50%", "trigger_coverage >= 80%", "delta >= -20%")
"""Conditions to begin with: the run can show what events do, and they do not do too much."""

LATER = "dynamic_sr_vs(baseline) >= -10%"
"""Gate for later runs; it needs an earlier one."""

SECTION = f"""\
[pytest]
libero_max_policy = {ADAPTER}
libero_max_gate =
    {GATES[0]}
    {GATES[1]}
    {GATES[2]}
# The first two hold where the run can show what events do. The third is about what is lost: Dynamic may
# succeed in 20 points less of the pairs than Base. Set it to what your use of the policy allows.
# Keep a good run (mv libero-max-results baseline); then no later one may lose more than ten points to it:
#   {LATER}
"""

TABLE = f"""\
libero_max_policy = "{ADAPTER}"
libero_max_gate = ["{GATES[0]}", "{GATES[1]}", "{GATES[2]}"]  # later also "{LATER}"
"""


def add_command(commands: Commands) -> None:
    """Add ``init`` to the parser."""
    init = commands.add_parser(
        "init",
        help="Write an adapter, gates in an ini file and a workflow to begin with; no file is overwritten",
    )
    init.add_argument(
        "folder",
        type=Path,
        nargs="?",
        default=Path(),
        metavar="FOLDER",
        help="Where to write (default: here)",
    )
    init.set_defaults(run=_init)


def _init(options: argparse.Namespace) -> None:
    folder: Path = options.folder
    texts = {name: source_of(name).read_text(encoding="utf-8") for name in SOURCES}
    known = settings_file(folder)
    if known is None:
        texts[INI] = SECTION
    for name, text in texts.items():
        print(_written(folder / name, text))
    if known is not None and "libero_max_policy" in known.read_text(encoding="utf-8"):
        print(f"kept     {known}")
    elif known is not None:
        lines = TABLE if known.suffix == ".toml" else SECTION.partition("\n")[2]
        print(f"{known} has the settings of pytest. Add to them:\n\n{lines}")
    root = _repository(folder)
    if root is not None and root != folder.resolve():
        print(
            f"GitHub reads workflows in {root / '.github'} alone: move the workflow there, and name the "
            f"policy {folder.resolve().relative_to(root) / ADAPTER}."
        )
    print(_next(folder))


def source_of(name: str) -> Path:
    """Return the file that ``init`` copies; a checkout has it in ``fixtures`` alone."""
    installed = _INSTALLED / SOURCES[name]
    return installed if installed.is_file() else _CHECKOUT / SOURCES[name]


def has_stand_in(text: str) -> bool:
    """Return True if the text of an adapter still holds the template's ``Model``, which looks at nothing."""
    template = source_of(ADAPTER).read_text(encoding="utf-8")
    return template[template.index("class Model:") : template.index("class Vla:")] in text


def _written(path: Path, text: str) -> str:
    """Write a file that is not there; return what to say of it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        return f"kept     {path}"
    return f"written  {path}"


def _repository(folder: Path) -> Path | None:
    """Return the root of the repository that a folder is in."""
    here = folder.resolve()
    return next((one for one in (here, *here.parents) if (one / ".git").exists()), None)


def _next(folder: Path) -> str:
    enter = "" if folder.resolve() == Path.cwd() else f"  cd {folder}\n"
    return (
        f"\nNext, with your model in the place of Model in {ADAPTER}:\n\n"
        f"{enter}  libero-max check {ADAPTER}\n\n"
        "Then: pytest libero-max --libero-max-limit=8, and pytest libero-max for the whole track."
    )
