"""PX4's trajectory of the automatic modes: straight to a point, with limited speed, acceleration and jerk.

As in PX4 1.14 (PositionSmoothing, VelocitySmoothing): the velocity towards the point is what braking over the
remaining distance allows. Each axis changes to it with the largest jerk in the shortest time, and the faster
axes take as long as the slowest. The trajectory's time runs slower, down to standing still, the farther the
vehicle is behind it in the plane (MPC_XY_ERR_MAX).
"""

from __future__ import annotations

from math import sqrt
from typing import Final

from volery.base.numeric_code import numeric
from volery.simulation.autopilots.px4.loop_state import (
    A_POSITION,
    G_BEHIND,
    G_JERK,
    G_PUSH,
    G_SINK,
    I_AT_VEHICLE,
    I_DOWN,
    I_LIFT,
    I_POSITION,
    I_SPEED,
    I_TASK,
    I_UP,
    SINK,
    SUBSTEP,
    T_ACCEL,
    T_POSITION,
    T_VELOCITY,
)
from volery.simulation.world.state_layout import Array

CLAMP_EACH: Final = 0.5
"""Speed below which a limit no longer keeps the direction of the trajectory [m/s], as in PX4's sources."""

SAME: Final = 1e-9


@numeric
def braking_speed(jerk: float, accel: float, distance: float) -> float:
    """Return the speed from which a distance suffices to brake, with time for the jerk [m/s]."""
    ramp = 4.0 * accel * accel / jerk
    return 0.5 * (sqrt(ramp * ramp + 8.0 * accel * distance) - ramp)


@numeric
def straight(
    north: float, east: float, down: float, plane: float, along: float
) -> tuple[float, float, float]:
    """Return the velocity along a straight line that exceeds neither the plane's nor the height's limit.

    Below ``CLAMP_EACH`` a limit shortens its own components alone: a slow end of the height does not slow the
    plane. As PX4's ``clampToXYNorm`` and ``clampToZNorm`` do.

    Args:
        north: Distance to the north [m]; likewise ``east`` and ``down``.
        east: To the east.
        down: Downwards.
        plane: Limit of the speed in the plane [m/s].
        along: Limit of the vertical speed [m/s].
    """
    level, height = sqrt(north * north + east * east), abs(down)
    distance = sqrt(level * level + height * height)
    if distance < SAME:
        return 0.0, 0.0, 0.0
    share = sqrt(plane * plane + along * along) / distance
    sideways, upright = share, share
    if level * sideways > plane:
        if plane >= CLAMP_EACH or level * sideways >= CLAMP_EACH:
            upright *= plane / (level * sideways)
        sideways = plane / level
    if height * upright > along:
        if along >= CLAMP_EACH or height * upright >= CLAMP_EACH:
            sideways *= along / (height * upright)
        upright = along / height
    return north * sideways, east * sideways, down * upright


@numeric
def towards(accel: float, change: float, jerk: float) -> float:
    """Return the sign of the jerk with which a velocity begins to change by *change* [m/s]."""
    missing = change - 0.5 * accel * abs(accel) / jerk
    if missing != 0.0:
        return 1.0 if missing > 0.0 else -1.0
    if accel != 0.0:
        return 1.0 if accel > 0.0 else -1.0
    return 0.0


@numeric
def _rising(accel: float, jerk: float, most: float, rising: float) -> float:
    """Limit the time of the first jerk [s] to that in which the largest acceleration is reached."""
    reached = accel + jerk * rising
    if reached > most:
        rising = (most - accel) / jerk
    elif reached < -most:
        rising = (-most - accel) / jerk
    return max(0.0, rising)


@numeric
def shortest(accel: float, change: float, jerk: float, most: float) -> tuple[float, float, float]:
    """Return how long the jerk, no jerk and the opposite jerk last for the fastest change of a velocity [s].

    Args:
        accel: Present acceleration [m/s^2]; it is 0 at the end.
        change: Change of the velocity [m/s].
        jerk: The first jerk, with its sign [m/s^3].
        most: Largest acceleration [m/s^2].
    """
    root = 0.5 * accel * accel + jerk * change
    rising = -accel / jerk + sqrt(root) / abs(jerk) if root > 0.0 else 0.0
    rising = _rising(accel, jerk, most, rising)
    falling = max(0.0, accel / jerk + rising)
    peak, steady = accel + jerk * rising, 0.0
    if abs(peak) > SAME:
        gained = rising * (accel + 0.5 * jerk * rising) + falling * (peak - 0.5 * jerk * falling)
        steady = max(0.0, (change - gained) / peak)
    return rising, steady, falling


