"""One grid step of one body, and the compiled step of a world without autopilots."""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from volery.base.numeric_code import NumericCode, numeric
from volery.simulation.world.dynamics import (
    S_SPEED,
    drive_power,
    electrical_power,
    follow_ground,
    is_pushed,
    multirotor_slope,
    rotation_matrix,
    rover_slope,
    total_thrust,
    turn_rotors,
    turn_wheels,
    volts_amps,
)
from volery.simulation.world.environment_models import GUST_EVERY, advance_gust, ground_height
from volery.simulation.world.scene import Cylinder, SceneArrays, contact, top_below
from volery.simulation.world.sensors import sample_sensors
from volery.simulation.world.state_layout import (
    ACTIVE_STEPS,
    ADVANCED,
    BODIES_ARGUMENTS,
    MOTION,
    MOTION_AWAITED,
    MOTION_GIVEN,
    MULTIROTOR,
    OWN_LAWS,
    P_FEET,
    P_GRAVITY,
    P_IDLE_POWER,
    P_KIND,
    P_MASS,
    P_REACH,
    P_ROTORS,
    ROTORS,
    S_AMPS,
    S_ATTITUDE,
    S_CHARGE,
    S_COLLISION,
    S_COLLISIONS,
    S_CONTACT_SPEED,
    S_CONTACTS,
    S_DISTANCE,
    S_ENERGY,
    S_GROUND,
    S_GUST,
    S_ON_GROUND,
    S_PAYLOAD_ENERGY,
    S_POSITION,
    S_RATES,
    S_RESTING,
    S_ROTORS,
    S_SPECIFIC_FORCE,
    S_STARTED,
    S_VELOCITY,
    S_VOLTS,
    STEP_S,
    U_FORCE,
    U_MOTION,
    U_MOVED,
    U_PAYLOAD,
    U_SPEEDS,
    U_THROTTLE,
    U_WIND,
    W_AIR_VELOCITY,
    W_GROUND,
    W_LAST_VELOCITY,
    W_ROTATION,
    W_SLOPE,
    W_STATE,
    W_THROTTLE,
    Array,
    Bodies,
)


def world_sources() -> list[Path]:
    """Return the source files of this package."""
    return list(Path(__file__).parent.glob("*.py"))


_STILL_SPEED = 0.02  # [m/s]
_STILL_RATE = 0.05  # [rad/s]
_LIGHT = 0.7  # fraction of the weight: with less thrust a landed body stays where it is
_STEP_UP = 0.02  # [m] a body sunk into a top by less still stands on it
_BREAKS = 0.3  # [m/s] into a solid that breaks blades; with less a body is only held off
_REBOUND = 0.2  # coefficient of restitution of an airframe on a wall
_STANDING_ROTOR = 1e-6  # [rad/s] below which a rotor stands: it would slow down for ever, in denormal numbers


@numeric
def _slope(row: Array, flying: bool) -> None:
    if flying:
        multirotor_slope(row)
    else:
        rover_slope(row)


@numeric
def _drive(row: Array, flying: bool, at: int, to: int) -> None:
    if flying:
        turn_rotors(row, at, to)
    else:
        turn_wheels(row, at, to)


@numeric
def _advance(row: Array, flying: bool) -> None:
    """Advance the motion by a step of the midpoint method (Runge 1895), rotors and wheels by their exact law.

    A body at rest keeps its position; its rotors may turn.
    """
    if row[S_RESTING] > 0.5:
        if flying:
            turn_rotors(row, 0, W_STATE)
            turn_rotors(row, W_STATE, 0)
        return
    for i in range(ADVANCED):
        row[W_STATE + i] = row[i]
    _slope(row, flying)
    for i in range(MOTION):
        row[W_STATE + i] = row[i] + 0.5 * STEP_S * row[W_SLOPE + i]
    _drive(row, flying, 0, W_STATE)
    _slope(row, flying)
    for i in range(MOTION):
        row[i] += STEP_S * row[W_SLOPE + i]
    _drive(row, flying, W_STATE, 0)


