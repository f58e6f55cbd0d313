"""What is flown under the laws: turns, climbs, way points and the landing.

A manoeuvre has set-points and laws, and returns a command for each sample, together with the terms of its
loops for the record. It knows neither the drone nor how the command is applied.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from math import hypot, inf, isfinite
from typing import NamedTuple

from volery.base.errors import UsageError
from volery.control.actuation import MeasuredState, MotionCommand
from volery.control.laws import DEGREES, Law, OnOffGains, OnOffLaw, PidGains, PidLaw, Terms, per_sample

YAW_GAINS = PidGains(
    kp=2.2, ki=0.02, kd=0.1, filter_s=0.05, low=-200.0, high=200.0, deceleration=170.0, period=DEGREES
)
"""From degrees of heading to degrees/s."""
POSITION_GAINS = PidGains(kp=0.9, ki=0.02, low=-4.0, high=4.0, deceleration=1.2)
"""From m to m/s over ground."""
HEIGHT_GAINS = PidGains(kp=1.0, ki=0.05, low=-1.5, high=2.0, deceleration=0.8)
"""From m to m/s of climb."""

STUCK_AFTER_S = 60.0
"""Time in s without coming nearer to a way point after which it is given up."""
THESIS_SAMPLE_S = 0.1
"""Sample time of the thesis's laws: roscopter's default rate of 10 Hz."""
_KP, _KI, _KD = per_sample(2.0, 0.1, 0.07, THESIS_SAMPLE_S)
THESIS_PID = PidGains(kp=_KP, ki=_KI, kd=_KD, on_measurement=False, period=DEGREES)
"""The thesis's gains of 2, 0.1 and 0.07 per sample: from degrees to µs of the yaw channel, without limits."""
THESIS_P = PidGains(kp=2.0, period=DEGREES)
"""The thesis's proportional law, from degrees to µs."""
THESIS_ON_OFF = OnOffGains(amplitude=150.0, hysteresis=2.0, neutral=5.0, period=DEGREES)
"""An On/Off law in µs. The thesis names none of its figures; these are chosen here."""


class LoopSample(NamedTuple):
    """One sample of one loop, for the record."""

    loop: str
    controller: str
    unit: str
    period: float
    goal: float
    measurement: float
    terms: Terms


class LawManoeuvre(ABC):
    """A sequence of set-points under laws.

    Attributes:
        laws: laws by loop, so that gains can be changed in flight.
    """

    laws: Mapping[str, Law]

    accuracy: float = 1.0
    """Distance in m from the last set-point within which it ends where it should."""

    @property
    @abstractmethod
    def done(self) -> bool:
        """Whether it has ended."""

    @property
    def stuck(self) -> str:
        """Why it will not end, in words; empty while it goes on."""
        return ""

    @abstractmethod
    def step(self, measured: MeasuredState, sample_s: float) -> tuple[MotionCommand, Sequence[LoopSample]]:
        """Return the command of one sample and the terms of its loops.

        Args:
            measured: what is measured.
            sample_s: time since the last sample, s.
        """

    def reset(self) -> None:
        """Begin anew after a takeover: no integral from before is used."""
        for law in self.laws.values():
            if isinstance(law, PidLaw | OnOffLaw):
                law.reset()


def set_gains(manoeuvre: LawManoeuvre, loop: str, gains: PidGains) -> None:
    """Change the gains of a loop without a bump, also in flight.

    Raises:
        UsageError: there is no such loop, or it has no PID law.
    """
    law = manoeuvre.laws.get(loop)
    if not isinstance(law, PidLaw):
        known = [name for name, one in manoeuvre.laws.items() if isinstance(one, PidLaw)]
        raise UsageError(f"no PID law of a loop {loop!r}; there is {', '.join(known) or 'none'}")
    law.gains = gains


