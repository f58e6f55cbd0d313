"""The monitors of a vehicle in flight, and all of them as one check, which runs five times a second.

They need only what autopilots report, and return the error that ends an operation; what the vehicle does
then is in ``escalation``. ``Movement`` says which of them count. Upset, thrust, track and obstacles have
their counterparts in the safety tests and the bumper of the MRS UAV System (Baca et al., J. Intell. Robot.
Syst. 102 (2021)), whose controllers run on the companion computer; here a control error is what the autopilot
leaves of a command.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from enum import Enum
from math import copysign, degrees, dist, hypot, isfinite, nan
from typing import NamedTuple

from volery.base.elementary import atan2
from volery.base.errors import (
    ControlLost,
    CriticalBattery,
    LowBattery,
    ObstacleNear,
    OffTrack,
    OutOfBounds,
    PositionLost,
    ThrustSaturated,
    VehicleError,
)
from volery.base.frames import Vector
from volery.base.position import AMSL, Position
from volery.base.time import MINUTE, MS, Ns, S, to_seconds
from volery.kernel.api import Kernel
from volery.trace.events import WARNING, Text
from volery.vehicles.escalation import SINKING_M_S
from volery.vehicles.executor import Check
from volery.vehicles.limits import FLOOR, Bounds, Limits, Path
from volery.vehicles.telemetry import (
    RECENT_CAUSE,
    STALE_AFTER,
    UNFIXED,
    Obstacle,
    Telemetry,
    describe_state,
    is_overturned,
)
from volery.vehicles.vehicle_clock import Moment

# -- the battery

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


# -- control: upset, thrust at its limit, distance from the path, no effect at all

FALLING_M_S = 8.0
"""Sink rate that no autopilot commands by itself, m/s."""
OVERTURNED_FOR: Ns = 300 * MS
UNCHECKED_FOR: Ns = S
"""Time without a check after which what was noticed before does not count."""
_UPSET_TEXTS = ("thrust loss", "crash: disarm", "motor failure", "attitude failure", "failure detected")


SATURATED = 0.95
"""Share of the largest thrust from which no thrust is left for control."""
SATURATED_FOR: Ns = 3 * S
CLIMBING_M_S = 0.5
OFF_TRACK_FOR: Ns = 3 * S
JUMP_M = 5.0
"""A position that moves by this more than its velocity explains has jumped: the estimator was reset."""
BRAKING_M_S2 = 2.0
"""Deceleration with which a vehicle stops: PX4's MPC_DEC_HOR_SLOW and ArduPilot's WPNAV_ACCEL are near it."""


class UpsetMonitor:
    """Notices a multirotor that falls or has turned over, from its telemetry and recent texts.

    With one of four motors lost it turns over within half a second and falls: 8 m/s after 0.8 s.

    Args:
        telemetry: telemetry of the vehicle.
    """

    def __init__(self, telemetry: Telemetry) -> None:
        self._telemetry = telemetry
        self._checked: Ns = -1
        self._tilted_since: Ns | None = None

    def check(self, operation: str, now: Ns) -> ControlLost | None:
        """Return the error that must end the operation, or ``None``.

        Args:
            operation: what the vehicle is doing, for the error message.
            now: the present time, ns.
        """
        seen, before = self._telemetry, self._checked
        self._checked = now
        if now - before > UNCHECKED_FOR:
            self._tilted_since = None
        if not (seen.flying and seen.armed) or seen.kind != "drone" or seen.stale:
            self._tilted_since = None
            return None
        what = self._upset(now)
        if not what:
            return None
        return ControlLost(seen.name, operation, f"{what}; {describe_state(seen)}; its motors may still turn")

    def _upset(self, now: Ns) -> str:
        """Return how the vehicle is upset; empty if it is not."""
        seen = self._telemetry
        for text in seen.texts_since(now - RECENT_CAUSE, severity=3):
            if any(words in text.lower() for words in _UPSET_TEXTS):
                return f"the autopilot said {text!r}"
        sink = -seen.velocity.up
        if sink > FALLING_M_S:
            return f"it falls at {sink:.0f} m/s"
        roll, pitch, _ = seen.attitude
        if not is_overturned(seen.attitude):
            self._tilted_since = None
            return ""
        self._tilted_since = now if self._tilted_since is None else self._tilted_since
        held = now - self._tilted_since >= OVERTURNED_FOR
        return f"it has turned over (roll {roll:.0f}, pitch {pitch:.0f} degrees)" if held else ""


class ThrustMonitor:
    """Notices a multirotor at full thrust that does not climb: overloaded, or a weak motor or battery.

    Full thrust in a climb is usual. On the ground it means that the vehicle does not lift off. Reported by
    ArduPilot and PX4 (VFR_HUD) and by Paparazzi; not by DJI.

    Args:
        telemetry: telemetry of the vehicle.
    """

    def __init__(self, telemetry: Telemetry) -> None:
        self._telemetry = telemetry
        self._saturated_since: Ns | None = None

    def check(self, operation: str, now: Ns) -> ThrustSaturated | None:
        """Return the error that must end the operation, or ``None``; as ``UpsetMonitor.check``."""
        seen = self._telemetry
        climbs = seen.velocity.up >= CLIMBING_M_S
        if seen.kind != "drone" or not seen.armed or seen.stale or climbs or not seen.thrust >= SATURATED:
            self._saturated_since = None
            return None
        self._saturated_since = now if self._saturated_since is None else self._saturated_since
        lasts = now - self._saturated_since
        if lasts < SATURATED_FOR:
            return None
        does = "does not climb" if seen.flying else "does not lift off"
        what = f"it has been at {seen.thrust:.0%} thrust for {to_seconds(lasts):.0f} s and {does}"
        return ThrustSaturated(
            seen.name, operation, f"{what}: overloaded, a weak motor or battery; {describe_state(seen)}"
        )


class TrackMonitor:
    """Measures the distance of a multirotor from the straight path, or from the place, that was commanded.

    On a path the horizontal distance counts, because autopilots climb along it in different ways; at a place
    the distance in space. A jump of the estimate restarts the path where the vehicle is then, as autopilots
    do: it is a change of the reference and not a control error. A target that another station has set in the
    same mode ends the monitoring.

    Args:
        telemetry: telemetry of the vehicle.
    """

    def __init__(self, telemetry: Telemetry) -> None:
        self._telemetry = telemetry
        self._path: Path | None = None
        self._at_place = False
        self._stopping_m = 0.0  # what the motion at the start may add
        self._seen: tuple[Position, Vector, Moment] | None = None  # the last position and its time
        self._off_since: Ns | None = None
        self.jumped_m = 0.0
        """Length of a jump of the estimate found by the last check, m; else 0."""

    def follow(self, path: Path | None) -> None:
        """Measure the horizontal distance from *path*; ``None`` measures nothing.

        The motion that the vehicle has now may lead it off the path until it has stopped.
        """
        self._path, self._at_place, self._off_since = path, False, None
        speed = hypot(*self._telemetry.velocity)
        self._stopping_m = speed * speed / (2.0 * BRAKING_M_S2) if isfinite(speed) else 0.0

    def stay(self, bounds: Bounds | None) -> None:
        """Measure the distance from the present place, as far as it is known."""
        seen = self._telemetry
        here = None
        if bounds is not None and seen.located and seen.position is not None:
            here = bounds.frame.local(seen.position)
        self.follow((here, here) if here is not None else None)
        self._at_place = here is not None

    def check(self, operation: str, now: Ns, bounds: Bounds | None) -> OffTrack | None:
        """Return the error that must end the operation, or ``None``.

        Args:
            operation: what the vehicle is doing, for the error message.
            now: the present time, ns.
            bounds: bounds about home, with the greatest distance; ``None`` without a home.
        """
        seen = self._telemetry
        self.jumped_m = 0.0
        if bounds is None or seen.position is None or not (seen.flying and seen.located):
            self._off_since = self._seen = None
            return None
        here = self._note_position(bounds, seen.position)
        if self._path is None or self._sent_elsewhere(bounds):
            return None
        off = dist(here, self._path[0]) if self._at_place else _distance(here, self._path)
        allowed = bounds.limits.off_track + self._stopping_m
        if off <= allowed:
            self._off_since = None
            return None
        self._off_since = now if self._off_since is None else self._off_since
        if now - self._off_since < OFF_TRACK_FOR:
            return None
        of = "place" if self._at_place else "path"
        limit = f"{allowed:.0f} m (Limits.off_track)"
        return OffTrack(seen.name, operation, f"it is {off:.0f} m off its commanded {of}, beyond {limit}")

    def _note_position(self, bounds: Bounds, position: Position) -> Vector:
        """Return the position in the local frame; note a jump since the last one."""
        here, before, telemetry = bounds.frame.local(position), self._seen, self._telemetry
        if before is not None and before[0] is position:
            return before[1]
        self._seen = position, here, telemetry.moment()
        if before is None or self._seen[2].at - before[2].at > STALE_AFTER:
            return here
        speed = hypot(*telemetry.velocity)
        moved = dist(here, before[1])
        explained = (speed if isfinite(speed) else 0.0) * to_seconds(telemetry.elapsed(before[2])) + JUMP_M
        if moved > explained:
            self.jumped_m = moved
            if self._path is not None:
                self._path = here, here if self._at_place else self._path[1]
        return here

    def _sent_elsewhere(self, bounds: Bounds) -> bool:
        """Return whether the autopilot reports a target away from where it was sent; then measure no more."""
        target = self._telemetry.target
        if not self._at_place or self._path is None or target is None:
            return False
        east, north, _ = bounds.frame.local(target)
        away = hypot(east - self._path[0][0], north - self._path[0][1])
        if away > bounds.limits.off_track / 2.0:
            self.follow(None)
            return True
        return False


FOLLOWS_WITHIN: Ns = 3 * S
"""Time in which set-points must show an effect: heavy vehicles begin to move within two seconds."""
SHOWS_WITHIN: Ns = 2 * S
"""Time for which enough must have been asked for: a step after a rest has no effect at once."""
AT_MOST: Ns = 10 * S
"""Time after which what was asked for, too little to judge, is forgotten."""
ASKED_M, ASKED_M_S, ASKED_DEG, ASKED_DEG_S = 1.5, 0.4, 30.0, 10.0
"""Way and turn, and their rates, from which an effect must show: a law that holds a place asks for less."""
ASKED_LEAN_DEG, ASKED_THRUST = 3.0, 0.35
"""Mean lean, and distance of the thrust from 0.5, from which an effect must show."""
EFFECT_SHARE, EFFECT_M, EFFECT_DEG, EFFECT_CLIMB_M = 0.1, 0.5, 5.0, 0.3
"""What counts as an effect: this share of what was asked for, or this way, turn or climb."""


class StreamedSetpoint(NamedTuple):
    """A set-point of a stream; NaN for what it does not state.

    Args:
        velocity: north, east and up, m/s.
        acceleration: likewise, m/s².
        roll: degrees, right positive.
        pitch: degrees, nose up positive.
        heading: degrees clockwise from north.
        yaw_rate: degrees/s, clockwise positive.
        thrust: 0..1, about 0.5 in hover.
    """

    velocity: Vector | None = None
    acceleration: Vector | None = None
    roll: float = nan
    pitch: float = nan
    heading: float = nan
    yaw_rate: float = nan
    thrust: float = nan


class FollowMonitor:
    """Notices a vehicle that does nothing of what a stream of set-points asks for.

    It adds up over time what the set-points demand, and what the vehicle does: way, turn, lean and climb.
    Opposite demands of a control loop cancel. A vehicle that shows an effect in any of these follows; how
    well is not judged. Of way by velocity and of turns only what goes in the demanded direction counts: a
    vehicle that swings in front of its own fence, or whose heading is noisy, goes nowhere. Firmware ignores
    without a word what it does not take:
    ArduCopter from 4.6 on a single body rate, others a set-point beyond their own fence.

    Args:
        telemetry: telemetry of the vehicle.
    """

    def __init__(self, telemetry: Telemetry) -> None:
        self._telemetry = telemetry
        self._demand: StreamedSetpoint | None = None
        self._lasting: Ns = 0
        self._asked_at = self._began = self._summed = telemetry.moment()
        self._enough: Moment | None = None  # since when enough was asked for to judge
        self._begin()

    def ask(self, demand: StreamedSetpoint, lasting: Ns) -> None:
        """Note the set-point that is streamed from now on, for *lasting* ns or until the next one."""
        self._sum()
        if self._demand is None:
            self._begin()
        self._demand, self._lasting, self._asked_at = demand, lasting, self._telemetry.moment()

    def stop(self) -> None:
        """Note that no set-points are streamed any more."""
        self._demand = None

    def check(self, operation: str, now: Ns) -> OffTrack | None:
        """Return the error that must end the operation, or ``None``; as ``UpsetMonitor.check``."""
        seen = self._telemetry
        self._sum()
        if self._demand is None:
            return None
        age = seen.elapsed(self._began)
        if seen.stale or not (seen.flying and seen.armed) or age > AT_MOST + SHOWS_WITHIN:
            self._begin()
            return None
        judged = self._judged() if age > 0 else []
        if any(follows for follows, _ in judged):
            self._begin()
            return None
        self._enough = (self._enough or seen.moment()) if judged else None
        if self._enough is None or seen.elapsed(self._enough) < SHOWS_WITHIN or age < FOLLOWS_WITHIN:
            return None
        said = "; ".join(words for _, words in judged)
        return OffTrack(
            seen.name,
            operation,
            f"it does not follow its set-points: in {to_seconds(age):.0f} s {said}; {describe_state(seen)}; "
            f"its firmware may not take them, or its own fence keeps it",
        )

    def _begin(self) -> None:
        seen = self._telemetry
        self._began = self._summed = seen.moment()
        self._enough = None
        self._speed: Vector = (0.0, 0.0, 0.0)  # that accelerations have asked for
        self._way: Vector = (0.0, 0.0, 0.0)
        self._gone: Vector = (0.0, 0.0, 0.0)
        self._at_first: Vector = seen.velocity if isfinite(hypot(*seen.velocity)) else (0.0, 0.0, 0.0)
        self._accelerated = False
        self._turn = self._thrust = 0.0
        self._lean = (0.0, 0.0)
        self._moved = self._turned = self._leant = self._climbed = 0.0
        self._heading = seen.attitude.heading
        self._off = nan  # of a heading that is asked for, at the beginning

    def _sum(self) -> None:
        """Add what was asked for since the last time, and what came."""
        demand, seen = self._demand, self._telemetry
        if demand is None:
            return
        if seen.elapsed(self._asked_at) > self._lasting:
            self._demand = None
            return
        passed = to_seconds(seen.elapsed(self._summed))
        self._summed = seen.moment()
        self._sum_what_came(passed)
        if demand.acceleration is not None:
            self._accelerated = True
            self._speed = _plus(self._speed, demand.acceleration, passed)
            self._way = _plus(self._way, self._speed, passed)
        elif demand.velocity is not None:
            self._way = _plus(self._way, demand.velocity, passed)
        if isfinite(demand.yaw_rate):
            self._turn += demand.yaw_rate * passed
        if isfinite(demand.heading) and not isfinite(self._off):
            self._off = _wrapped(demand.heading - self._heading)
        if isfinite(demand.roll) and isfinite(seen.attitude.roll):
            self._lean = self._lean[0] + demand.roll * passed, self._lean[1] + demand.pitch * passed
        if isfinite(demand.thrust) and abs(demand.thrust - 0.5) >= ASKED_THRUST:
            self._thrust += (demand.thrust - 0.5) * passed

    def _sum_what_came(self, passed: float) -> None:
        roll, pitch, heading = self._telemetry.attitude
        speed = hypot(*self._telemetry.velocity)
        if isfinite(speed):
            self._moved += speed * passed
            self._gone = _plus(self._gone, self._telemetry.velocity, passed)
            self._climbed += abs(self._telemetry.velocity.up) * passed
        if isfinite(heading):
            self._turned += _wrapped(heading - self._heading) if isfinite(self._heading) else 0.0
            self._heading = heading
        if isfinite(roll) and isfinite(pitch):
            self._leant += hypot(roll, pitch) * passed

    def _judged(self) -> list[tuple[bool, str]]:
        """Return of each that enough was asked for whether it shows an effect, and the two in words."""
        seconds = to_seconds(self._telemetry.elapsed(self._began))
        found: list[tuple[bool, str]] = []
        way = hypot(*self._way)
        if way >= max(ASKED_M, ASKED_M_S * seconds):
            came = self._moved  # of an acceleration, which holds a place against wind, too
            if not self._accelerated:
                came = _along(self._gone, self._way)
                came -= min(0.0, _along(self._at_first, self._way) * seconds)  # it brakes first
            follows = came > min(EFFECT_M, EFFECT_SHARE * way)
            found.append((follows, f"{way:.1f} m were asked for and {came:.1f} m came"))
        off = self._off if isfinite(self._off) else 0.0
        turn = max(self._turn, off, key=abs)
        if abs(off) >= ASKED_DEG or abs(turn) >= max(ASKED_DEG, ASKED_DEG_S * seconds):
            came = copysign(1.0, turn) * self._turned
            words = f"a turn of {abs(turn):.0f} degrees was asked for and {came:.1f} came"
            found.append((came > EFFECT_DEG, words))
        lean, leant = hypot(*self._lean) / seconds, self._leant / seconds
        if lean >= ASKED_LEAN_DEG:
            words = f"a lean of {lean:.1f} degrees was asked for and {leant:.1f} came"
            found.append((leant > EFFECT_SHARE * lean, words))
        if abs(self._thrust) >= ASKED_THRUST * seconds / 2.0:
            what = "climb" if self._thrust > 0.0 else "descent"
            words = f"a {what} by thrust was asked for and {self._climbed:.1f} m came"
            found.append((self._climbed > EFFECT_CLIMB_M, words))
        return found


def _along(one: Vector, way: Vector) -> float:
    """Return the part of a vector in the direction of *way*, which is not zero."""
    return sum(mine * other for mine, other in zip(one, way, strict=True)) / hypot(*way)


def _plus(one: Vector, other: Sequence[float], factor: float) -> Vector:
    return one[0] + other[0] * factor, one[1] + other[1] * factor, one[2] + other[2] * factor


def _wrapped(degrees: float) -> float:
    return (degrees + 180.0) % 360.0 - 180.0


def _distance(here: Vector, path: Path) -> float:
    """Return the horizontal distance of a point from a straight path, m."""
    (x0, y0, _), (x1, y1, _) = path
    dx, dy = x1 - x0, y1 - y0
    length = dx * dx + dy * dy
    share = ((here[0] - x0) * dx + (here[1] - y0) * dy) / length if length > 0.0 else 0.0
    share = min(1.0, max(0.0, share))
    return hypot(here[0] - x0 - share * dx, here[1] - y0 - share * dy)


# -- obstacles

FRESH_FOR: Ns = S
"""Age up to which a measured distance counts."""
SILENT_FOR: Ns = 3 * S
"""Time without any measurement after which the sensors count as failed."""
APPROACHES_M_S = 0.2
"""Closing speed from which the vehicle approaches an obstacle; a way along it or away from it is allowed."""

REACTION_S = 0.4
"""Age of a measurement and of the last check, at most, s: each is repeated five times a second."""

_COMPASS = ("north", "north-east", "east", "south-east", "south", "south-west", "west", "north-west")


class ObstacleMonitor:
    """Compares the distances of obstacles in the direction of motion with a clearance.

    What counts is the distance that is left once the vehicle has stopped.

    Args:
        telemetry: telemetry of the vehicle.
    """

    def __init__(self, telemetry: Telemetry) -> None:
        self._telemetry = telemetry

    def check(self, operation: str, now: Ns, clearance: float) -> ObstacleNear | None:
        """Return the error that must end the operation, or ``None``.

        Args:
            operation: what the vehicle is doing, for the error message.
            now: the present time, ns.
            clearance: least distance from an obstacle, m; 0 checks nothing.
        """
        seen = self._telemetry
        if not clearance or not seen.flying or seen.stale:
            return None
        age = now - seen.obstacles_ns
        if age > SILENT_FOR:
            what = f"its range sensors have measured nothing for {to_seconds(age):.0f} s"
            return ObstacleNear(seen.name, operation, f"{what}; a clearance of {clearance:g} m is stated")
        near = [
            (obstacle.metres, closing, obstacle)
            for obstacle in seen.obstacles.values()
            if now - obstacle.at <= FRESH_FOR
            and (closing := self._closing(obstacle)) > APPROACHES_M_S
            and obstacle.metres - _stopping_distance(closing) < clearance
        ]
        if not near:
            return None
        metres, closing, obstacle = min(near)
        what = f"an obstacle is {metres:.1f} m {_whither(obstacle)}, approached at {closing:.1f} m/s"
        limit = f"it must stop {clearance:g} m before it (Limits.clearance)"
        return ObstacleNear(seen.name, operation, f"{what}: {limit}")

    def _closing(self, obstacle: Obstacle) -> float:
        """Return the speed towards an obstacle, m/s; 0 where the velocity is unknown."""
        velocity, (east, north, up) = self._telemetry.velocity, obstacle.direction
        speed = velocity.east * east + velocity.north * north + velocity.up * up
        return speed if isfinite(speed) else 0.0


def _stopping_distance(speed: float) -> float:
    """Return the distance in which a vehicle at *speed* m/s stops, m, from its last measurement on."""
    return speed * REACTION_S + speed * speed / (2.0 * BRAKING_M_S2)


def _whither(obstacle: Obstacle) -> str:
    """Return the direction of an obstacle in words."""
    east, north, up = obstacle.direction
    if up > 0.5:
        return "above"
    return f"to the {_COMPASS[round(degrees(atan2(east, north)) / 45.0) % 8]}"


# -- bounds and position

POSITION_LOST_FOR: Ns = 10 * S
"""Autopilots with a failsafe for it act sooner: PX4 1.14 after 6.5 s, ArduCopter 4.5 after 8 s."""


class BoundsMonitor:
    """Checks bounds and position during one operation.

    A bound that is violated at the start is ignored until it has been met once, so that a vehicle outside its
    bounds can come back.

    Args:
        telemetry: telemetry of the vehicle.
        bounds: bounds about home, or ``None`` without a home.
        ignored: names of bounds that are never checked.
        needs_position: whether a lost position ends the operation.
    """

    def __init__(
        self,
        telemetry: Telemetry,
        bounds: Bounds | None,
        ignored: frozenset[str] = frozenset(),
        *,
        needs_position: bool = False,
    ) -> None:
        self._telemetry = telemetry
        self._needs_position = needs_position
        self._bounds = bounds
        self._ignored = ignored
        self._checked: Position | None = None
        here = telemetry.position
        self._violated_at_start = (
            set(bounds.violations(here)) if bounds is not None and here is not None else set()
        )

    def check(self, operation: str, now: Ns) -> VehicleError | None:
        """Return the error that must end the operation, or ``None``.

        Args:
            operation: what the vehicle is doing, for the error message.
            now: the present time, ns.
        """
        return self._check_bounds(operation) or self._check_position(operation, now)

    def _check_position(self, operation: str, now: Ns) -> PositionLost | None:
        seen = self._telemetry
        if not self._needs_position or not seen.flying or seen.stale:
            return None
        lost = seen.position_lost_for(now)
        if lost < POSITION_LOST_FOR:
            return None
        why = f"its GPS reports {seen.fix}" if seen.fix in UNFIXED else "none is reported"
        why = why if seen.estimate_valid else "its estimator reports none"
        what = f"it has had no position for {to_seconds(lost):.0f} s ({why}); land() needs none"
        return PositionLost(seen.name, operation, what)

    def _check_bounds(self, operation: str) -> OutOfBounds | None:
        here = self._telemetry.position
        if self._bounds is None or here is None or here is self._checked:
            return None
        self._checked = here
        violations = self._bounds.violations(here)
        self._violated_at_start.intersection_update(violations)
        ignored = self._violated_at_start | self._ignored
        items = [text for name, text in violations.items() if name not in ignored]
        return OutOfBounds(self._telemetry.name, operation, " and ".join(items)) if items else None


# -- all of them


class Movement(Enum):
    """What a vehicle does in an operation, which decides what is monitored.

    The battery, the thrust and the control are monitored in all of them but ``LANDS``.

    Attributes:
        bounded: limits, fence and clearance are monitored.
        travels: it must not begin, or go on, below the battery reserve.
        goes_on: it goes on, and is monitored, after the call has returned, until the next operation.
    """

    NONE = "is not moved by the operation"
    STAYS = "stays where it is, a drone between two calls"
    TURNS = "turns", True
    FOLLOWS_PATH = "stays near the straight path to its goal", True, True
    FLIES_MISSION = (
        "flies the mission on board, which may begin and end below the floor of the fence",
        True,
        True,
    )
    FOLLOWS_SETPOINTS = "follows a stream of set-points", True, True, True
    FLOWN_BY_HAND = "is flown by manual control", True, False, True
    RETREATS = "stops or returns: only the battery ends it"
    LANDS = "lands, stops its motors or is given to a pilot: nothing ends it"

    def __init__(
        self, _meaning: str, bounded: bool = False, travels: bool = False, goes_on: bool = False
    ) -> None:
        self.bounded = bounded
        self.travels = travels
        self.goes_on = goes_on


class Goal(NamedTuple):
    """Where an operation should end; NaN for a coordinate that does not matter."""

    latitude: float
    longitude: float
    amsl: float


NO_GOAL = Goal(nan, nan, nan)


class FlightMonitor:
    """The monitors of one vehicle.

    The first error in this order ends an operation: control is lost, the battery is low, the thrust is at its
    limit, an obstacle is near, the vehicle is off its track, does not follow its set-points, is out of its
    bounds, or has lost its position.

    Args:
        kernel: clock and record.
        telemetry: telemetry of the vehicle.

    Attributes:
        battery: judges the battery, also before an operation.
        upset: notices a loss of control, also before an operation.
        following: notices a stream of set-points that has no effect.
    """

    def __init__(self, kernel: Kernel, telemetry: Telemetry) -> None:
        self._kernel = kernel
        self._telemetry = telemetry
        self.battery = BatteryMonitor(telemetry)
        self.upset = UpsetMonitor(telemetry)
        self.following = FollowMonitor(telemetry)
        self._thrust = ThrustMonitor(telemetry)
        self._track = TrackMonitor(telemetry)
        self._obstacles = ObstacleMonitor(telemetry)

    def check_of(
        self,
        movement: Movement,
        limits: Limits,
        bounds: Bounds | None,
        goal: Callable[[], Goal] = lambda: NO_GOAL,
    ) -> Check:
        """Return the check of an operation that begins now.

        Args:
            movement: what the vehicle does.
            limits: limits with the reserves of the battery.
            bounds: bounds about home, or ``None`` without a home.
            goal: where the operation should end.
        """
        seen = self._telemetry
        monitor = BoundsMonitor(
            seen,
            bounds if movement.bounded else None,
            ignored=frozenset({FLOOR}) if movement is Movement.FLIES_MISSION else frozenset(),
            needs_position=movement.travels or movement is Movement.STAYS,
        )
        if movement is Movement.STAYS:
            self._track.stay(bounds)
        else:
            self._track.follow(None)
        if movement is not Movement.FOLLOWS_SETPOINTS:
            self.following.stop()
        follows = movement is Movement.FOLLOWS_PATH and seen.kind == "drone"

        def check(operation: str, now: Ns) -> VehicleError | None:
            nonlocal follows
            if follows and seen.flying and bounds is not None and seen.located:
                follows = False  # from lift-off on
                self._track.follow(self._path_to(bounds, goal()))
            battery = self.battery.check(operation, now, limits, travels=movement.travels)
            if movement is Movement.RETREATS:  # one that sinks lands already
                return None if seen.velocity.up < -SINKING_M_S else battery
            off_track = self._track.check(operation, now, bounds)
            if self._track.jumped_m:
                said = f"its estimate of the position has jumped by {self._track.jumped_m:.0f} m"
                self._kernel.record(Text(now, seen.name, WARNING, said))
            thrust = self._thrust.check(operation, now) if seen.flying or movement.travels else None
            upset = self.upset.check(operation, now)
            obstacle = self._obstacles.check(operation, now, limits.clearance if movement.bounded else 0.0)
            ignored = self.following.check(operation, now)
            return (
                upset
                or battery
                or thrust
                or obstacle
                or off_track
                or ignored
                or monitor.check(operation, now)
            )

        return check

    def _path_to(self, bounds: Bounds, goal: Goal) -> Path | None:
        """Return the straight path from here to *goal*; ``None`` if either is unknown."""
        here = self._telemetry.position
        if here is None or not (isfinite(goal.latitude) and isfinite(goal.amsl)):
            return None
        return bounds.path(here, Position(goal.latitude, goal.longitude, AMSL(goal.amsl)))
