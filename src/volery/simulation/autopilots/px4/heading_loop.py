"""How PX4 turns the nose of the recorded airframe, SIH's quadrotor: it swings past a new course.

The heading set-point moves with MPC_YAWRAUTO_MAX, and its rate is fed forward. The rate loop is hardly faster
than MC_YAW_P, because SIH_Q_MAX is small, so the nose follows 0.4 s behind and swings by 15 degrees past the
end of a turn. It turns about the axis of the thrust; while the aircraft leans, the heading turns farther.

As in PX4 1.14: FlightTaskAuto, AttitudeControl, RateControl, ControlAllocationSequentialDesaturation, Sih.
"""

from __future__ import annotations

from math import isfinite, nan, pi, sqrt
from typing import Final

from volery.base.elementary import atan2, sine_cosine
from volery.base.numeric_code import numeric
from volery.simulation.autopilots.px4.loop_state import (
    A_AXES,
    A_GROUNDED,
    A_HEADING,
    A_THRUST,
    A_TURN,
    A_YAWING,
    DIRECT,
    G_TURN,
    GRAVITY,
    I_TASK,
    I_YAW,
    I_YAW_RATE,
    SUBSTEP,
    T_YAW,
    T_YAW_RATE,
)
from volery.simulation.world.arithmetic import clip, wrap_angle
from volery.simulation.world.state_layout import Array

STEP: Final = 0.004
"""Step of the rate loop in SIH [s]."""

STEPS: Final = 5
"""Number of these in a substep."""

FEED_SHARE: Final = SUBSTEP / (SUBSTEP + 0.2)
"""Share of a new rate of the set-point in the one that is fed forward: a filter of 0.2 s."""

HEADING_GAIN, WEIGHT = 2.8, 0.4
"""MC_YAW_P [1/s], MC_YAW_WEIGHT."""

FASTEST_TURN: Final = 200.0 * pi / 180.0
"""MC_YAWRATE_MAX [rad/s]."""

RATE_GAIN, RATE_INTEGRAL, MOST_INTEGRAL = 0.2, 0.1, 0.3
"""MC_YAWRATE_P, MC_YAWRATE_I, MC_YR_INT_LIM."""

INTEGRAL_FADES_AT: Final = 400.0 * pi / 180.0
"""Error of the rate at which the integral no longer grows [rad/s]."""

TORQUE: Final = 0.4
"""Torque of a full command, four times SIH_Q_MAX [N m]."""

MOTOR_LAG: Final = 0.05
"""SIH_T_TAU [s]."""

INERTIA, DAMPING = 0.03, 0.025
"""SIH_IZZ [kg m^2] and SIH_KDW [N m s]."""

FULL_THRUST: Final = 20.0
"""Acceleration by full thrust, four times SIH_T_MAX / SIH_MASS [m/s^2]."""

OVER_FULL: Final = 1.15
"""Motor command up to which a turn may raise one; thrust is reduced for it."""

LEAST_LIFT: Final = 0.1 * GRAVITY
"""Least upward acceleration of the thrust that its direction is taken from [m/s^2]."""


@numeric
def advance_turn(
    wanted: float, turn: tuple[float, float, float], most: float, step: float
) -> tuple[float, float, float]:
    """Advance a turn about the axis of the thrust by a step.

    Args:
        wanted: Rate that is commanded [rad/s].
        turn: Rate of turn [rad/s], torque [N m] and integral of the rate loop.
        most: Largest command that the motors can follow.
        step: Time [s].

    Returns:
        The turn after the step.
    """
    rate, torque, integral = turn
    miss = wanted - rate
    command = RATE_GAIN * miss + integral
    held = clip(command, -most, most)
    if (command - held) * miss <= 0.0:
        fading = miss / INTEGRAL_FADES_AT
        grown = integral + max(0.0, 1.0 - fading * fading) * RATE_INTEGRAL * miss * step
        integral = clip(grown, -MOST_INTEGRAL, MOST_INTEGRAL)
    torque += step / MOTOR_LAG * (TORQUE * held - torque)
    rate += step * (torque - DAMPING * rate) / INERTIA
    return rate, torque, integral