class _Hold:
    """Holds the place that was measured first, along the loops that it is given.

    Args:
        laws: laws of ``north``, ``east`` and, to hold the height, too, ``altitude``.
    """

    def __init__(self, laws: Mapping[str, PidLaw]) -> None:
        self.laws = laws
        self.at: Mapping[str, float] | None = None

    def step(self, measured: MeasuredState, sample_s: float) -> tuple[MotionCommand, list[LoopSample]]:
        here = {"north": measured.north, "east": measured.east, "altitude": measured.up}
        if self.at is None and all(map(isfinite, here.values())):
            self.at = here
        if self.at is None:
            return MotionCommand(), []
        outputs, samples = dict.fromkeys(here, 0.0), []
        for loop, law in self.laws.items():
            terms = law(self.at[loop], here[loop], sample_s)
            outputs[loop] = float(terms.output)
            samples.append(LoopSample(loop, "PID", "m", 0.0, self.at[loop], here[loop], terms))
        return MotionCommand(outputs["north"], outputs["east"], outputs["altitude"]), samples


def _plane_laws() -> dict[str, PidLaw]:
    return {"north": PidLaw(POSITION_GAINS), "east": PidLaw(POSITION_GAINS)}


class Rotation(LawManoeuvre):
    """Turns to one heading after the other, and holds each for the same time.

    Args:
        headings: set-points in degrees, clockwise from north.
        hold_s: time for each, s.
        law: law of the heading; its output is the command's ``yaw_rate``, in the unit of the yaw channel.
        controller: name of the law, for the record.
        holds_place: whether the place is held meanwhile; the thesis left it to the wind.
    """

    def __init__(
        self,
        headings: Sequence[float],
        hold_s: float = 15.0,
        law: Law | None = None,
        controller: str = "PID",
        *,
        holds_place: bool = True,
    ) -> None:
        if not headings or not all(map(isfinite, headings)):
            raise UsageError(f"rotation to {list(headings)}: give at least one heading in degrees")
        if not hold_s > 0.0:
            raise UsageError(f"rotation: each heading for {hold_s:g} s; give a time above 0")
        self._headings = list(headings)
        self._hold_s = hold_s
        held = {**_plane_laws(), "altitude": PidLaw(HEIGHT_GAINS)} if holds_place else {}
        self._place = _Hold(held)
        self.laws = {"yaw": law or PidLaw(YAW_GAINS), **held}
        self._controller = controller
        self._elapsed = 0.0

    @property
    def done(self) -> bool:
        """Whether every heading has had its time."""
        return self._elapsed >= self._hold_s * len(self._headings)

    def step(self, measured: MeasuredState, sample_s: float) -> tuple[MotionCommand, Sequence[LoopSample]]:
        """Turn to the present heading."""
        index = min(int(self._elapsed / self._hold_s), len(self._headings) - 1)
        self._elapsed += sample_s
        goal = self._headings[index]
        terms = self.laws["yaw"](goal, measured.heading + measured.lead, sample_s)
        sample = LoopSample("yaw", self._controller, "deg", DEGREES, goal, measured.heading, terms)
        place, held = self._place.step(measured, sample_s)
        return place._replace(yaw_rate=float(terms.output)), [sample, *held]


class Altitude(LawManoeuvre):
    """Climbs or descends to one height after the other, and holds each for the same time.

    Args:
        heights: set-points in m above home.
        hold_s: time for each, s.
        law: law of the height; its output is a climb rate in m/s.
        controller: name of the law, for the record.
    """

    def __init__(
        self, heights: Sequence[float], hold_s: float = 15.0, law: Law | None = None, controller: str = "PID"
    ) -> None:
        if not heights or not all(isfinite(height) and height > 0.0 for height in heights):
            raise UsageError(f"altitude {list(heights)}: give at least one height above home, above 0 m")
        if not hold_s > 0.0:
            raise UsageError(f"altitude: each height for {hold_s:g} s; give a time above 0")
        self._heights = list(heights)
        self._hold_s = hold_s
        held = _plane_laws()
        self._place = _Hold(held)
        self.laws = {"altitude": law or PidLaw(HEIGHT_GAINS), **held}
        self._controller = controller
        self._elapsed = 0.0

    @property
    def done(self) -> bool:
        """Whether every height has had its time."""
        return self._elapsed >= self._hold_s * len(self._heights)

    def step(self, measured: MeasuredState, sample_s: float) -> tuple[MotionCommand, Sequence[LoopSample]]:
        """Climb or descend to the present height."""
        index = min(int(self._elapsed / self._hold_s), len(self._heights) - 1)
        self._elapsed += sample_s
        goal = self._heights[index]
        terms = self.laws["altitude"](goal, measured.up, sample_s)
        sample = LoopSample("altitude", self._controller, "m", 0.0, goal, measured.up, terms)
        place, held = self._place.step(measured, sample_s)
        return place._replace(up=float(terms.output)), [sample, *held]


