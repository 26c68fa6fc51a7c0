"""The first answers of a policy, in a process of its own. Arguments: LOADING FILE."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from pytest_libero_max.conformance.policy.subject import open_policy


def main(loading: str, file: str) -> None:
    """Load a policy and write its first answers as JSON.

    Args:
        loading: Arguments of :func:`.open_policy`, as JSON.
        file: To write.
    """
    subject = open_policy(**json.loads(loading))
    answers = [answer.tolist() for answer in subject.first.answers]
    Path(file).write_text(json.dumps(answers), encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
