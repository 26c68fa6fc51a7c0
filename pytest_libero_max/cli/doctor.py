"""``libero-max doctor``: missing requirements of this machine."""

from __future__ import annotations

import argparse

from pytest_libero_max.cli.arguments import Commands, add_libero, substrate_options
from pytest_libero_max.errors import SubstrateError, counted


def add_command(commands: Commands) -> None:
    """Add ``doctor`` to the parser."""
    doctor = commands.add_parser("doctor", help="Say what this machine lacks, and the commands that help")
    add_libero(doctor)
    doctor.set_defaults(run=_doctor)


def _doctor(options: argparse.Namespace) -> None:
    from pytest_libero_max.doctor import diagnose

    findings = diagnose(substrate_options(options))
    print("\n".join(map(str, findings)))
    missing = [finding for finding in findings if finding.level == "missing"]
    if missing:
        raise SubstrateError(f"Missing: {len(missing)} of {counted(len(findings), 'finding')}; see above.")