class Corner(NamedTuple):
    """A way point that was reached, and the greatest distance from it while it was held, m."""

    number: int
    error: float


class Waypoints(LawManoeuvre):
    """Flies to way points one after the other and holds each.

    Args:
        points: north, east and up of home in m.
        tolerance: distance from a point within which it counts as reached, m.
        hold_s: time within the tolerance before the next point, s.
        rounds: how often the whole sequence is flown.
        heading: heading to keep, degrees; ``None`` keeps the first one.
        gains: gains of the horizontal and of the vertical law.
    """

    def __init__(
        self,
        points: Sequence[tuple[float, float, float]],
        *,
        tolerance: float = 0.1,
        hold_s: float = 1.0,
        rounds: int = 1,
        heading: float | None = None,
        gains: tuple[PidGains, PidGains] = (POSITION_GAINS, HEIGHT_GAINS),
    ) -> None:
        if not points or not all(isfinite(value) for point in points for value in point):
            raise UsageError("way points: give at least one, as north, east and up in m")
        if not tolerance > 0.0 or rounds < 1:
            raise UsageError(f"way points: tolerance {tolerance:g} m, {rounds} rounds; give both above 0")
        self._points = list(points) * rounds
        self._tolerance, self._hold_s = tolerance, hold_s
        self.accuracy = max(self.accuracy, tolerance)
        horizontal, vertical = gains
        self._place = {"north": PidLaw(horizontal), "east": PidLaw(horizontal), "altitude": PidLaw(vertical)}
        self._yaw = PidLaw(YAW_GAINS)
        self.laws: Mapping[str, Law] = {**self._place, "yaw": self._yaw}
        self._heading = heading
        self._index = 0
        self._within = 0.0
        self._worst = 0.0
        self._nearest, self._for_s = inf, 0.0
        self.corners: list[Corner] = []

    @property
    def done(self) -> bool:
        """Whether the last point was reached and held."""
        return self._index >= len(self._points)

    def reset(self) -> None:
        """Begin anew after a takeover, from where it then is."""
        super().reset()
        self._nearest, self._for_s = inf, 0.0

    @property
    def stuck(self) -> str:
        """Why the present point is not reached, in words."""
        if self.done or self._for_s < STUCK_AFTER_S + self._hold_s:
            return ""
        return (
            f"way point {self._index + 1} of {len(self._points)} was not held within {self._tolerance:g} m "
            f"for {self._hold_s:g} s, though {self._for_s:.0f} s passed without coming nearer than "
            f"{self._nearest:.2f} m; a larger tolerance may do"
        )

    def step(self, measured: MeasuredState, sample_s: float) -> tuple[MotionCommand, Sequence[LoopSample]]:
        """Fly towards the present point."""
        here = measured.north, measured.east, measured.up
        if self._heading is None and isfinite(measured.heading):
            self._heading = measured.heading
        self._advance(here, sample_s)
        goals = self._points[min(self._index, len(self._points) - 1)]
        outputs, samples = [], []
        for (loop, law), goal, value in zip(self._place.items(), goals, here, strict=True):
            terms = law(goal, value, sample_s)
            outputs.append(float(terms.output))
            samples.append(LoopSample(loop, "PID", "m", 0.0, goal, value, terms))
        turn = self._yaw(self._heading or 0.0, measured.heading + measured.lead, sample_s)
        north, east, up = outputs
        return MotionCommand(north, east, up, float(turn.output)), samples

    def _advance(self, here: tuple[float, float, float], sample_s: float) -> None:
        """Go on to the next point once the present one was held."""
        if self.done:
            return
        goal = self._points[self._index]
        distance = hypot(*(a - b for a, b in zip(here, goal, strict=True)))
        nearer = distance < self._nearest
        self._nearest, self._for_s = (distance, 0.0) if nearer else (self._nearest, self._for_s + sample_s)
        if not distance <= self._tolerance:
            self._within, self._worst = 0.0, 0.0
            return
        self._within += sample_s
        self._worst = max(self._worst, distance)
        if self._within >= self._hold_s:
            self.corners.append(Corner(self._index, self._worst))
            self._index += 1
            self._within, self._worst = 0.0, 0.0
            self._nearest, self._for_s = inf, 0.0


