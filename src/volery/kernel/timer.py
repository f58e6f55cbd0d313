"""What repeats, on either clock."""

from __future__ import annotations

from typing import TYPE_CHECKING

from volery.base.errors import UsageError

if TYPE_CHECKING:
    from volery.base.time import Ns
    from volery.kernel.api import Action, Kernel


class Every:
    """House code now and each *period* from now, counted from the start, so that it never drifts."""

    def __init__(self, kernel: Kernel, period: Ns, action: Action) -> None:
        if period <= 0:
            raise UsageError(f"a period of {period} ns; it must be above 0")
        self._kernel, self._period, self._action = kernel, period, action
        self._due = kernel.now()
        self._next = kernel.call_at(self._due, self._tick)

    def cancel(self) -> None:
        """Stop; also from inside the action."""
        self._next.cancel()

    def _tick(self) -> None:
        self._due += self._period
        self._next = self._kernel.call_at(self._due, self._tick)
        self._action()
