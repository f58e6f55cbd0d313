"""Error of EKF2's estimate: a wrong delay of the receiver, and the noise of SIH's sensors.

EKF2 takes a fix to be EKF2_GPS_DELAY (0.11 s) old and corrects its state of that time with it. The receiver
of SIH has no such delay: the estimated position is ahead of the aircraft, and slower than it while it brakes.
The error of one axis moves like EKF2's own states: position, velocity and tilt, corrected at each fix with
the gains to which its covariance settles, and passed on by the output predictor with a lag.

SIH's gyroscope and accelerometer are far noisier than EKF2_GYR_NOISE and EKF2_ACC_NOISE say, so these gains
correct too little: across the heading the velocity wanders by 0.3 m/s, in about 4 s. The attitude loops hold
the estimated tilt, so what is wrong with it pushes the aircraft the other way.
"""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt
from typing import Final, NamedTuple

from volery.base.elementary import cos, sin

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

FROM_CLIMB = (0.0486, 0.0235, 0.00396)
FROM_HEIGHT = (0.0326, 0.0083, 0.00099)
"""The same along the vertical, where the third state is the bias of the accelerometer: EKF2_ACC_B_NOISE, and
at least the deviation of 0.028 m/s^2 below which the filter lets none fall (5e-8 in steps of 8 ms). The
receiver states 0.75 m/s and 1.78 m; of the barometer the filter believes 3.5 m (EKF2_BARO_NOISE)."""

Gains = tuple[tuple[float, float, float], tuple[float, float, float]]

LEVEL: Gains = (FROM_VELOCITY, FROM_POSITION)
VERTICAL: Gains = (FROM_CLIMB, FROM_HEIGHT)

PREDICTOR_LAG: Final = 0.25
"""EKF2_TAU_VEL, EKF2_TAU_POS [s]."""

GRAVITY: Final = 9.80665

IMU_PERIOD: Final = 0.004
"""Time between two samples of SIH's gyroscope and accelerometer, IMU_INTEG_RATE [s]."""

ROLL_NOISE, PITCH_NOISE = 0.14, 0.07
ACCEL_NOISE = (0.5, 1.7, 1.4)
"""Deviation of a sample of SIH's gyroscope [rad/s], of its accelerometer forward, right, down [m/s^2]."""

FIX_VELOCITY_NOISE = (0.06, 0.077, 0.158)
FIX_POSITION_NOISE = (0.2, 0.2, 0.5)
"""Deviation of a fix of PX4's simulated receiver, north, east, down [m/s, m]."""

_WALK: Final = sqrt(IMU_PERIOD * STEP)
"""Deviation of the integral of white samples over a step, over that of a sample [s]."""


class Noise(NamedTuple):
    """What the noise of the sensors adds to the error of one axis in one step."""

    velocity: float = 0.0
    """Integrated noise of the accelerometer [m/s]."""
    tilt: float = 0.0
    """Integrated noise of the gyroscope, as the acceleration that a wrong tilt appears as [m/s^2]."""
    fix_velocity: float = 0.0
    """Error of a fix's velocity [m/s]."""
    fix_position: float = 0.0
    """Error of a fix's position [m]."""


QUIET: Final = Noise()


def sih_noise(draw: Callable[[int], float], heading: float) -> tuple[Noise, Noise, Noise]:
    """Return the noise of one step of PX4's SIH, north, east and down.

    Deviations: ``Sih::reconstruct_sensors_signals`` and ``SensorGpsSim::Run`` of PX4 1.14.

    Args:
        draw: Returns the draw of a stream, 0 to 10, of zero mean and unit variance.
        heading: Heading of the aircraft [rad].
    """
    ahead, aside, down = (_WALK * deviation * draw(axis) for axis, deviation in enumerate(ACCEL_NOISE))
    pitch, roll = GRAVITY * PITCH_NOISE * _WALK * draw(3), GRAVITY * ROLL_NOISE * _WALK * draw(4)
    along, across = cos(heading), sin(heading)
    kicks = (
        (along * ahead - across * aside, along * pitch - across * roll),
        (across * ahead + along * aside, across * pitch + along * roll),
        (down, 0.0),
    )
    north, east, vertical = (
        Noise(*kick, FIX_VELOCITY_NOISE[axis] * draw(5 + axis), FIX_POSITION_NOISE[axis] * draw(8 + axis))
        for axis, kick in enumerate(kicks)
    )
    return north, east, vertical


class EstimateError:
    """Estimated minus true motion along one axis.

    Args:
        gains: Gains of a fix's velocity and position.
    """

    def __init__(self, gains: Gains = LEVEL) -> None:
        self.position = 0.0
        """Error of the position that EKF2 states [m]."""
        self.velocity = 0.0
        """Error of the velocity that EKF2 states [m/s]."""
        self.rate = 0.0
        """Rate at which the error of the position grows [m/s]."""
        self.tilt = 0.0
        """Acceleration that EKF2 sees and the aircraft does not have, its tilt being wrong [m/s^2]; 0 without
        noise, where it is below 0.02, and along the vertical."""
        self._gains = gains
        self._place = self._speed = self._accel = 0.0
        self._steps = 0

    def step(self, velocity: float, accel: float, noise: Noise = QUIET) -> None:
        """Advance by one step.

        Args:
            velocity: True velocity [m/s].
            accel: True acceleration [m/s^2].
            noise: Noise of the sensors.
        """
        self._place += STEP * self._speed
        self._speed += STEP * self._accel + noise.velocity
        self._accel += noise.tilt
        self._steps += 1
        if self._steps >= STEPS_PER_FIX:
            self._steps = 0
            from_velocity, from_position = self._gains
            self._correct(from_velocity, AHEAD * accel + noise.fix_velocity - self._speed)
            self._correct(from_position, AHEAD * velocity + noise.fix_position - self._place)
        if noise.tilt:
            self.tilt = self._accel
        self.velocity += STEP * (self._accel + (self._speed - self.velocity) / PREDICTOR_LAG) + noise.velocity
        self.rate = self.velocity + (self._place - self.position) / PREDICTOR_LAG
        self.position += STEP * self.rate

    def _correct(self, gains: tuple[float, float, float], innovation: float) -> None:
        """Correct position, velocity and acceleration by a fix's innovation."""
        self._place += gains[0] * innovation
        self._speed += gains[1] * innovation
        self._accel += gains[2] * innovation
