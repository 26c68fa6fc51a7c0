"""Names of functions of other packages, as subjects: ``PACKAGE:FUNCTION`` or ``FILE.py:FUNCTION``."""

from __future__ import annotations

import importlib
import sys
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from pytest_libero_max.errors import OptionError, did_you_mean
from pytest_libero_max.policies.references import find_spec


@dataclass(frozen=True)
class PythonName:
    """Name of a function in a module or a file."""

    kind: str
    """Kind of the subject, for messages."""
    module: str
    """Importable name, or path of a file that ends in ``.py``."""
    function: str

    @classmethod
    def read(cls, kind: str, text: str) -> PythonName:
        """Return the name in a text."""
        module, _, function = text.rpartition(":")
        if not module or not function.isidentifier():
            raise ValueError(
                f"{kind}:{text} names no function. Write {kind}:PACKAGE.MODULE:FUNCTION or "
                f"{kind}:FILE.py:FUNCTION"
            )
        return cls(kind, module, function)

    def check(self) -> None:
        """Check that the module is there, without executing it."""
        if not (Path(self.module).is_file() if self._is_file else find_spec(self.module)):
            raise OptionError.seen(
                self.kind,
                self.module,
                ", but there is no such module or file. Install the package, or name a file.",
            )

    def load(self) -> Any:
        """Import the module, and return its function."""
        try:
            module = _executed(Path(self.module)) if self._is_file else importlib.import_module(self.module)
        except (Exception, SystemExit) as error:  # a module of others may raise anything
            raise OptionError.seen(
                self.kind, self.module, f" cannot be imported: {type(error).__name__}: {error}"
            ) from error
        function = getattr(module, self.function, None)
        if not callable(function):
            names = [name for name, value in vars(module).items() if callable(value) and name[0] != "_"]
            raise OptionError.seen(
                self.kind,
                self.function,
                f", but {self.module} has no function of this name. {did_you_mean(self.function, names)}",
            )
        return function

    @property
    def _is_file(self) -> bool:
        return self.module.endswith(".py")


def _executed(path: Path) -> ModuleType:
    """Return the module of a file, whose folder then stands on the import path for its neighbours."""
    from pytest_libero_max.policies.loading import execute_file

    folder = str(path.absolute().parent)
    if folder not in sys.path:
        sys.path.append(folder)  # last: a file called random.py must not hide the standard library's
    return execute_file(f"_libero_max_subject_{path.stem}", path)
