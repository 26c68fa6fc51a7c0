"""The first steps of an environment, in a process of its own. Arguments: NAME FILE."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from pytest_libero_max.conformance.environment.repeats import beginning
from pytest_libero_max.conformance.environment.subject import open_environment

if __name__ == "__main__":
    name, file = sys.argv[1:]
    Path(file).write_text(json.dumps(beginning(open_environment(name))), encoding="utf-8")
