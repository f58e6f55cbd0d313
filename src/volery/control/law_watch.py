"""What ends a law in flight: an error that grows, and a vehicle that does not follow its commands.

``vehicles.monitors.FollowMonitor`` notices set-points without any effect in every program. Here, the
effect of a law's commands is measured, also of those that are given by sticks. Both watches look at each
sample of a flight and return what is wrong in words. What the vehicle does then is decided in ``flight``: it
holds, then lands by the autopilot.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from math import copysign, hypot, isfinite, nan
from typing import NamedTuple

from volery.control.actuation import MeasuredState, MotionCommand
from volery.control.laws import Law, PidLaw, wrap
from volery.control.manoeuvres import LoopSample

GROWTH_M, GROWTH_DEG = 5.0, 90.0
"""Growth of an error that ends a law, above the least one since the set-point changed."""
GROWN_FOR_S = 1.0
"""Time for which it must last: a position that jumps back is no reason."""
WITHIN_DEG = 10.0
"""Error of the heading within which a flight ends where it should."""

WINDOW_S = (10.0, 10.0, 5.0, 5.0)
"""Time north, east, up and of a turn within which a command must show an effect. The first half is left to
delays and to braking, and in the plane to wind: a tilted drone drifts until its velocity loop has the tilt.
"""
FOLLOWED = 0.2
"""Share of what was commanded in the second half that must be seen."""
LEAST_ASKED = (8.0, 8.0, 1.0, 20.0)
"""Way north, east and up in m and turn in degrees, in each half, below which nothing is judged."""


class ErrorWatch:
    """Notices an error that grows, loop by loop.

    Args:
        laws: laws by loop, whose gains are named.
    """

    def __init__(self, laws: Mapping[str, Law]) -> None:
        self._laws = laws
        self.reset()

    def reset(self) -> None:
        """Begin anew, after a takeover."""
        self._least: dict[str, tuple[float, float]] = {}  # set-point and least error since it changed
        self._grown_s: dict[str, float] = {}

    def check(self, samples: Iterable[LoopSample], sample_s: float) -> str:
        """Return which error has grown, from what to what and under which gains; empty if none has.

        Args:
            samples: the loops of one sample.
            sample_s: time since the last sample, s.
        """
        for sample in samples:
            error = abs(float(sample.terms.error))
            if sample.unit not in {"m", "deg"} or not isfinite(error):
                continue
            goal, least = self._least.get(sample.loop, (sample.goal, error))
            least = min(least, error) if goal == sample.goal else error
            self._least[sample.loop] = sample.goal, least
            most = least + (GROWTH_M if sample.unit == "m" else GROWTH_DEG)
            grown_s = self._grown_s.get(sample.loop, 0.0) + sample_s if error > most else 0.0
            self._grown_s[sample.loop] = grown_s
            if grown_s >= GROWN_FOR_S:
                return (
                    f"the error of {sample.loop} grew from {least:.1f} to {error:.1f} {sample.unit}, beyond "
                    f"the limit of {most:.1f} {sample.unit}, under {self._law(sample.loop)}"
                )
        return ""

    def _law(self, loop: str) -> str:
        law = self._laws.get(loop)
        if not isinstance(law, PidLaw):
            return "its law"
        return f"kp {law.gains.kp:.3g}, ki {law.gains.ki:.3g}, kd {law.gains.kd:.3g}"


class _Sums(NamedTuple):
    """What was asked for, and what came by position and by velocity, up to a time; by axis."""

    at_s: float
    asked: list[float]
    came: list[float]
    felt: list[float]


class FollowWatch:
    """Notices a vehicle that does not move as it is commanded.

    Judged is a command that has kept its sign for ``WINDOW_S``: what came in the second half of that time,
    against what was asked for in either half. It came if the position says so, or the vehicle's velocity: an
    estimator may hold both apart for a while (PX4 1.15 in SIH: 10 s at -0.4 m/s, with a height that rose).
    """

    AXES = ("north", "east", "up", "turn")

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Begin anew, after a takeover."""
        self._now_s = 0.0
        self._asked, self._came, self._felt = [0.0] * 4, [0.0] * 4, [0.0] * 4
        self._steady_s = [0.0] * 4
        self._command = MotionCommand()
        self._last: MeasuredState | None = None
        self._seen: deque[_Sums] = deque()

    def check(self, command: MotionCommand, measured: MeasuredState, sample_s: float) -> str:
        """Return what was asked and what came, if the vehicle does not follow; else an empty text.

        Args:
            command: command that is applied from now on.
            measured: what was measured before.
            sample_s: time since the last sample, s.
        """
        self._now_s += sample_s
        moved = self._motion(measured)
        speeds = measured.velocity_north, measured.velocity_east, measured.velocity_up, nan
        for axis, (way, speed) in enumerate(zip(moved, speeds, strict=True)):
            asked, before = command[axis], self._command[axis]
            kept = isfinite(way) and asked * before > 0.0
            self._steady_s[axis] = self._steady_s[axis] + sample_s if kept else 0.0
            self._asked[axis] += before * sample_s
            self._came[axis] += way if isfinite(way) else 0.0
            self._felt[axis] += speed * sample_s if isfinite(speed) else 0.0
        self._command, self._last = command, measured
        self._seen.append(_Sums(self._now_s, list(self._asked), list(self._came), list(self._felt)))
        while self._seen[0].at_s < self._now_s - max(WINDOW_S):
            self._seen.popleft()
        return next(filter(None, map(self._judged, range(4))), "")

    def _motion(self, now: MeasuredState) -> tuple[float, float, float, float]:
        last = self._last or now
        turned = float(wrap(now.heading - last.heading)) if isfinite(now.heading - last.heading) else nan
        return now.north - last.north, now.east - last.east, now.up - last.up, turned

    def _judged(self, axis: int) -> str:
        window_s = WINDOW_S[axis]
        if self._steady_s[axis] < window_s:
            return ""
        first, middle = self._before(window_s), self._before(window_s / 2.0)
        asked = min(middle.asked[axis] - first.asked[axis], self._asked[axis] - middle.asked[axis], key=abs)
        ways = self._came[axis] - middle.came[axis], self._felt[axis] - middle.felt[axis]
        came = max(ways, key=lambda way: way * copysign(1.0, asked))
        unit = "deg" if axis == 3 else "m"
        if abs(asked) < LEAST_ASKED[axis] or came * copysign(1.0, asked) >= FOLLOWED * abs(asked):
            return ""
        return (
            f"it does not follow: {asked:.1f} {unit} {self.AXES[axis]} were asked for within "
            f"{window_s / 2.0:g} s, {came:.1f} {unit} came"
        )

    def _before(self, seconds: float) -> _Sums:
        """Return what was noted that long ago; samples follow each other evenly."""
        span = self._now_s - self._seen[0].at_s
        share = min(1.0, seconds / span) if span > 0.0 else 1.0
        return self._seen[round((1.0 - share) * (len(self._seen) - 1))]


def ended_off(samples: Iterable[LoopSample], accuracy_m: float) -> str:
    """Return how far from its last set-points a manoeuvre has ended, if that is too far; else an empty text.

    Args:
        samples: the last sample of each loop.
        accuracy_m: distance within which it ends where it should, m.
    """
    errors = {sample.loop: (float(sample.terms.error), sample.unit) for sample in samples}
    distance = hypot(*(error for error, unit in errors.values() if unit == "m"))
    turn = max((abs(error) for error, unit in errors.values() if unit == "deg"), default=0.0)
    if not distance <= accuracy_m:
        return f"{distance:.1f} m from its set-point, beyond {accuracy_m:g} m"
    return (
        "" if turn <= WITHIN_DEG else f"{turn:.0f} degrees from its set-point, beyond {WITHIN_DEG:g} degrees"
    )
