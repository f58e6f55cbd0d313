"""The digital twin: a vehicle that follows another's heading and position, and how well it does.

The reference is a record (run, rosbag, tlog, DataFlash log, ULog) or a vehicle that another program flies.
The twin is commanded the reference's velocity plus what a law makes of the error, so it lags less than by the
error alone. Its loops are recorded like those of any flight, with the reference as the set-point.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import hypot, inf, isfinite, nan
from typing import NamedTuple

import numpy as np

from volery.base.errors import UsageError
from volery.base.frames import LocalFrame
from volery.control.actuation import MeasuredState, MotionCommand
from volery.control.laws import DEGREES, Law, PidGains, PidLaw, wrap
from volery.control.manoeuvres import LawManoeuvre, LoopSample
from volery.control.step_response import Array, ControlledSignal
from volery.vehicles import Drone

FOLLOW_GAINS = PidGains(kp=0.9, low=-8.0, high=8.0, deceleration=1.2)
FOLLOW_HEIGHT_GAINS = PidGains(kp=0.9, low=-3.0, high=4.0, deceleration=0.8)
FOLLOW_YAW_GAINS = PidGains(kp=2.0, low=-200.0, high=200.0, period=DEGREES)
AIRBORNE = 1.5
"""Height of the reference from which it counts as flying, m."""
SLOPE_S = 0.4
"""Time over which velocities of a record and turn rates are differences, s."""


class TwinReference(NamedTuple):
    """Where the reference is: heading in degrees, m about its home, m/s; NaN where unknown."""

    heading: float
    north: float
    east: float
    up: float
    velocity_north: float = 0.0
    velocity_east: float = 0.0
    velocity_up: float = 0.0
    turn_rate: float = 0.0


Follow = Callable[[float], TwinReference | None]
"""Returns the reference at a time in s since the twin follows; ``None`` at its end."""


@dataclass(frozen=True)
class RecordedReference:
    """A flight in a record, from the first moment in the air to the last.

    Attributes:
        times: seconds.
        heading: degrees, continuous.
        north: m about the first position.
        east: the same to the east.
        up: m above the first position.
    """

    times: Array
    heading: Array
    north: Array
    east: Array
    up: Array

    @property
    def duration(self) -> float:
        """Duration, s."""
        return float(self.times[-1] - self.times[0])

    def __call__(self, elapsed: float) -> TwinReference | None:
        """Return the interpolated reference with velocities from differences."""
        if elapsed > self.duration:
            return None
        at = self.times[0] + elapsed

        def value(column: Array, moment: float) -> float:
            return float(np.interp(moment, self.times, column))

        columns = (self.heading, self.north, self.east, self.up)
        heading, north, east, up = (value(column, at) for column in columns)
        ends = self.times[0], self.times[-1]
        first, last = max(ends[0], at - SLOPE_S / 2.0), min(ends[1], at + SLOPE_S / 2.0)
        turn, *rates = ((value(column, last) - value(column, first)) / (last - first) for column in columns)
        return TwinReference(heading, north, east, up, rates[0], rates[1], rates[2], turn)


def recorded_reference(signals: Sequence[ControlledSignal]) -> RecordedReference:
    """Return the flight that a record contains.

    Args:
        signals: what ``read_signals`` returns.

    Raises:
        UsageError: yaw, north, east or altitude is missing, or nothing flies.
    """
    found = _poses(signals) or {name: _called(signals, name) for name in ("yaw", "north", "east", "altitude")}
    missing = [name for name, one in found.items() if one is None]
    known = {name: one for name, one in found.items() if one is not None}
    if missing:
        raise UsageError(
            f"the record has no {', '.join(missing)}; a twin needs yaw, north, east and altitude"
        )
    start = max(float(one.times[0]) for one in known.values())
    end = min(float(one.times[-1]) for one in known.values())
    if end <= start:
        raise UsageError("yaw and position of the record have no time in common")
    times = np.arange(start, end, 0.05)
    columns = {name: np.interp(times, one.times, _whole(one)) for name, one in known.items()}
    up = columns["altitude"] - columns["altitude"][0]
    flying = np.flatnonzero(up >= AIRBORNE)
    if len(flying) < 2:
        raise UsageError(f"the record never rises {AIRBORNE:g} m above where it begins: nothing flies in it")
    part = slice(int(flying[0]), int(flying[-1]) + 1)
    north, east = columns["north"] - columns["north"][0], columns["east"] - columns["east"][0]
    return RecordedReference(times[part], columns["yaw"][part], north[part], east[part], up[part])


def _poses(signals: Sequence[ControlledSignal]) -> dict[str, ControlledSignal | None]:
    """Return heading and position of the first topic of a rosbag that has both, which are in ROS's ENU."""
    for yaw in signals:
        topic, _, name = yaw.name.rpartition(" ")
        if not topic.startswith("/") or name != "yaw":
            continue
        east, north, up = (_called(signals, f"{topic} {axis}") for axis in "xyz")
        if east is not None and north is not None and up is not None:
            heading = replace(yaw, measured=np.asarray(wrap(90.0 - yaw.measured, DEGREES)))
            return {"yaw": heading, "north": north, "east": east, "altitude": up}
    return {}


