"""What resolving needs at hand: the form, the vocabulary, and where to put problems."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path as FilePath

from volery.base.errors import Location
from volery.model.form import ModelForm
from volery.model.problems import Path, Problems
from volery.model.system import Vocabulary

RESERVED = ("application", "environment")
"""Names that messages, observables and ports use for the whole."""


@dataclass(frozen=True)
class Context:
    """One resolution: form to system."""

    form: ModelForm
    vocabulary: Vocabulary
    problems: Problems
    folder: FilePath

    def where(self, path: Path) -> Location | None:
        """Where *path* stands."""
        return self.problems.where(path)

    def known(self, path: Path, name: str, noun: str, valid: Iterable[str]) -> bool:
        """True if *name* is one of the *valid* ones; otherwise notes the problem."""
        names = list(valid)
        if name not in names:
            self.problems.unknown(path, name, noun, names)
        return name in names
