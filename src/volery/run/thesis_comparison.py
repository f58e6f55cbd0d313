"""The thesis's comparison of On/Off, P and PID on steps of the heading, flown again beside a law of ours.

The thesis (A ROS enabled quadrotor, Luleå 2013, section 3.3) turned an ArduCopter through RC override and
printed what it read off its figures. The same laws are flown on a simulated ArduCopter: through the yaw
channel in altitude hold, at 10 Hz, about the thesis's trim of 1480 µs. Our law flies the same steps at 20 Hz.
At the end a push turns the drone by 50 degrees, as a hand did at second 83 of the thesis's figure 3.14.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from volery.base.time import MS
from volery.control.actuation import (
    RC_SCALES,
    Actuation,
    MeasuredState,
    MotionCommand,
    RcOverride,
    thesis_scale,
)
from volery.control.flight import ControlledFlight
from volery.control.laws import wrap
from volery.control.log_signals import read_signals
from volery.control.manoeuvres import YAW_LAWS, Rotation
from volery.control.step_response import ControlledSignal, StepResponse, step_responses
from volery.control.vehicle_answer import LoopAnswer
from volery.run.fly import fly
from volery.run.result import Options
from volery.vehicles import Drone

STEPS = (45.0, 90.0, 120.0, 180.0)
HOLD_S = 20.0
PUSH_RATE = 73.0
"""Turn rate of the push, degrees/s, through the yaw channel: the law has no influence meanwhile."""
PUSHED_UNTIL = 10.0
"""Turn at which the push ends, degrees; the drone then turns on to about 50."""
PUSH_AFTER_S = 12.0
"""Time of the push after the last step, s."""
OURS = "pid"
ADDRESS = "sim:ardupilot?start=warm"


class ThesisRow(NamedTuple):
    """What the thesis states of its own PID law."""

    steps: str
    overshoot: str
    settled_10: str
    settled_3: str
    source: str


THESIS = (
    ThesisRow("below 120", "none stated", "3", "16 (2 to 3 %)", "section 3.3, figure 3.14"),
    ThesisRow("larger", "about 50 deg", "10", "12", "section 3.3, figure 3.14, second 50"),
)


class FlownLaw(NamedTuple):
    """One law: its record, and the response to each step in the order of ``STEPS``."""

    law: str
    signal: ControlledSignal
    responses: Sequence[StepResponse]


class _Push:
    """An actuation whose yaw channel a push overrides, from a time until the drone has turned.

    Args:
        inner: applies the commands before and after.
        at: time of the push since the first sample, s.
    """

    def __init__(self, inner: RcOverride, at: float) -> None:
        self._inner, self._at = inner, at
        self._elapsed = 0.0
        self._from: float | None = None
        self._over = False
        self.take_off, self.engage = inner.take_off, inner.engage

    @property
    def answer(self) -> LoopAnswer | None:
        """None: a law that is pushed is not watched."""
        return None

    @property
    def lead(self) -> float:
        """Turn in degrees that is still to come."""
        return self._inner.lead

    def apply(self, command: MotionCommand, measured: MeasuredState, sample_s: float) -> None:
        """Apply a command, or the push."""
        self._elapsed += sample_s
        if self._elapsed >= self._at and not self._over:
            self._from = measured.heading if self._from is None else self._from
            self._over = abs(float(wrap(measured.heading - self._from))) >= PUSHED_UNTIL
            pulse = RC_SCALES["ArduPilot"].turn.pulse(PUSH_RATE)
            axis = self._inner.scale.turn
            command = command._replace(yaw_rate=(pulse - axis.trim - axis.dead) / axis.per_unit)
        self._inner.apply(command, measured, sample_s)


def fly_thesis_comparison(
    folder: Path, laws: Sequence[str] = tuple(YAW_LAWS), on: str = ADDRESS, seed: int = 1
) -> list[FlownLaw]:
    """Fly each law and return its responses.

    Args:
        folder: where the run folders are written, one for each law.
        laws: names of ``YAW_LAWS``.
        on: address of a simulated or real ArduCopter.
        seed: seed of the simulation.

    Raises:
        VoleryError: a flight failed.
    """
    return [_fly(law, folder / law, on, seed) for law in laws]


def _fly(law: str, folder: Path, on: str, seed: int) -> FlownLaw:
    headings = [0.0]
    for step in STEPS:
        headings.append((headings[-1] + step) % 360.0)
    pushed_at = HOLD_S * len(STEPS) + PUSH_AFTER_S

    def mission(drone: Drone) -> None:
        ours = law == OURS
        inner = RcOverride(drone) if ours else RcOverride(drone, thesis_scale(), gains=None)
        actuation: Actuation = _Push(inner, pushed_at)
        turns = Rotation(headings, HOLD_S, YAW_LAWS[law](), law, holds_place=ours)
        drone.wait_ready()
        period = 50 * MS if ours else 100 * MS
        ControlledFlight(drone, turns, actuation, period=period).run()

    rates = "attitude=50&rate=20" if law == OURS else "attitude=10&rate=10"
    address = f"{on}{'&' if '?' in on else '?'}{rates}"
    run = fly(mission, address, Options(out=folder, seed=seed))
    if not run.completed:
        raise run.error or KeyboardInterrupt  # a signal ends this flight, and with it the series
    (signal,) = (signal for signal in read_signals(folder) if signal.name == "yaw")
    responses = [response for response in step_responses(signal) if abs(response.size) > STEPS[0] / 2.0]
    return FlownLaw(law, replace(signal, controller=law), responses[-len(STEPS) :])


OFFSET = (
    "P: the yaw channel has a dead band of 20 us about 1500 us, and the law's trim is 1480 us. At 2 us per "
    "degree, an error of up to 20 degrees on one side commands nothing; on the other side every error does. "
    "Hence the offset of the thesis, and why it is larger towards positive headings."
)
"""Why the thesis's P law stops short of its set-point."""
