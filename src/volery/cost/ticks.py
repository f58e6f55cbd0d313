"""Counters inside expressions, where nothing can be assigned: functions without arguments that return None.

They are read whenever code that is counted may block, hundreds of times in a simulated second.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import repeat
from operator import length_hint

_MANY = 2**62


class Ticks:
    """Counters that add to one sum.

    A counter is the advance of an iterator of ``None``, one for each weight: that is cheap, and its length
    hint tells how often it was advanced.
    """

    def __init__(self) -> None:
        self._ticks: dict[int, repeat[None]] = {}  # by weight
        self._left: list[int] = []  # length hints at the last reading

    def counter(self, weight: int) -> Callable[[], None]:
        """Return a function that adds *weight* to the sum."""
        if weight not in self._ticks:
            self._ticks[weight] = repeat(None, _MANY)
            self._left.append(_MANY)
        return self._ticks[weight].__next__

    def take(self) -> int:
        """Return the sum since the last call."""
        left = list(map(length_hint, self._ticks.values()))
        if left == self._left:
            return 0
        advances = zip(self._ticks, left, self._left, strict=True)
        taken = sum(weight * (before - now) for weight, now, before in advances)
        self._left = left
        return taken
