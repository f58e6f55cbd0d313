"""Monitors of control in flight: upset, thrust at its limit, distance from the path, and no effect at all.

They need only what autopilots report. They return the error that ends an operation; what the vehicle does
then is in ``escalation``. Each has its counterpart in the safety tests of the MRS UAV System (Baca et al.,
J. Intell. Robot. Syst. 102 (2021)), whose controllers run on the companion computer; here a control error is
what the autopilot leaves of a command.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import copysign, dist, hypot, isfinite, nan
from typing import NamedTuple

from volery.base.errors import ControlLost, OffTrack, ThrustSaturated
from volery.base.frames import Vector
from volery.base.position import Position
from volery.base.time import MS, Ns, S, to_seconds
from volery.vehicles.limits import Bounds, Path
from volery.vehicles.telemetry import RECENT_CAUSE, STALE_AFTER, Telemetry, describe_state, is_overturned
from volery.vehicles.vehicle_clock import Moment

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
"""Deceleration with which a vehicle ends the motion that it has when the monitoring begins."""


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
            here = bounds.local(seen.position)
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
        here, before, telemetry = bounds.local(position), self._seen, self._telemetry
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
        east, north, _ = bounds.local(target)
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


class Demand(NamedTuple):
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

    It sums up what is asked for over time, and what comes of it: way, turn, lean and climb. A control loop
    that asks for this and then that asks for nothing in the sum. A vehicle that shows an effect in any of
    these follows; how well is not judged. Of way by velocity and of turns only what comes in the direction
    that was asked for counts: a vehicle that swings in front of its own fence, or whose heading is noisy,
    goes nowhere. Firmware ignores what it does not take without a word:
    ArduCopter from 4.6 on a single body rate, others a set-point beyond their own fence.

    Args:
        telemetry: telemetry of the vehicle.
    """

    def __init__(self, telemetry: Telemetry) -> None:
        self._telemetry = telemetry
        self._demand: Demand | None = None
        self._lasting: Ns = 0
        self._asked_at = self._began = self._summed = telemetry.moment()
        self._enough: Moment | None = None  # since when enough was asked for to judge
        self._begin()

    def ask(self, demand: Demand, lasting: Ns) -> None:
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
