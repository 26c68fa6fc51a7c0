"""The beginning of a substrate's first case, in a process of its own. Arguments: NAME FILE."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from pytest_libero_max.conformance.substrate.states import beginning
from pytest_libero_max.conformance.substrate.subject import open_subject

if __name__ == "__main__":
    name, file = sys.argv[1:]
    Path(file).write_text(json.dumps(beginning(open_subject(name))), encoding="utf-8")
