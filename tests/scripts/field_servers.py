"""Examines the servers of other packages, and writes what was found of each; prints a table.

    python -m tests.scripts.field_servers FOLDER [KIND=PYTHON ...]

A KIND is one of ``field_serving.py``, PYTHON the interpreter of an environment that has its package. Results
that lie in FOLDER already are in the table as well.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pytest_libero_max.benchmark.structs import to_builtins
from pytest_libero_max.conformance.registry import rules_for
from pytest_libero_max.conformance.results import RuleResult, conformance
from pytest_libero_max.conformance.rules import Examination
from pytest_libero_max.conformance.server.subject import open_at
from tests.scripts.field_serving import KINDS

PROFILES = {
    "openpi": 'extends = "pi05_libero"\n[policy]\nrepeatable = true\n',
    "vla-eval": 'extends = "vla_eval_pi05"\n[policy]\nname = "toy"\nrepeatable = true\n',
}
"""Profile of the toy model, by protocol."""


@contextmanager
def served(kind: str, python: str) -> Iterator[tuple[str, int]]:
    """A server of a kind; its package with the version, and its port."""
    script = Path(__file__).with_name("field_serving.py")
    process = subprocess.Popen([python, str(script), kind], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        words: dict[str, str] = {}
        for line in process.stdout:
            name, _, value = line.strip().partition(" ")
            words[name] = value
            if name == "port":
                break
        yield words["version"], int(words["port"])
    finally:
        process.terminate()
        process.wait(10)


def examine(kind: str, python: str, folder: Path) -> None:
    """Examine a server by all rules, and write what was found."""
    _, scheme, _ = KINDS[kind]
    profile = folder / f"{scheme}.toml"
    profile.write_text(PROFILES[scheme])
    with served(kind, python) as (package, port):
        subject = open_at(f"{scheme}://127.0.0.1:{port}", str(profile))
        rules = rules_for("server")
        outcomes = Examination(lambda: subject, rules).outcomes()
    results = {outcome.rule.id: RuleResult.of(outcome) for outcome in outcomes}
    document = to_builtins(conformance(f"server:{scheme}://{kind}", results, [rule.id for rule in rules]))
    text = json.dumps({"package": package, "conformance": document}, indent=1)
    (folder / f"{kind}.json").write_text(text + "\n")


def table(found: dict[str, Any]) -> str:
    """A row for each rule, a column for each server."""
    marks = {"unexamined": "-", "broken": "**broken**"}
    lines = ["| Rule | Level | " + " | ".join(found) + " |", "| --- | --- |" + " --- |" * len(found)]
    for index, rule in enumerate(rules_for("server")):
        states = [each["conformance"]["rules"][index]["state"] for each in found.values()]
        cells = [marks.get(state, state) for state in states]
        lines.append(f"| `{rule.id.partition('/')[2]}` | {rule.level} | {' | '.join(cells)} |")
    return "\n".join(lines)


def main(folder: Path, asked: list[str]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for item in asked:
        kind, _, python = item.partition("=")
        examine(kind, python, folder)
    found = {
        kind: json.loads((folder / f"{kind}.json").read_text())
        for kind in KINDS
        if (folder / f"{kind}.json").is_file()
    }
    (folder / "servers.json").write_text(json.dumps(found, indent=1) + "\n")
    print(table(found))


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
