"""``libero-max lab audit``: which of its inputs a policy needs, as one page."""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

from pytest_libero_max.cli.arguments import Commands, add_jobs, option, whole_number
from pytest_libero_max.cli.terminal import say


def add_command(commands: Commands) -> None:
    """Add ``audit`` to the parser."""
    audit = commands.add_parser(
        "audit",
        help="Play cases without images, state or instruction, and say which of them a policy needs",
        description="Plays the study `audit` with pytest: Base, and Base with one input of the policy "
        "changed before the first query. Images are black or stand still, of all cameras or of one; the "
        "state is zeros; the instruction is empty, another task's, or in other words. The page compares each "
        "with Base, case by case. Interrupted, the same command goes on.",
    )
    audit.add_argument("policy", metavar="POLICY", help="As for pytest --libero-max-policy")
    option(audit, "--track TRACK", "The cases (default: smoke)")
    option(audit, "--limit N", "At most so many cases of the track", type=whole_number(1))
    add_jobs(audit, "Workers")
    option(
        audit, "--output FOLDER", "Of the run, and of audit.md", type=Path, default=Path("libero-max-audit")
    )
    audit.add_argument(
        "arguments",
        nargs="*",
        metavar="ARGUMENT",
        help="More of pytest, behind POLICY and --, for example --libero-max-profile=NAME; give the options "
        "of the audit before POLICY then",
    )
    audit.set_defaults(run=_audit)


def _audit(options: argparse.Namespace) -> int:
    from pytest_libero_max.lab.sections.audit import audit_document
    from pytest_libero_max.report.render.markdown import document_markdown
    from pytest_libero_max.report.writers.report_files import write_reports, write_text

    status = subprocess.run(_command(options), check=False).returncode
    if status:
        return status
    report, _ = write_reports(options.output)
    text = document_markdown(audit_document(report))
    write_text(options.output / "audit.md", text)
    say(["", *text.splitlines(), "", f"Written: {options.output / 'audit.md'}"])
    return 0


def _command(options: argparse.Namespace) -> list[str]:
    resume = (options.output / "pairs.jsonl").exists()
    return [
        *(sys.executable, "-m", "pytest", f"--libero-max-policy={options.policy}"),
        "--libero-max-study=audit",
        f"--libero-max-output={options.output}",
        *([f"--libero-max-track={options.track}"] if options.track else []),
        *([f"--libero-max-limit={options.limit}"] if options.limit else []),
        *(["-n", str(options.jobs)] if options.jobs > 1 else []),
        *(["--libero-max-resume"] if resume else []),
        *options.arguments,
    ]