@numeric
def _take_motion(row: Array) -> None:
    """Take the motion that was given, and rotor speeds, which follow their own law where none are given."""
    for i in range(MOTION):
        row[i] = row[U_MOTION + i]
    turn_rotors(row, 0, W_STATE)
    turn_rotors(row, W_STATE, 0)
    for i in range(int(row[P_ROTORS])):
        if row[U_SPEEDS + i] == row[U_SPEEDS + i]:
            row[S_ROTORS + i] = row[U_SPEEDS + i]


@numeric
def _normalise(row: Array) -> None:
    square = 0.0
    for i in range(4):
        square += row[S_ATTITUDE + i] * row[S_ATTITUDE + i]
    norm = sqrt(square)
    for i in range(4):
        row[S_ATTITUDE + i] /= norm


@numeric
def _touches(row: Array) -> bool:
    lowest = (
        row[P_FEET] * abs(row[W_ROTATION + 6])
        + row[P_FEET + 1] * abs(row[W_ROTATION + 7])
        + row[P_FEET + 2] * abs(row[W_ROTATION + 8])
    )
    touching: bool = row[S_POSITION + 2] - lowest < row[S_GROUND]
    return touching


@numeric
def _settle_multirotor(row: Array) -> None:
    """Update contact and rest at the end of a multirotor's step."""
    touching = _touches(row)
    if touching and row[S_ON_GROUND] == 0.0:
        row[S_CONTACT_SPEED] = max(0.0, -row[W_LAST_VELOCITY + 2])
        row[S_CONTACTS] += 1.0
    row[S_ON_GROUND] = 1.0 if touching else 0.0
    light = total_thrust(row) < _LIGHT * row[P_MASS] * row[P_GRAVITY] and not is_pushed(row)
    speed = 0.0
    spin = 0.0
    for axis in range(3):
        speed = max(speed, abs(row[S_VELOCITY + axis]), abs(row[W_LAST_VELOCITY + axis]))  # not a rebound
        spin = max(spin, abs(row[S_RATES + axis]))
    still = row[S_RESTING] > 0.5 or (speed < _STILL_SPEED and spin < _STILL_RATE)
    resting = touching and light and still and row[U_MOVED] == OWN_LAWS
    row[S_RESTING] = 1.0 if resting else 0.0
    if resting:
        for axis in range(3):
            row[S_VELOCITY + axis] = 0.0
            row[S_RATES + axis] = 0.0
        for i in range(int(row[P_ROTORS])):
            if row[S_ROTORS + i] < _STANDING_ROTOR:
                row[S_ROTORS + i] = 0.0


@numeric
def _settle_rover(row: Array, height_before: float) -> None:
    """Update height, velocity and rest at the end of a rover's step."""
    climb = (row[S_GROUND] - height_before) / STEP_S
    row[S_ON_GROUND] = 1.0
    resting = row[W_THROTTLE + 1] == 0.0 and row[W_THROTTLE] == 0.0 and abs(row[S_SPEED]) < 0.01
    row[S_RESTING] = 1.0 if resting else 0.0
    if resting:
        row[S_SPEED] = 0.0
        climb = 0.0
    follow_ground(row, row[S_GROUND], climb)


@numeric
def _measure_motion(row: Array) -> None:
    """Compute the step's mean specific force in body axes, and add to the distance travelled."""
    ae = (row[S_VELOCITY] - row[W_LAST_VELOCITY]) / STEP_S
    an = (row[S_VELOCITY + 1] - row[W_LAST_VELOCITY + 1]) / STEP_S
    au = (row[S_VELOCITY + 2] - row[W_LAST_VELOCITY + 2]) / STEP_S + row[P_GRAVITY]
    for axis in range(3):
        row[S_SPECIFIC_FORCE + axis] = (
            row[W_ROTATION + axis] * ae + row[W_ROTATION + 3 + axis] * an + row[W_ROTATION + 6 + axis] * au
        )
    if row[U_MOVED] != OWN_LAWS and row[U_FORCE] == row[U_FORCE]:
        for axis in range(3):
            row[S_SPECIFIC_FORCE + axis] = row[U_FORCE + axis]
    square = 0.0
    for axis in range(3):
        square += row[S_VELOCITY + axis] * row[S_VELOCITY + axis]
    row[S_DISTANCE] += sqrt(square) * STEP_S


