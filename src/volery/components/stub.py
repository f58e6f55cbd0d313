"""What stands in for a component that has no file yet: takes its stated times, returns neutral values."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from volery.base.time import Ns
from volery.kernel.api import Kernel
from volery.kernel.waiting import Rate

_NEUTRAL: dict[str, Callable[[], object]] = {
    "bool": bool,
    "int": int,
    "float": float,
    "str": str,
    "bytes": bytes,
    "list": list,
    "dict": dict,
}


def neutral(returns: str) -> object:
    """The neutral value of a type as a model writes it: ``""``, 0, False, an empty list for ``T[]``, else
    ``None``.
    """
    written = returns.strip()
    if written.endswith("[]"):
        return []
    make = _NEUTRAL.get(written)
    return make() if make else None


class Stub:
    """Provides operations that do nothing. The run charges what is stated for each."""

    def __init__(self, operations: Mapping[str, str]) -> None:
        for name, returns in operations.items():
            setattr(self, name, _returning(returns))


def _returning(returns: str) -> Callable[..., object]:
    def operation(*args: object, **kwargs: object) -> object:
        return neutral(returns)

    return operation


class StubProgram:
    """A ``Program`` without a file. *operations* maps each to its return type as the model writes it.

    An active one is released each *period*, or once if it states none.
    """

    def __init__(self, kernel: Kernel, operations: Mapping[str, str], period: Ns | None = None) -> None:
        self._kernel = kernel
        self._operations = operations
        self._period = period

    def check(self, given: Iterable[str], operations: Iterable[str], active: bool) -> None:
        """Fits everything."""

    def make(self, given: Mapping[str, Any]) -> object:
        """The stub."""
        return Stub(self._operations)

    def run(self, thing: object) -> None:
        """Be released each period."""
        if self._period is None:
            return
        rate = Rate(self._kernel, self._period)
        while True:
            rate.sleep()
