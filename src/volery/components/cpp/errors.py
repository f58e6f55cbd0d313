"""What can go wrong at the border to C++ code."""

from __future__ import annotations

from collections.abc import Iterable

from volery.base.errors import UsageError, choices, did_you_mean
from volery.components.instance import ForeignError


class Exited(BaseException):
    """The code called ``exit``. Its flow is left as it is, as a process would be."""

    def __init__(self, status: int) -> None:
        self.status = status
        super().__init__(f"exit({status})")


class CppError(ForeignError):
    """A C++ exception that the code did not catch."""

    def __init__(self, kind: str, what: str) -> None:
        super().__init__(f"{kind}: {what}" if what else kind)


def no_answer(question: str, known: Iterable[str]) -> UsageError:
    """What C++ code is told that asks for something that is not offered where it runs."""
    return UsageError(f"{question!r} is not offered here{did_you_mean(question, known)}: {choices(known)}")