@numeric
def _load_battery(row: Array, flying: bool) -> None:
    """Compute the voltage and the current at the terminals, which hold until the end of the next step."""
    power = electrical_power(row) if flying else _rover_power(row)
    volts, amps = volts_amps(row, power)
    row[S_VOLTS] = volts
    row[S_AMPS] = amps


@numeric
def _discharge(row: Array, flying: bool) -> None:
    """Draw charge and energy of a step from the battery, by the method of Heun (1900)."""
    amps, watts = row[S_AMPS], row[S_VOLTS] * row[S_AMPS]
    row[S_CHARGE] += STEP_S * amps
    _load_battery(row, flying)
    row[S_CHARGE] += 0.5 * STEP_S * (row[S_AMPS] - amps)
    row[S_ENERGY] += 0.5 * STEP_S * (watts + row[S_VOLTS] * row[S_AMPS])
    row[S_PAYLOAD_ENERGY] += row[U_PAYLOAD] * STEP_S


@numeric
def _rover_power(row: Array) -> float:
    """Return the power [W] that a rover draws from its battery."""
    acceleration = (row[S_SPEED] - row[W_STATE + S_SPEED]) / (0.5 * STEP_S)
    drive = drive_power(row, row[S_SPEED], acceleration)
    power: float = drive + row[P_IDLE_POWER] + row[U_PAYLOAD]
    return power


@numeric
def _collide(scene: SceneArrays, row: Array, flying: bool, k: int) -> None:
    """Hold a body off the solids of the scene; a multirotor that flies into one breaks its blades.

    A rover stops, and can go on in another direction. A body that is moved from outside is not held off.
    """
    east, north, up = row[S_POSITION], row[S_POSITION + 1], row[S_POSITION + 2]
    tall = row[P_FEET + 2] if flying else row[P_REACH]
    low = up - tall if flying else up
    centre = up if flying else up + 0.5 * tall
    body = Cylinder(east, north, low, centre, up + tall, row[P_REACH])
    solid, depth, out_east, out_north, out_up = contact(scene, body)
    if solid < 0:
        return
    held = row[U_MOVED] == OWN_LAWS
    if held:
        row[S_POSITION] += depth * out_east
        row[S_POSITION + 1] += depth * out_north
        row[S_POSITION + 2] += depth * out_up
    into = -(out_east * row[S_VELOCITY] + out_north * row[S_VELOCITY + 1] + out_up * row[S_VELOCITY + 2])
    if into <= 0.0:
        return
    if flying and held:
        back = (1.0 + _REBOUND) * into
        row[S_VELOCITY] += back * out_east
        row[S_VELOCITY + 1] += back * out_north
        row[S_VELOCITY + 2] += back * out_up
    elif not flying:
        row[S_SPEED] = 0.0
    if into > _BREAKS and not (flying and row[S_COLLISIONS] > 0.0):
        row[S_COLLISIONS] += 1.0
        row[S_COLLISION] = k
        row[S_COLLISION + 1] = solid
        row[S_COLLISION + 2] = into
        row[S_COLLISION + 3] = east
        row[S_COLLISION + 4] = north
        row[S_COLLISION + 5] = up


