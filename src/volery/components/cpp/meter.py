"""What C++ code has computed, by its own counters.

A library that counts itself exports an array (``library.COUNTERS``). What a count costs is a law's to say:
whoever builds the run gives a function from the array to an amount, for instance cycles on the target.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable

Counters = ctypes.Array[ctypes.c_uint64]
Worth = Callable[[Counters], int]
"""What all that was counted since the start amounts to, in the steps that a ``Pricing`` prices."""


class Meter:
    """A ``StepCounter`` for code that is loaded later: nothing until ``read_from`` was called."""

    def __init__(self) -> None:
        self._counters: Counters | None = None
        self._worth: Worth = lambda counters: 0
        self._taken = 0

    def read_from(self, counters: Counters, worth: Worth) -> None:
        """From now on *worth* of *counters* is what there is."""
        self._counters, self._worth = counters, worth
        self._taken = worth(counters)

    def __call__(self) -> int:
        """Steps since it was last asked. It is asked at each interaction point."""
        if self._counters is None:
            return 0
        total = self._worth(self._counters)
        steps, self._taken = total - self._taken, total
        return steps