@numeric
def turn_heading(row: Array) -> None:
    """Turn the nose by one substep, towards ``I_YAW`` or with ``I_YAW_RATE``; on the ground it stands."""
    if row[A_GROUNDED] > 0.0:
        for number in range(3):
            row[A_YAWING + number] = 0.0
        row[A_TURN] = 0.0
        return
    if row[A_AXES + 8] == 0.0:
        write_axes(row)
    miss, fed = _heading_error(row)
    fed *= row[A_AXES + 8]
    north, east, down, accel = _thrust_axis(row)
    share = accel / FULL_THRUST
    most = max(0.0, min(share, OVER_FULL - share))
    turn, turned = (row[A_YAWING], row[A_YAWING + 1], row[A_YAWING + 2]), 0.0
    for _ in range(STEPS):
        wanted = fed
        if isfinite(miss):
            s, _ = sine_cosine(0.5 * WEIGHT * (miss - turned))
            wanted += 2.0 * HEADING_GAIN / WEIGHT * s
        turn = advance_turn(clip(wanted, -FASTEST_TURN, FASTEST_TURN), turn, most, STEP)
        turned += STEP * turn[0]
    row[A_YAWING], row[A_YAWING + 1], row[A_YAWING + 2] = turn
    ahead_north = row[A_AXES] + turned * row[A_AXES + 1]
    ahead_east = row[A_AXES + 3] + turned * row[A_AXES + 4]
    ahead_down = row[A_AXES + 6] + turned * row[A_AXES + 7]
    along = ahead_north * north + ahead_east * east + ahead_down * down
    heading = atan2(ahead_east - along * east, ahead_north - along * north)
    row[A_TURN] = wrap_angle(heading - row[A_HEADING]) / SUBSTEP
    row[A_HEADING] = heading


@numeric
def _heading_error(row: Array) -> tuple[float, float]:
    """Return the heading's error about the thrust's axis [rad], NaN: none, and the rate to be fed forward."""
    fed = row[I_YAW_RATE] if isfinite(row[I_YAW_RATE]) else 0.0
    if row[I_TASK] == DIRECT:
        if not isfinite(row[I_YAW]):
            return nan, fed
        row[T_YAW] = row[I_YAW]
    else:
        _limit_setpoint(row)
        fed = row[T_YAW_RATE]
    s, c = sine_cosine(row[T_YAW])
    down = -(c * row[A_AXES + 2] + s * row[A_AXES + 5]) / row[A_AXES + 8]
    ahead = c * row[A_AXES] + s * row[A_AXES + 3] + down * row[A_AXES + 6]
    aside = c * row[A_AXES + 1] + s * row[A_AXES + 4] + down * row[A_AXES + 7]
    return atan2(aside, ahead), fed


@numeric
def _limit_setpoint(row: Array) -> None:
    """Move the set-point towards the wanted heading, if there is one, and filter its rate."""
    rate = 0.0
    if isfinite(row[I_YAW]):
        rate = clip(wrap_angle(row[I_YAW] - row[T_YAW]) / SUBSTEP, -row[G_TURN], row[G_TURN])
    row[T_YAW] = wrap_angle(row[T_YAW] + SUBSTEP * rate)
    row[T_YAW_RATE] += FEED_SHARE * (rate - row[T_YAW_RATE])


@numeric
def _thrust_axis(row: Array) -> tuple[float, float, float, float]:
    """Return the body's axis down, against the thrust: north, east, down; and what the thrust accelerates."""
    north, east, down = -row[A_THRUST], -row[A_THRUST + 1], max(LEAST_LIFT, GRAVITY - row[A_THRUST + 2])
    length = sqrt(north * north + east * east + down * down)
    return north / length, east / length, down / length, length


@numeric
def write_axes(row: Array) -> None:
    """Turn the body's axes: down against the thrust, forward to the heading."""
    north, east, down, _ = _thrust_axis(row)
    s, c = sine_cosine(row[A_HEADING])
    ahead = -(c * north + s * east) / down
    level = 1.0 / sqrt(1.0 + ahead * ahead)
    c, s, ahead = c * level, s * level, ahead * level
    row[A_AXES], row[A_AXES + 3], row[A_AXES + 6] = c, s, ahead
    row[A_AXES + 1] = east * ahead - down * s
    row[A_AXES + 4] = down * c - north * ahead
    row[A_AXES + 7] = north * s - east * c
    row[A_AXES + 2], row[A_AXES + 5], row[A_AXES + 8] = north, east, down
