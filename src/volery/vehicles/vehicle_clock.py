"""The clock of an autopilot beside that of the program.

A simulated firmware may run at several times real time, or slowly on a busy computer. Durations in flight are
therefore counted on the vehicle's clock where it runs faster or slower by more than a quarter; else on that
of the program, which is exact and does not depend on the delays of a link.
"""

from __future__ import annotations

from typing import NamedTuple

from volery.base.time import MS, Ns, S

COMPARED_AFTER: Ns = 5 * S
"""Shortest time over which the clocks are compared."""
COMPARED_ANEW_AFTER: Ns = 10 * S
TOLERANCE = 0.25
"""Share by which the clocks of vehicle and program may differ before that of the vehicle counts."""
REBOOTED_BEFORE: Ns = 10 * S
"""A time since boot that is this much less than the last one is that of another boot."""

WRAP: Ns = 2**32 * MS
"""Period of MAVLink's ``time_boot_ms``: 49.7 days."""
WRAPPED_WITHIN: Ns = 60 * S
"""How near to what is expected a report after a wrap must be; else it is one after another boot."""


class Moment(NamedTuple):
    """One moment on both clocks, ns; ``boot`` is -1 where the vehicle reports none."""

    at: Ns
    boot: Ns


class VehicleClock:
    """The autopilot's time since its boot, as last reported."""

    def __init__(self) -> None:
        self._at: Ns = -1
        self._boot: Ns = -1
        """The last report, on both clocks."""
        self._older = self._newer = Moment(-1, -1)
        self._wrapped: Ns = 0

    def note(self, boot: Ns, now: Ns, *, fresh: bool = True) -> None:
        """Note the time since boot in a message that arrives now, unless it was overtaken on the way.

        Args:
            boot: time since boot, ns, modulo 2**32 ms.
            now: the program's time, ns.
            fresh: the message cannot have been held back on the way: the clocks may be compared from now on.
        """
        last = self._boot
        boot += self._wrapped
        if boot - last > WRAP // 2 and boot >= WRAP:  # sent before the wrap
            boot -= WRAP
        elif boot < last and abs(boot + WRAP - self.time(now)) <= WRAPPED_WITHIN:
            boot += WRAP
            self._wrapped += WRAP
        elif boot < last - REBOOTED_BEFORE:
            boot, self._wrapped = boot - self._wrapped, 0
        if last - REBOOTED_BEFORE <= boot <= last:
            return
        self._at, self._boot = now, boot
        if last < 0 or boot < last:
            self._older = self._newer = Moment(now, boot)
        elif fresh and now - self._newer.at >= COMPARED_ANEW_AFTER:
            self._older, self._newer = self._newer, Moment(now, boot)

    def time(self, now: Ns) -> Ns:
        """Return the time since boot, ns, extrapolated from the last report; -1 without one."""
        return -1 if self._boot < 0 else self._boot + now - self._at

    def elapsed(self, since: Moment, now: Ns) -> Ns:
        """Return the time from *since* to now, ns, of the vehicle where its clock counts."""
        mine, theirs = now - since.at, self.time(now) - since.boot
        if since.boot < 0 or theirs < 0:
            return mine
        if _differ(mine, theirs) or (mine < COMPARED_AFTER and self._differs()):
            return theirs
        return mine

    def _differs(self) -> bool:
        """Return whether the clocks have run differently over the last ten to twenty seconds."""
        return _differ(self._at - self._older.at, self._boot - self._older.boot)


def _differ(mine: Ns, theirs: Ns) -> bool:
    return mine >= COMPARED_AFTER and abs(theirs - mine) > TOLERANCE * mine
