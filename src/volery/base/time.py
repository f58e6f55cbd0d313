"""Time is an ``int`` of nanoseconds. Seconds as ``float`` occur at the public interface only."""

from __future__ import annotations

from typing import Final

Ns = int
"""A point in time since the start of a run, or a duration, in nanoseconds."""

US: Final[Ns] = 1_000
MS: Final[Ns] = 1_000_000
S: Final[Ns] = 1_000_000_000
MINUTE: Final[Ns] = 60 * S
HOUR: Final[Ns] = 60 * MINUTE


def from_seconds(seconds: float) -> Ns:
    """Return the nearest nanosecond to *seconds* (ties to even)."""
    return round(seconds * S)


def to_seconds(ns: Ns) -> float:
    """Return seconds. ``from_seconds`` restores the same nanosecond up to 2**51 ns, 26 days."""
    return ns / S


def clock(ns: Ns) -> str:
    """Format a time as ``h:mm:ss.mmm``, for example ``0:02:07.250``."""
    sign = "-" if ns < 0 else ""
    milliseconds = abs(ns) // MS
    minutes, rest = divmod(milliseconds, 60_000)
    return f"{sign}{minutes // 60}:{minutes % 60:02d}:{rest // 1000:02d}.{rest % 1000:03d}"
