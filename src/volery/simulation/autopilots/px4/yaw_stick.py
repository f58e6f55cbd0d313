"""Turn by the yaw stick in ALTCTL and POSCTL: PX4's filter and rate loop on the recorded airframe, SIH's.

While the stick commands a rate, PX4 controls the rate alone; then it holds the heading at which the
filtered rate ended (StickYaw).
"""

from __future__ import annotations

from typing import Final

STEP: Final = 0.01
"""Step of the integration [s]."""

STICK_LAG: Final = 0.08
"""MPC_MAN_Y_TAU [s]."""

ENDED: Final = 1.2e-7
"""Filtered rate below which the stick counts as centred [rad/s]: FLT_EPSILON."""

HEADING_GAIN: Final = 2.8
"""MC_YAW_P [1/s]."""

RATE_GAIN, RATE_INTEGRAL, MOST_INTEGRAL = 0.2, 0.1, 0.3
"""MC_YAWRATE_P, MC_YAWRATE_I, MC_YR_INT_LIM."""

TORQUE: Final = 0.4
"""Torque of a full command, four times SIH_Q_MAX [N m]."""

MOTOR_LAG: Final = 0.05
"""SIH_T_TAU [s]."""

INERTIA, DAMPING = 0.03, 0.025
"""SIH_IZZ [kg m^2] and SIH_KDW [N m s]."""


class YawStick:
    """Rate of turn that a yaw stick results in."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """End the turn."""
        self.rate = 0.0
        """Rate of turn [rad/s, clockwise]."""
        self._wanted = self._integral = self._torque = 0.0
        self._turned = 0.0
        """Turn since the heading is held [rad]."""

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
        miss = wanted - self.rate
        command = RATE_GAIN * miss + self._integral
        grown = self._integral + RATE_INTEGRAL * miss * STEP
        self._integral = max(-MOST_INTEGRAL, min(MOST_INTEGRAL, grown))
        self._torque += STEP / MOTOR_LAG * (TORQUE * command - self._torque)
        self.rate += STEP * (self._torque - DAMPING * self.rate) / INERTIA
        self._turned += STEP * self.rate
