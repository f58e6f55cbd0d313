"""Position and velocity loops of PX4 that fly the recorded airframe, SIH's quadrotor.

A vehicle with an airframe of its own has that one's drag and hover thrust, and else the same loops. SIH's
drag is large: the integral winds up against it on a long leg, and the leg ends too far by what it has to
unwind. Position and velocity are those that EKF2 states; they differ from the flown ones by the errors of
``estimate_error``. As in PX4 1.14: PositionControl, TakeoffHandling, MulticopterHoverThrustEstimator.
"""

from __future__ import annotations

from math import isfinite, sqrt
from typing import Final

import numpy as np

from volery.base.numeric_code import numeric
from volery.simulation.autopilots.px4.estimate_error import step_errors
from volery.simulation.autopilots.px4.heading_loop import FULL_THRUST, turn_heading
from volery.simulation.autopilots.px4.loop_state import (
    A_ACCEL,
    A_ESTIMATE,
    A_ESTIMATED_FOR,
    A_FLOWN,
    A_GROUNDED,
    A_HOVER,
    A_INTEGRAL,
    A_MOVING,
    A_POSITION,
    A_RAMP,
    A_SCATTER,
    A_SLOPE,
    A_THRUST,
    A_VARIANCE,
    A_VELOCITY,
    DIRECT,
    E_PUSH,
    E_RATE,
    E_VELOCITY,
    G_DOWN,
    G_DRAG,
    G_FAST,
    G_HOVER,
    G_INTEGRAL,
    G_LEAN,
    G_OWN_HOVER,
    G_PLACE,
    G_RAMP,
    G_SLOPE,
    G_SPEED,
    G_SQUARE_DRAG,
    G_UP,
    GRAVITY,
    I_ACCEL,
    I_POSITION,
    I_TASK,
    I_VELOCITY,
    SUBSTEP,
    T_ACCEL,
    T_POSITION,
    T_VELOCITY,
)
from volery.simulation.world.arithmetic import clip
from volery.simulation.world.state_layout import Array

DRAG: Final = 1.0
"""Drag of the recorded airframe divided by its mass: SIH_KDV / SIH_MASS [1/s]."""

HOVER: Final = GRAVITY / FULL_THRUST
"""Thrust with which it hovers [1]."""

LEAN_LAG: Final = 0.15
THRUST_LAG: Final = 0.06
"""Lag from commanded to flown acceleration in the plane (attitude loops) and along the thrust [s]."""

LEAST_THRUST: Final = 0.12
"""MPC_THR_MIN, in flight."""

SLOPE_SHARE: Final = 0.3859
"""Share of a new derivative of the velocity in the filtered one: MPC_VELD_LP of 5 Hz in a substep."""

WALK: Final = 1.04e-7
"""Growth of the hover thrust's variance [1/s]: HTE_HT_NOISE squared, in steps of 8 ms."""

FIRST_VARIANCE, FIRST_SCATTER, LEAST_SCATTER = 0.01, 5.0, 1.0
"""Of the hover thrust (HTE_HT_ERR_INIT), and of the vertical acceleration [m^2/s^4]; the latter is learnt in
``LEARNT_IN``. SIH's accelerometer scatters by that in a step of EKF2."""

LEARNT_IN: Final = 2.0
EKF_STEP: Final = 0.008
FAST_CLIMB: Final = 2.0
"""HTE_VZ_THR: vertical speed above which a measured acceleration counts less [m/s]."""

VALID_AFTER: Final = 2.0
"""Time after which the loops use the estimate [s]."""


