"""Error of EKF2's horizontal estimate where the receiver delivers sooner than EKF2_GPS_DELAY states.

EKF2 takes a fix to be EKF2_GPS_DELAY (0.11 s) old and corrects its state of that time with it. The receiver
of SIH has no such delay: the estimated position is ahead of the aircraft, and slower than it while it brakes.
The error of one axis moves like EKF2's own states: position, velocity and tilt, corrected at each fix with
the gains to which its covariance settles, and passed on by the output predictor with a lag.
"""

from __future__ import annotations

from typing import Final

STEP: Final = 0.02
"""Step of the integration [s]."""

STEPS_PER_FIX: Final = 6
"""Steps between two fixes: 8 Hz, the rate of PX4's simulated receiver."""

AHEAD: Final = 0.06
"""Time by which the estimate is ahead of the aircraft [s]: position error over speed in six logged flights
of PX4 1.14 in SIH, 0.04 to 0.09."""

FROM_VELOCITY = (0.0607, 0.0396, 0.00874)
FROM_POSITION = (0.0556, 0.0177, 0.00266)
"""Gains of a fix's velocity [s, 1, 1/s] and position [1, 1/s, 1/s^2] on position, velocity and the
acceleration that a wrong tilt appears as: the steady state of the filter with EKF2_ACC_NOISE 0.35 and
EKF2_GYR_NOISE 0.015 in steps of EKF2_PREDICT_US; the receiver states deviations of 0.5 m/s and 0.9 m."""

PREDICTOR_LAG: Final = 0.25
"""EKF2_TAU_VEL, EKF2_TAU_POS [s]."""


class DelayError:
    """Estimated minus true motion along one horizontal axis."""

    def __init__(self) -> None:
        self.position = 0.0
        """Error of the position that EKF2 states [m]."""
        self.velocity = 0.0
        """Error of the velocity that EKF2 states [m/s]."""
        self.rate = 0.0
        """Rate at which the error of the position grows [m/s]."""
        self._place = self._speed = self._accel = 0.0
        self._steps = 0

    def step(self, velocity: float, accel: float) -> None:
        """Advance by one step.

        Args:
            velocity: True velocity [m/s].
            accel: True acceleration [m/s^2].
        """
        self._place += STEP * self._speed
        self._speed += STEP * self._accel
        self._steps += 1
        if self._steps >= STEPS_PER_FIX:
            self._steps = 0
            self._correct(FROM_VELOCITY, AHEAD * accel - self._speed)
            self._correct(FROM_POSITION, AHEAD * velocity - self._place)
        self.velocity += STEP * (self._accel + (self._speed - self.velocity) / PREDICTOR_LAG)
        self.rate = self.velocity + (self._place - self.position) / PREDICTOR_LAG
        self.position += STEP * self.rate

    def _correct(self, gains: tuple[float, float, float], innovation: float) -> None:
        """Correct position, velocity and tilt by a fix's innovation."""
        self._place += gains[0] * innovation
        self._speed += gains[1] * innovation
        self._accel += gains[2] * innovation
