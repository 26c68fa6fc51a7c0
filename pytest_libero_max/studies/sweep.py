"""A study that plays Base and Dynamic once more at each of several settings."""

from __future__ import annotations

import re
from abc import abstractmethod
from collections.abc import Hashable, Iterable, Sequence
from typing import ClassVar, Generic, Self, TypeVar

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import OptionError
from pytest_libero_max.studies.study import Study

Setting = TypeVar("Setting", bound=Hashable)


class Sweep(Study, Generic[Setting]):
    """Base and Dynamic as the run plays them, and at each of the settings.

    Args:
        settings: At least one, each once.

    Raises:
        OptionError: There is none, or one twice.
    """

    track = "lite"

    form: ClassVar[re.Pattern[str]]
    """Pattern of the text of one setting."""
    expected: ClassVar[str]
    """The form in words, with an example."""

    def __init__(self, settings: Sequence[Setting]) -> None:
        self.settings = tuple(settings)
        if not self.settings or len(set(self.settings)) < len(self.settings):
            raise OptionError.seen(
                "settings", self.text_of(self.settings), ", but give at least one, each once."
            )

    @staticmethod
    @abstractmethod
    def read(match: re.Match[str]) -> Setting:
        """Return the setting whose text has matched."""

    @staticmethod
    @abstractmethod
    def write(setting: Setting) -> str:
        """Return the text of a setting."""

    @classmethod
    def of(cls, settings: str | None) -> Self:
        """Read settings with commas between them.

        Raises:
            OptionError: There is none, one twice, or one of another form.
        """
        if settings is None:
            raise OptionError(
                f"The study {cls.name} needs its settings: --libero-max-study={cls.name}:{cls.example}."
            )
        found = []
        for part in settings.split(","):
            match = cls.form.fullmatch(part.strip())
            if match is None:
                flag = f"--libero-max-study={cls.name}"
                raise OptionError.seen(flag, settings, f", but expected {cls.expected}.")
            found.append(cls.read(match))
        return cls(found)

    @classmethod
    def text_of(cls, settings: Iterable[Setting]) -> str:
        """Return the text that :meth:`of` reads."""
        return ",".join(map(cls.write, settings))

    def to_dict(self) -> Json:
        return {**super().to_dict(), "settings": self.text_of(self.settings)}
