"""What a terminal shows: the few sequences that are written to it, on a screen of characters."""

from __future__ import annotations

import re

_SEQUENCE = re.compile(r"\x1b\[(\d*)([A-Za-z])|\x1b\[[0-9;?]*[a-z]|\x1b\][^\x07\x1b]*(?:\x07|\x1b\\)")


class Terminal:
    """Understands line ends, cursor up and right, and the erasing of what is below. It has no upper end."""

    def __init__(self, columns: int = 80) -> None:
        self.columns = columns
        self.rows = [""]
        self.row = self.column = 0

    def feed(self, text: str) -> None:
        place = 0
        while place < len(text):
            found = _SEQUENCE.match(text, place)
            if found:
                self._move(found.group(2), int(found.group(1) or 1))
                place = found.end()
                continue
            self._put(text[place])
            place += 1

    def shown(self) -> list[str]:
        return [row.rstrip() for row in self.rows]

    def _move(self, kind: str | None, count: int) -> None:
        if kind == "A":
            self.row = max(self.row - count, 0)
        elif kind == "C":
            self.column = min(self.column + count, self.columns - 1)
        elif kind == "J":
            del self.rows[self.row + 1 :]
            self.rows[self.row] = self.rows[self.row][: self.column]

    def _put(self, char: str) -> None:
        if char == "\r":
            self.column = 0
        elif char == "\n":
            self._down()
        else:
            if self.column == self.columns:
                self._down()
            row = self.rows[self.row].ljust(self.column)
            self.rows[self.row] = row[: self.column] + char + row[self.column + 1 :]
            self.column += 1

    def _down(self) -> None:
        self.row, self.column = self.row + 1, 0
        if self.row == len(self.rows):
            self.rows.append("")