@numeric
def within(accel: float, change: float, jerk: float, most: float, time: float) -> tuple[float, float, float]:
    """Return how long the jerk, no jerk and the opposite jerk last for a change that takes *time* [s]."""
    size = abs(jerk)
    root = time * time * size * size + 2.0 * time * accel * jerk - accel * accel - 4.0 * jerk * change
    rising = 0.0
    if root >= 0.0:
        rising = max(0.0, 0.5 * (time - accel / jerk - sqrt(root) / size))
        falling = accel / jerk + rising
        if falling < 0.0 or rising + falling > time:
            rising = 0.0
    rising = _rising(accel, jerk, most, rising)
    falling = max(0.0, accel / jerk + rising)
    return rising, max(0.0, time - rising - falling), falling


@numeric
def _advance(row: Array, axis: int, jerk: float, passed: float) -> None:
    """Advance one axis by a time under a constant jerk."""
    accel, speed = row[T_ACCEL + axis], row[T_VELOCITY + axis]
    row[T_POSITION + axis] += passed * (speed + passed * (0.5 * accel + passed * jerk / 6.0))
    row[T_VELOCITY + axis] = speed + passed * (accel + 0.5 * passed * jerk)
    row[T_ACCEL + axis] = accel + passed * jerk


@numeric
def _change(row: Array, axis: int, jerk: float, times: tuple[float, float, float], passed: float) -> None:
    """Advance one axis on its way to another velocity."""
    rising, steady, falling = times
    part = min(passed, rising)
    _advance(row, axis, jerk, part)
    passed -= part
    part = min(passed, steady)
    if part > 0.0:
        _advance(row, axis, 0.0, part)
        passed -= part
    part = min(passed, falling)
    if part > 0.0:
        _advance(row, axis, -jerk, part)
        passed -= part
    if passed > 0.0:
        row[T_ACCEL + axis] = 0.0
        _advance(row, axis, 0.0, passed)


@numeric
def pace(row: Array) -> float:
    """Return the pace of the trajectory's time, 0 to 1: slower the farther the vehicle is behind it."""
    north, east = row[T_POSITION] - row[A_POSITION], row[T_POSITION + 1] - row[A_POSITION + 1]
    if row[G_BEHIND] <= 0.0 or north * row[T_VELOCITY] + east * row[T_VELOCITY + 1] < 0.0:
        return 1.0
    share: float = sqrt(north * north + east * east) / row[G_BEHIND]
    return 1.0 - min(1.0, share)


@numeric
def wished_velocity(row: Array) -> tuple[float, float, float]:
    """Return the velocity towards the point, north, east, down [m/s]."""
    north, east = row[I_POSITION] - row[T_POSITION], row[I_POSITION + 1] - row[T_POSITION + 1]
    level = sqrt(north * north + east * east)
    plane = min(row[I_SPEED], braking_speed(row[G_JERK], row[G_PUSH], level))
    if row[I_TASK] == SINK:
        share = plane / level if level > SAME else 0.0
        return north * share, east * share, row[I_DOWN]
    down = row[I_POSITION + 2] - row[T_POSITION + 2]
    climbs = down < 0.0
    lift, most = (row[I_LIFT], row[I_UP]) if climbs else (row[G_SINK], row[I_DOWN])
    return straight(north, east, down, plane, min(most, braking_speed(row[G_JERK], lift, abs(down))))


@numeric
def move_trajectory(row: Array) -> None:
    """Move the trajectory by one substep."""
    if row[I_AT_VEHICLE] > 0.0:
        row[T_POSITION + 2] = row[A_POSITION + 2]
    passed = SUBSTEP * pace(row)
    north, east, down = wished_velocity(row)
    limit = row[G_JERK]
    lift = row[I_LIFT] if down < 0.0 else row[G_SINK]
    a, b, c = row[T_ACCEL], row[T_ACCEL + 1], row[T_ACCEL + 2]
    dn, de, dd = north - row[T_VELOCITY], east - row[T_VELOCITY + 1], down - row[T_VELOCITY + 2]
    jn, je, jd = towards(a, dn, limit) * limit, towards(b, de, limit) * limit, towards(c, dd, limit) * limit
    none = (0.0, 0.0, 0.0)
    tn = shortest(a, dn, jn, row[G_PUSH]) if jn != 0.0 else none
    te = shortest(b, de, je, row[G_PUSH]) if je != 0.0 else none
    td = shortest(c, dd, jd, lift) if jd != 0.0 else none
    ln, le, ld = tn[0] + tn[1] + tn[2], te[0] + te[1] + te[2], td[0] + td[1] + td[2]
    longest = max(ln, le, ld)
    if jn != 0.0 and ln < longest:
        tn = within(a, dn, jn, row[G_PUSH], longest)
    if je != 0.0 and le < longest:
        te = within(b, de, je, row[G_PUSH], longest)
    if jd != 0.0 and ld < longest:
        td = within(c, dd, jd, lift, longest)
    _change(row, 0, jn, tn, passed)
    _change(row, 1, je, te, passed)
    _change(row, 2, jd, td, passed)
