"""Amounts of work that volery's own functions have done, for the one who prices them.

A function whose time is of interest says what it did: how many points it matched, how many cells it passed.
That depends on its arguments alone, so the same run has the same amounts. Outside of ``metered`` nothing is
kept.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

Work = dict[str, dict[str, float]]
"""Amounts by block of code, ``calls`` among them."""

_meter: ContextVar[Work | None] = ContextVar("work of the call that is metered", default=None)


def done(block: str, **amounts: float) -> None:
    """Add the amounts of one execution of a block of code."""
    meter = _meter.get()
    if meter is None:
        return
    own = meter.setdefault(block, {"calls": 0})
    own["calls"] += 1
    for name, amount in amounts.items():
        own[name] = own.get(name, 0) + amount


def is_metered() -> bool:
    """Return whether anybody wants to know the amounts: some take time to determine."""
    return _meter.get() is not None


@contextmanager
def metered() -> Iterator[Work]:
    """Yield the work that is done until the end, without that of other meters inside."""
    work: Work = {}
    token = _meter.set(work)
    try:
        yield work
    finally:
        _meter.reset(token)