@numeric
def step_loops(row: Array, key: np.uint64, step: int) -> None:
    """Fly one substep.

    Args:
        row: The state.
        key: Key of the noise.
        step: Counter of the noise.
    """
    place, speed, push = (I_POSITION, I_VELOCITY, I_ACCEL)
    if row[I_TASK] != DIRECT:
        place, speed, push = (T_POSITION, T_VELOCITY, T_ACCEL)
    up = _climb_limit(row)
    north, east = _wanted(row, 0, place, speed), _wanted(row, 1, place, speed)
    level = sqrt(north * north + east * east)
    if level > row[G_FAST]:
        north, east = north * row[G_FAST] / level, east * row[G_FAST] / level
    down = clip(_wanted(row, 2, place, speed), -up, row[G_DOWN])
    ramping = row[A_RAMP] < 1.0 and isfinite(row[speed + 2])
    pn = _controlled(row, 0, north, place, speed, row[push])
    pe = _controlled(row, 1, east, place, speed, row[push + 1])
    pd = _controlled(row, 2, down, place, speed, 0.0 if ramping else row[push + 2])
    _fly(row, (north, east, down), (pn, pe, pd), place, speed)
    turn_heading(row)
    step_errors(row, key, step)
    for axis in range(3):
        row[A_MOVING + axis] = row[A_MOVING + axis] + row[E_RATE + axis]
        row[A_POSITION + axis] += row[A_MOVING + axis] * SUBSTEP
        before = row[A_VELOCITY + axis]
        row[A_VELOCITY + axis] = row[A_FLOWN + axis] + row[E_VELOCITY + axis]
        slope = (row[A_VELOCITY + axis] - before) / SUBSTEP
        row[A_SLOPE + axis] += SLOPE_SHARE * (slope - row[A_SLOPE + axis])


@numeric
def _climb_limit(row: Array) -> float:
    """Return the limit of the climb: a take-off's ramp starts where no thrust is left [m/s]."""
    limit: float = row[G_UP]
    if row[A_RAMP] < 1.0:
        row[A_RAMP] = min(1.0, row[A_RAMP] + SUBSTEP / max(SUBSTEP, row[G_RAMP]))
        first = -GRAVITY / row[G_SPEED + 2]
        limit = first + row[A_RAMP] * (limit - first)
    return limit


@numeric
def _wanted(row: Array, axis: int, place: int, speed: int) -> float:
    """Return the velocity that the position loop wants along an axis [m/s]."""
    wanted = row[speed + axis] if isfinite(row[speed + axis]) else 0.0
    if isfinite(row[place + axis]):
        wanted += row[G_PLACE + axis] * (row[place + axis] - row[A_POSITION + axis])
    return wanted


@numeric
def _free(row: Array, axis: int, place: int, speed: int) -> bool:
    """Return whether an axis has no velocity loop."""
    return not isfinite(row[place + axis]) and not isfinite(row[speed + axis])


@numeric
def _controlled(row: Array, axis: int, wanted: float, place: int, speed: int, fed: float) -> float:
    """Return the acceleration that the velocity loop commands along an axis [m/s^2]."""
    push = fed if isfinite(fed) else 0.0
    if not _free(row, axis, place, speed):
        off = wanted - row[A_VELOCITY + axis]
        push += row[G_SPEED + axis] * off + row[A_INTEGRAL + axis]
        push -= row[G_SLOPE + axis] * row[A_SLOPE + axis]
    return push


@numeric
def _fly(
    row: Array,
    wanted: tuple[float, float, float],
    push: tuple[float, float, float],
    place: int,
    speed: int,
) -> None:
    """Turn accelerations into thrust, advance the integrals, and move the airframe."""
    north, east, down = push
    level = sqrt(north * north + east * east)
    share = min(1.0, row[G_LEAN] / level) if level > 0.0 else 1.0
    north, east = north * share, east * share
    least = LEAST_THRUST if row[A_RAMP] >= 1.0 else 0.001
    thrust = clip((1.0 - down / GRAVITY) * row[A_HOVER], least, 1.0)
    supposed = thrust / row[A_HOVER]
    miss = (
        wanted[0] - row[A_VELOCITY],
        wanted[1] - row[A_VELOCITY + 1],
        wanted[2] - row[A_VELOCITY + 2],
    )
    unwind = 0.0
    if supposed * share < 1.0:
        unwind = 2.0 / max(0.1, row[G_SPEED]) * (1.0 - supposed * share)
    if not _free(row, 0, place, speed):
        row[A_INTEGRAL] += row[G_INTEGRAL] * (miss[0] - unwind * push[0]) * SUBSTEP
    if not _free(row, 1, place, speed):
        row[A_INTEGRAL + 1] += row[G_INTEGRAL + 1] * (miss[1] - unwind * push[1]) * SUBSTEP
    stuck = (thrust <= least and miss[2] >= 0.0) or (thrust >= 1.0 and miss[2] <= 0.0)
    if not _free(row, 2, place, speed) and not stuck:
        row[A_INTEGRAL + 2] += row[G_INTEGRAL + 2] * miss[2] * SUBSTEP
    row[A_INTEGRAL + 2] = clip(row[A_INTEGRAL + 2], -GRAVITY, GRAVITY)
    given = thrust / row[G_OWN_HOVER]
    _move(row, north * given, east * given, GRAVITY * (1.0 - given))
    _estimate_hover(row, thrust, down)