@numeric
def step_body(bodies: Bodies, body: int, row: Array) -> None:
    """Advance one body to its next grid step under the commands in ``W_THROTTLE``, and take its samples.

    The motion of one that is moved from outside must have been given.

    Args:
        bodies: All arrays.
        body: Index of the body.
        row: The body's row.
    """
    key = bodies.keys[body]
    scene = SceneArrays(bodies.solids, bodies.edges, bodies.cells, bodies.lattice)
    flying = row[P_KIND] == MULTIROTOR
    if flying and row[S_COLLISIONS] > 0.0:  # its blades are broken
        for i in range(int(row[P_ROTORS])):
            row[W_THROTTLE + i] = 0.0
    for axis in range(3):
        row[W_LAST_VELOCITY + axis] = row[S_VELOCITY + axis]
        row[W_AIR_VELOCITY + axis] = row[U_WIND + axis] + row[S_GUST + axis]
    row[W_GROUND] = row[S_GROUND]
    if row[U_MOVED] == OWN_LAWS:
        _advance(row, flying)
    else:
        _take_motion(row)
    _collide(scene, row, flying, bodies.reached[body] + 1)
    height_before = row[S_POSITION + 2]
    row[S_GROUND] = max(
        ground_height(bodies.heights, bodies.grid, row[S_POSITION], row[S_POSITION + 1]),
        top_below(scene, row[S_POSITION], row[S_POSITION + 1], row[S_POSITION + 2] + _STEP_UP),
    )
    if flying:
        if row[S_RESTING] == 0.0:
            _normalise(row)
        rotation_matrix(row, S_ATTITUDE, W_ROTATION)
        _settle_multirotor(row)
    else:
        _settle_rover(row, height_before)
        rotation_matrix(row, S_ATTITUDE, W_ROTATION)
    _measure_motion(row)
    _discharge(row, flying)
    if row[U_MOVED] == MOTION_GIVEN:
        row[U_MOVED] = MOTION_AWAITED
    k = bodies.reached[body] + 1
    bodies.reached[body] = k
    if k % GUST_EVERY == 0:
        advance_gust(row, key, k)
    sample_sensors(row, key, k)


@numeric
def start_body(bodies: Bodies, body: int, row: Array) -> None:
    """Take the samples of the first grid step, before any motion."""
    rotation_matrix(row, S_ATTITUDE, W_ROTATION)
    for axis in range(3):
        row[S_SPECIFIC_FORCE + axis] = row[W_ROTATION + 6 + axis] * row[P_GRAVITY]
    _load_battery(row, row[P_KIND] == MULTIROTOR)
    sample_sensors(row, bodies.keys[body], bodies.reached[body])
    row[S_STARTED] = 1.0


@numeric
def goal_of(bodies: Bodies, body: int) -> int:
    """Return the grid step to advance a body to: its own if it has not been read for a while."""
    goal = bodies.span[2]
    return int(goal if goal - bodies.read[body] < ACTIVE_STEPS else bodies.reached[body])


@numeric
def is_finite(row: Array) -> bool:
    """Return whether position, motion and rotor speeds are finite numbers."""
    total = 0.0
    for i in range(ADVANCED):
        total += row[i] - row[i]
    return total == 0.0


def _compose(digest: str) -> Callable[..., int]:
    def advance_bodies(  # noqa: PLR0913, PLR0917  # the arrays of Bodies
        rows: Array, keys: NDArray[np.uint64], reached: NDArray[np.int64], heights: Array, grid: Array,
        read: NDArray[np.int64], span: NDArray[np.int64], solids: Array, edges: Array,
        cells: NDArray[np.int64], lattice: Array,
    ) -> int:  # fmt: skip
        bodies = Bodies(rows, keys, reached, heights, grid, read, span, solids, edges, cells, lattice)
        finite = True
        for body in range(span[0], span[1]):
            row = rows[body]
            if row[S_STARTED] == 0.0:
                start_body(bodies, body, row)
            goal = goal_of(bodies, body)
            while reached[body] < goal:
                for i in range(ROTORS):
                    row[W_THROTTLE + i] = row[U_THROTTLE + i]
                if row[U_MOVED] == MOTION_AWAITED:
                    break
                step_body(bodies, body, row)
            finite = finite and is_finite(row)
        return 1 if digest and finite else 0

    return advance_bodies


advance_bodies = NumericCode("advance_bodies", _compose, world_sources(), BODIES_ARGUMENTS)
"""Advance the bodies of the span with the motor commands in their inputs, without an autopilot."""
