"""The least time of a call in CPU time of the thread: other programs only add to it."""

from __future__ import annotations

from collections.abc import Callable
from time import thread_time_ns

BATCH_NS = 4_000_000
BATCHES = 7


def least_time(function: Callable[..., object], arguments: tuple[object, ...] = ()) -> float:
    """Return the least time of a call among some batches of them, ns."""
    times = 1
    while _batch(function, arguments, times) < BATCH_NS // 4:
        times *= 4
    return min(_batch(function, arguments, times) for _ in range(BATCHES)) / times


def _batch(function: Callable[..., object], arguments: tuple[object, ...], times: int) -> int:
    began = thread_time_ns()
    for _ in range(times):
        function(*arguments)
    return thread_time_ns() - began