def _called(signals: Sequence[ControlledSignal], name: str) -> ControlledSignal | None:
    return next(
        (signal for signal in signals if signal.name == name or signal.name.endswith(f" {name}")), None
    )


def _whole(signal: ControlledSignal) -> Array:
    if signal.period is None:
        return signal.measured
    return np.asarray(np.unwrap(signal.measured, period=signal.period))


class LiveReference:
    """A vehicle that is flown elsewhere: its telemetry, from the first moment in the air.

    Args:
        leader: the vehicle.
        over: whether the twin should stop following, once the leader was in the air.
    """

    def __init__(self, leader: Drone, over: Callable[[], bool]) -> None:
        self._leader, self._over = leader, over
        self._frame: LocalFrame | None = None
        self._begun = False
        self._headings: deque[tuple[float, float]] = deque()

    def __call__(self, elapsed: float) -> TwinReference | None:
        """Return the last telemetry; NaN while it is silent or stands."""
        seen = self._leader.telemetry
        self._begun = self._begun or (seen.flying and seen.above_home > AIRBORNE)
        if not self._begun:
            return TwinReference(*[nan] * 8)
        if self._over():
            return None
        north = east = nan
        if seen.position is not None and seen.located:
            if self._frame is None:
                at = seen.home or seen.position
                self._frame = LocalFrame(at.latitude, at.longitude, at.altitude.metres)
            place = seen.position
            east, north, _ = self._frame.to_enu(place.latitude, place.longitude, place.altitude.metres)
        heading = nan if seen.stale else seen.attitude.heading
        turn_rate = self._turn_rate(elapsed, heading)
        return TwinReference(heading, north, east, seen.above_home, *seen.velocity, turn_rate)

    def _turn_rate(self, elapsed: float, heading: float) -> float:
        """Return the rate of the heading over ``SLOPE_S``, degrees/s; 0 where it is unknown."""
        if not isfinite(heading):
            self._headings.clear()
            return 0.0
        self._headings.append((elapsed, heading))
        while self._headings[0][0] < elapsed - SLOPE_S:
            self._headings.popleft()
        before, old = self._headings[0]
        return float(wrap(heading - old)) / (elapsed - before) if elapsed - before > SLOPE_S / 2.0 else 0.0


