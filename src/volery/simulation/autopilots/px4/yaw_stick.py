"""Turn by the yaw stick in ALTCTL and POSCTL: PX4's filter and rate loop on the recorded airframe, SIH's.

While the stick commands a rate, PX4 controls the rate alone; then it holds the heading at which the
filtered rate ended (StickYaw).
"""

from __future__ import annotations

from typing import Final

from volery.simulation.autopilots.px4.airframe_loops import HOVER
from volery.simulation.autopilots.px4.heading_loop import HEADING_GAIN, advance_turn

STEP: Final = 0.01
"""Step of the integration [s]."""

STICK_LAG: Final = 0.08
"""MPC_MAN_Y_TAU [s]."""

ENDED: Final = 1.2e-7
"""Filtered rate below which the stick counts as centred [rad/s]: FLT_EPSILON."""


class YawStick:
    """Rate of turn that a yaw stick results in."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """End the turn."""
        self._wanted = 0.0
        self._turn = (0.0, 0.0, 0.0)
        """Rate, torque and integral, as in ``advance_turn``."""
        self._turned = 0.0
        """Turn since the heading is held [rad]."""

    @property
    def rate(self) -> float:
        """Rate of turn [rad/s, clockwise]."""
        return self._turn[0]

    def step(self, commanded: float, passed: float) -> float:
        """Advance the turn and return its rate [rad/s].

        Args:
            commanded: Rate that the stick commands [rad/s].
            passed: Time [s].
        """
        for _ in range(round(passed / STEP)):
            self._advance(commanded)
        return self.rate

    def _advance(self, commanded: float) -> None:
        self._wanted += STEP / (STICK_LAG + STEP) * (commanded - self._wanted)
        if abs(self._wanted) > ENDED:
            self._turned, wanted = 0.0, self._wanted
        else:
            wanted = -HEADING_GAIN * self._turned
        self._turn = advance_turn(wanted, self._turn, HOVER, STEP)
        self._turned += STEP * self.rate