@numeric
def _move(row: Array, north: float, east: float, down: float) -> None:
    """Advance the airframe by a substep under commanded accelerations, which it follows with a lag."""
    row[A_THRUST] += SUBSTEP / LEAN_LAG * (north - row[E_PUSH] - row[A_THRUST])
    row[A_THRUST + 1] += SUBSTEP / LEAN_LAG * (east - row[E_PUSH + 1] - row[A_THRUST + 1])
    row[A_THRUST + 2] += SUBSTEP / THRUST_LAG * (down - row[E_PUSH + 2] - row[A_THRUST + 2])
    if row[A_GROUNDED] > 0.0 and row[A_THRUST + 2] < 0.0:
        row[A_GROUNDED] = 0.0
    north, east, down = row[A_FLOWN], row[A_FLOWN + 1], row[A_FLOWN + 2]
    drag = row[G_DRAG] + row[G_SQUARE_DRAG] * sqrt(north * north + east * east + down * down)
    for axis in range(3):
        before = row[A_FLOWN + axis]
        accel = row[A_THRUST + axis] - drag * before
        if row[A_GROUNDED] > 0.0:
            before, accel = 0.0, 0.0
        row[A_ACCEL + axis] = accel
        row[A_FLOWN + axis] = before + accel * SUBSTEP
        row[A_MOVING + axis] = before + 0.5 * accel * SUBSTEP


@numeric
def _estimate_hover(row: Array, thrust: float, push: float) -> None:
    """Estimate the thrust that hovers from thrust and acceleration; the integral keeps the thrust.

    A climb or descent at constant speed against the drag changes the estimate, so that the commanded
    acceleration returns to 0.
    """
    if row[A_GROUNDED] > 0.0 or row[A_RAMP] < 1.0:
        row[A_HOVER] = row[A_ESTIMATE] = row[G_HOVER]
        row[A_VARIANCE], row[A_SCATTER], row[A_ESTIMATED_FOR] = FIRST_VARIANCE, FIRST_SCATTER, 0.0
        return
    estimate = row[A_ESTIMATE]
    slope = GRAVITY * thrust / (estimate * estimate)
    doubt = max(1.0, abs(row[A_VELOCITY + 2]) - FAST_CLIMB + 1.0)
    noise = row[A_SCATTER] * doubt * doubt * EKF_STEP / SUBSTEP
    variance = row[A_VARIANCE] + WALK * SUBSTEP
    gain = -variance * slope / (slope * slope * variance + noise)
    missing = -row[A_ACCEL + 2] - GRAVITY * (thrust / estimate - 1.0)
    row[A_ESTIMATE] = clip(estimate + gain * missing, row[G_HOVER] - 0.2, row[G_HOVER] + 0.2)
    row[A_VARIANCE] = (1.0 + gain * slope) * variance
    row[A_SCATTER] = max(
        LEAST_SCATTER,
        row[A_SCATTER] + SUBSTEP / LEARNT_IN * (LEAST_SCATTER + slope * slope * variance - row[A_SCATTER]),
    )
    row[A_ESTIMATED_FOR] += SUBSTEP
    if row[A_ESTIMATED_FOR] > VALID_AFTER:
        before, after = row[A_HOVER], row[A_ESTIMATE]
        row[A_HOVER] = after
        row[A_INTEGRAL + 2] += (push - GRAVITY) * before / after + GRAVITY - push
