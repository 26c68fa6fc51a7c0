from __future__ import annotations

import pytest

from pytest_libero_max.cli import parser


def test_tracks_are_certified_by_the_built_in_expert_unless_told_otherwise() -> None:
    assert parser().parse_args(["dev", "certify", "there"]).expert == "expert"
    assert parser().parse_args(["dev", "certify", "there", "--expert", "mine.py"]).expert == "mine.py"
    with pytest.raises(SystemExit):
        parser().parse_args(["dev", "build", "there", "--expert", "mine.py"])
    assert parser().parse_args(["dev", "preflight", "smoke"]).expert is None