def cube(
    side: float, height: float, corner: tuple[float, float] = (0.0, 0.0)
) -> list[tuple[float, float, float]]:
    """Return the corners of a cube, the lower square first, and back to the first corner.

    Args:
        side: length of an edge, m.
        height: height of the lower square above home, m.
        corner: north and east of the first corner, m.
    """
    north, east = corner
    square = [
        (north, east),
        (north + side, east),
        (north + side, east + side),
        (north, east + side),
        (north, east),
    ]
    return [(*at, height) for at in square] + [(*at, height + side) for at in square]


class SteppedDescent(LawManoeuvre):
    """Descends in place through intermediate heights, slower from each to the next, and keeps the heading.

    The last part is flown at ``touch_down``, so that a wrong height does no harm. It never ends by itself:
    the flight ends when the drone has landed.

    Args:
        steps: height in m from which on a rate of descent in m/s is flown, falling.
        touch_down: rate of descent below the last of them, m/s.
    """

    STEPS = ((15.0, 2.0), (8.0, 1.2), (3.0, 0.8))
    TOUCH_DOWN = 0.45

    def __init__(self, steps: Sequence[tuple[float, float]] = STEPS, touch_down: float = TOUCH_DOWN) -> None:
        self._steps, self._touch_down = steps, touch_down
        self._place = _Hold(_plane_laws())
        self._yaw = PidLaw(YAW_GAINS)
        self._heading: float | None = None
        self.laws: Mapping[str, Law] = {**self._place.laws, "yaw": self._yaw}

    @property
    def done(self) -> bool:
        """False: the flight ends with the ground."""
        return False

    def reset(self) -> None:
        """Land where the drone is now."""
        super().reset()
        self._place.at = None
        self._heading = None

    def rate(self, height: float) -> float:
        """Return the rate of descent at *height* m above home; an unknown height is a low one."""
        return next((rate for above, rate in self._steps if height > above), self._touch_down)

    def duration(self, height: float) -> float:
        """Return the time in s that the descent from *height* m takes."""
        seconds = 0.0
        for above, rate in self._steps:
            seconds += max(0.0, height - above) / rate
            height = min(height, above)
        return seconds + max(0.0, height) / self._touch_down

    def step(self, measured: MeasuredState, sample_s: float) -> tuple[MotionCommand, Sequence[LoopSample]]:
        """Descend."""
        place, held = self._place.step(measured, sample_s)
        if self._heading is None and isfinite(measured.heading):
            self._heading = measured.heading
        turn = self._yaw(self._heading or 0.0, measured.heading + measured.lead, sample_s)
        rate = self.rate(measured.up)
        terms = Terms(rate + measured.velocity_up, 0.0, 0.0, 0.0, -rate, -rate)
        sample = LoopSample("landing", "ramp", "m/s", 0.0, -rate, measured.velocity_up, terms)
        return place._replace(up=-rate, yaw_rate=float(turn.output)), [sample, *held]


YAW_LAWS: Mapping[str, Callable[[], Law]] = {
    "on-off": lambda: OnOffLaw(THESIS_ON_OFF),
    "p": lambda: PidLaw(THESIS_P),
    "pid-thesis": lambda: PidLaw(THESIS_PID),
    "pid": lambda: PidLaw(YAW_GAINS),
}
"""Laws of the heading by name. All but ``pid`` have outputs in µs, for ``thesis_scale``."""