class Twin(LawManoeuvre):
    """Follows a reference.

    Args:
        reference: where to be.
        lowest: height below which the twin does not follow, m.
    """

    def __init__(self, reference: Follow, lowest: float = AIRBORNE) -> None:
        self._reference, self._lowest = reference, lowest
        self._axes = {
            "north": PidLaw(FOLLOW_GAINS),
            "east": PidLaw(FOLLOW_GAINS),
            "altitude": PidLaw(FOLLOW_HEIGHT_GAINS),
        }
        self._yaw = PidLaw(FOLLOW_YAW_GAINS)
        self.laws: dict[str, Law] = {**self._axes, "yaw": self._yaw}
        self._elapsed = 0.0
        self._ended = False

    @property
    def done(self) -> bool:
        """Whether the reference has ended."""
        return self._ended

    def step(self, measured: MeasuredState, sample_s: float) -> tuple[MotionCommand, Sequence[LoopSample]]:
        """Follow the reference by its velocity and by its error."""
        aim = self._reference(self._elapsed)
        self._elapsed += sample_s
        if aim is None:
            self._ended = True
            return MotionCommand(), []
        goals = (aim.north, aim.east, max(self._lowest, aim.up))
        have = (measured.north, measured.east, measured.up)
        ahead = (aim.velocity_north, aim.velocity_east, aim.velocity_up if aim.up > self._lowest else 0.0)
        outputs, samples = [], []
        for (loop, law), goal, value, velocity in zip(self._axes.items(), goals, have, ahead, strict=True):
            feed = velocity if isfinite(velocity) and isfinite(goal) else 0.0
            terms = law(goal, value, sample_s, feed)
            outputs.append(float(terms.output) if isfinite(goal) else 0.0)
            samples.append(LoopSample(loop, "twin", "m", 0.0, goal, value, terms))
        heading = measured.heading + measured.lead
        turn = self._yaw(aim.heading, heading, sample_s, aim.turn_rate if isfinite(aim.turn_rate) else 0.0)
        samples.append(
            LoopSample("yaw", "twin", "deg", DEGREES, aim.heading % DEGREES, measured.heading, turn)
        )
        rate = float(turn.output) if isfinite(aim.heading) else 0.0
        north, east, up = outputs
        return MotionCommand(north, east, up, rate), samples


class TrackingError(NamedTuple):
    """How far a twin was from its reference: root mean square, 95th percentile and greatest value."""

    quantity: str
    unit: str
    rms: float
    p95: float
    greatest: float


SETTLING_S = 5.0
"""Time after the first sample with a reference that is not judged: the twin joins it."""


def tracking_errors(signals: Sequence[ControlledSignal]) -> list[TrackingError]:
    """Return the errors of a twin's loops after it has joined its reference.

    Args:
        signals: what ``read_signals`` returns of the twin's run.
    """
    found, parts = [], {}
    for signal in signals:
        if signal.controller != "twin" or signal.goal is None:
            continue
        late = signal.times >= _joined(signal) + SETTLING_S
        error = signal.goal[late] - signal.measured[late]
        error = np.asarray(wrap(error, signal.period)) if signal.period is not None else error
        error = np.abs(error[np.isfinite(error)])
        if len(error):
            parts[signal.name.rpartition(" ")[2]] = error
            found.append(_summary(signal.name, signal.unit, error))
    if "north" in parts and "east" in parts and len(parts["north"]) == len(parts["east"]):
        distance = np.array([hypot(*pair) for pair in zip(parts["north"], parts["east"], strict=True)])
        found.insert(0, _summary("horizontal", "m", distance))
    return found


def describe_judged(signals: Sequence[ControlledSignal]) -> str:
    """Return in words which part of a twin's flight ``tracking_errors`` judges, and how far away it began.

    Args:
        signals: what ``read_signals`` returns of the twin's run.
    """
    errors = []
    for name in ("north", "east"):
        signal = _called([signal for signal in signals if signal.controller == "twin"], name)
        if signal is None or signal.goal is None or not isfinite(_joined(signal)):
            return "the twin never had a reference"
        first = int(np.searchsorted(signal.times, _joined(signal)))
        errors.append(float(signal.goal[first] - signal.measured[first]))
        begun, ended = float(signal.times[first]), float(signal.times[-1])
    return (
        f"errors from {begun + SETTLING_S:.0f} to {ended:.0f} s; it began to follow at {begun:.0f} s, "
        f"{hypot(*errors):.1f} m from its reference, and the first {SETTLING_S:g} s are not included"
    )


def _joined(signal: ControlledSignal) -> float:
    """Return the time of the first sample with a set-point; infinite without one."""
    if signal.goal is None:
        return inf
    known = np.flatnonzero(np.isfinite(signal.goal))
    return float(signal.times[known[0]]) if len(known) else inf


def _summary(quantity: str, unit: str, error: Array) -> TrackingError:
    rms, p95 = float(np.sqrt(np.mean(error**2))), float(np.percentile(error, 95))
    return TrackingError(quantity, unit, rms, p95, float(np.max(error)))
