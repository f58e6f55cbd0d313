"""What is done again and again: by the clock, or, where the carrier is a node, in that node's own loop."""

from __future__ import annotations

from volery.base.time import Ns
from volery.kernel.api import Action, Handle, Kernel


class _Due:
    """One such thing, in a node's loop."""

    def __init__(self, period: Ns, action: Action, first: Ns) -> None:
        self.period, self.action, self.next = period, action, first
        self.cancelled = False

    def cancel(self) -> None:
        self.cancelled = True


class Pulse:
    """``every`` as the kernel has it. *looped*: nothing happens except in ``beat``."""

    def __init__(self, kernel: Kernel, *, looped: bool) -> None:
        self._kernel = kernel
        self._looped = looped
        self._due: list[_Due] = []

    def every(self, period: Ns, action: Action) -> Handle:
        """Do it now and each *period* from now on."""
        if not self._looped:
            return self._kernel.every(period, action)
        due = _Due(period, action, self._kernel.now())
        self._due.append(due)
        return due

    def beat(self) -> None:
        """Do what is due. For the loop of a node."""
        now = self._kernel.now()
        self._due = [due for due in self._due if not due.cancelled]
        for due in tuple(self._due):
            if now >= due.next and not due.cancelled:
                due.next = now + due.period
                due.action()
