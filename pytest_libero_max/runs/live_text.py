"""Lines at the lower end of a terminal that are redrawn below whatever else is written.

They stand below the cursor, which stays where it is. Other writers first have them erased, so nothing of
them is left in the output. All movements are relative, so a terminal may scroll.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from typing import TextIO

_ERASE_BELOW = "\x1b[J"


class LiveText:
    """Draws on a terminal."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._drawn = False

    def draw(self, lines: Sequence[str], column: int = 0) -> None:
        """Show these lines in place of the last ones, cut to the width of the terminal.

        Args:
            lines: Without line ends.
            column: Column of the cursor, which stays. From 0, lines begin at the cursor; otherwise below it.
        """
        size = shutil.get_terminal_size()
        shown = [shortened(line, size.columns - 1) for line in lines[: max(size.lines - 2, 1)]]
        if column:
            shown = ["", *shown]
        up = f"\x1b[{len(shown) - 1}A" if len(shown) > 1 else ""
        right = f"\x1b[{column % size.columns or size.columns}C" if column else ""
        self._write(_ERASE_BELOW + "\r\n".join(shown) + up + "\r" + right)
        self._drawn = True

    def erase(self) -> None:
        """Take the lines away."""
        if self._drawn:
            self._write(_ERASE_BELOW)
            self._drawn = False

    def _write(self, text: str) -> None:
        self._stream.write(text)
        self._stream.flush()


def shortened(line: str, width: int) -> str:
    """Return a line cut off at the width."""
    return line if len(line) <= width else line[: max(width - 3, 0)] + "..."


def understands_sequences(stream: TextIO) -> bool:
    """Return True if a stream is a terminal on which text can be redrawn."""
    try:
        return stream.isatty() and os.environ.get("TERM", "dumb") != "dumb"
    except ValueError:  # it is closed
        return False
