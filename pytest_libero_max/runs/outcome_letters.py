"""One letter a pair for the progress line, one sentence for ``-v``."""

from __future__ import annotations

from pytest_libero_max.pairing.record import PairRecord

LETTERS = {
    "preserved_success": "P",
    "change_associated_success": "G",
    "regression": "R",
    "persistent_failure": "N",
}
"""Both arms succeed, only Dynamic (a gain), only Base (a regression), neither. ``U`` is a pair whose event
never fired, and an error keeps pytest's own ``E``."""

UNTRIGGERED = "U"
ERROR = "E"

ALL_LETTERS = (*LETTERS.values(), UNTRIGGERED, ERROR)

_WORDS = {
    "preserved_success": "PRESERVED",
    "change_associated_success": "GAINED",
    "regression": "REGRESSION",
    "persistent_failure": "NEITHER",
}


def letter_of(pair: PairRecord) -> str:
    """Return the letter of a measured pair."""
    return LETTERS[pair.outcome] if pair.triggered else UNTRIGGERED


def status(pair: PairRecord) -> tuple[str, str, str]:
    """Category (pytest's), letter and word for a measured pair."""
    return "passed", letter_of(pair), sentence(pair)


def sentence(pair: PairRecord) -> str:
    """Return the outcome of a pair on one line."""
    base = f"Base {_arm(pair.base_success, pair.base_steps)}"
    if not pair.triggered:
        return f"UNTRIGGERED ({base}, never within reach: {pair.min_distance_m:.2f} m at best)"
    dynamic = f"Dynamic {_arm(pair.dynamic_success, pair.dynamic_steps)}"
    stale = f"{pair.stale_actions} stale action" + ("" if pair.stale_actions == 1 else "s")
    return f"{_WORDS[pair.outcome]} ({base}, event at step {pair.trigger_step}, {stale}, {dynamic})"


def _arm(success: bool, steps: int) -> str:
    return f"{'succeeds' if success else 'fails'} after {steps}"
