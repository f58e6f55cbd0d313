"""Whether the battery suffices: the reserve for travelling, and what the landing itself takes.

Below its reserve a vehicle must not travel further. Once what is left only suffices for a landing it is
landed where it is, whatever it does. That share follows from the height, from the slowest usual descent and
from the consumption measured in this flight, so that it holds for an airframe that flies for seven minutes as
for one that flies for forty. Where an autopilot reports volts only, the voltage of a cell under load decides.
"""

from __future__ import annotations

from collections import deque
from math import isfinite, nan

from volery.base.errors import CriticalBattery, LowBattery
from volery.base.time import MINUTE, Ns, S, to_seconds
from volery.vehicles.limits import Limits
from volery.vehicles.telemetry import Telemetry

LOW_FOR: Ns = 3 * S
"""The battery must be low for this time: the voltage sags while the motors draw current."""
CRITICAL_FOR: Ns = S

SLOW_BELOW_M, SLOW_M_S, FAST_M_S = 10.0, 0.5, 1.5
"""Descent of a landing: ArduPilot's LAND_ALT_LOW, LAND_SPEED and WPNAV_SPEED_DN; the others sink faster."""
STOP_AND_REST_S = 5.0
"""Time of a landing beside the descent: to stop on the way, and to stop the motors on the ground, s."""
MARGIN = 1.2
"""Of the energy of a landing: a descent in wind takes more than the mean of the flight."""

ASSUMED_ENDURANCE_S = 360.0
"""Hover on a full battery that is assumed until the consumption is measured; few multirotors fly less."""
MEASURED_OVER: Ns = MINUTE
MEASURED_FROM: Ns = 40 * S
"""Longest and shortest time over which the consumption is measured. PX4's simulated battery loses half of its
charge in the first 30 s, and then nothing.
"""
DROP = 0.03
"""A loss between two reports by more than this is a failing battery, and not consumption."""

LOW_CELL_VOLTS, CRITICAL_CELL_VOLTS = 3.6, 3.5
"""Voltage of a lithium-polymer cell under load: Mission Planner's proposals for ArduPilot's two failsafes."""
RESTED_CELL_VOLTS = (3.65, 4.25)
"""A cell before a flight, V; a battery whose cells cannot be counted by it is not judged by its voltage."""
MOST_CELLS = 14


def landing_time(height: float) -> float:
    """Return the time of a landing from *height* (m above home), s; an unknown height is ``SLOW_BELOW_M``."""
    height = max(height, 0.0) if isfinite(height) else SLOW_BELOW_M
    slow = min(height, SLOW_BELOW_M)
    return slow / SLOW_M_S + (height - slow) / FAST_M_S + STOP_AND_REST_S


def count_cells(volts: float) -> int:
    """Return the number of lithium-polymer cells of a battery at rest; 0 if they cannot be counted."""
    least, most = RESTED_CELL_VOLTS
    fitting = [cells for cells in range(1, MOST_CELLS + 1) if least <= volts / cells <= most]
    return fitting[0] if len(fitting) == 1 else 0


class BatteryMonitor:
    """Judges the battery of one vehicle, and measures its consumption in flight.

    Args:
        telemetry: telemetry of the vehicle.
    """

    def __init__(self, telemetry: Telemetry) -> None:
        self._telemetry = telemetry
        self._reports: deque[tuple[Ns, float]] = deque()  # times at which the reported share has changed
        self._rate = 1.0 / ASSUMED_ENDURANCE_S
        self._cells = 0
        self._low_since: Ns | None = None
        self._critical_since: Ns | None = None

    @property
    def consumption(self) -> float:
        """Share of the battery that a second of flight takes, as measured or assumed."""
        return self._rate

    def note(self, now: Ns) -> None:
        """Note the reported battery; on the ground also count its cells."""
        seen = self._telemetry
        remaining, volts, _ = seen.battery
        if not seen.flying:
            self._reports.clear()
            if not seen.armed and isfinite(volts):
                self._cells = count_cells(volts)
        if not seen.flying or not isfinite(remaining):
            return
        reports = self._reports
        if reports and not reports[-1][1] - DROP <= remaining <= reports[-1][1] + DROP:
            reports.clear()
        if reports and reports[-1][1] == remaining:
            return
        reports.append((now, remaining))
        while now - reports[0][0] > MEASURED_OVER:
            reports.popleft()
        (began, most), spent = reports[0], now - reports[0][0]
        if spent >= MEASURED_FROM and most > remaining and began < now:
            self._rate = (most - remaining) / to_seconds(spent)

    def share_to_land(self, limits: Limits) -> float:
        """Return the share at which the vehicle must land from its present height, to keep the reserve."""
        takes = self._rate * landing_time(self._telemetry.above_home) * MARGIN
        return takes + limits.landing_reserve

    def shortage(self, limits: Limits) -> str:
        """Return why the vehicle must not travel, in words; empty if it may."""
        remaining = self._telemetry.battery.remaining
        if isfinite(remaining):
            if remaining >= limits.reserve:
                return ""
            return f"at {remaining:.0%}, below the reserve of {limits.reserve:.0%} (Limits.battery_reserve)"
        if limits.reserve == 0.0 or not self._cell_volts() < LOW_CELL_VOLTS:
            return ""
        return f"at {self._cell_volts():.2f} V per cell, below {LOW_CELL_VOLTS:g} V"

    def check(self, operation: str, now: Ns, limits: Limits, *, travels: bool) -> LowBattery | None:
        """Return the error that must end the operation, or ``None``.

        Args:
            operation: what the vehicle is doing, for the error message.
            now: the present time, ns.
            limits: limits with the reserves.
            travels: whether the operation is ended below the reserve, too.
        """
        self.note(now)
        critical = self._critical(limits)
        if not critical:
            self._critical_since = None
        elif self._critical_since is None:
            self._critical_since = now
        elif now - self._critical_since >= CRITICAL_FOR:
            return CriticalBattery(self._telemetry.name, operation, f"the battery is {critical}")
        low = self.shortage(limits) if travels else ""
        if not low:
            self._low_since = None
        elif self._low_since is None:
            self._low_since = now
        elif now - self._low_since >= LOW_FOR and not critical:
            return low_battery(self._telemetry.name, operation, low)
        return None

    def _critical(self, limits: Limits) -> str:
        """Return why the vehicle must land where it is; empty if it need not, or is not a drone in flight."""
        seen = self._telemetry
        if limits.landing_reserve == 0.0 or seen.kind != "drone" or not seen.flying or seen.stale:
            return ""
        remaining = seen.battery.remaining
        if not isfinite(remaining):
            volts = self._cell_volts()
            if not volts < CRITICAL_CELL_VOLTS:
                return ""
            limit = f"below {CRITICAL_CELL_VOLTS:g} V"
            return f"at {volts:.2f} V per cell, {limit}: it suffices for a landing only"
        if remaining > self.share_to_land(limits):
            return ""
        seconds = remaining / self._rate
        return (
            f"at {remaining:.0%}, for {seconds:.0f} s of flight: it suffices for a landing only, "
            f"with {limits.landing_reserve:.0%} left (Limits.landing_reserve)"
        )

    def _cell_volts(self) -> float:
        """Return the voltage of a cell, V; NaN where its cells are not counted."""
        return self._telemetry.battery.volts / self._cells if self._cells else nan


def low_battery(vehicle: str, operation: str, shortage: str) -> LowBattery:
    """Return the error for a battery below its reserve; it names the operations that are still allowed."""
    what = f"the battery is {shortage}; return_home(), land() and hold() are still possible"
    return LowBattery(vehicle, operation, what)
