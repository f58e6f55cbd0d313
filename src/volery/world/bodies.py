"""One grid step of one body of either kind: law, ground, wind, sensors. Composed steps are made of it."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import njit
from numpy.typing import NDArray

from volery.world.columns import (
    INTEGRATED,
    MULTIROTOR,
    P_FEET,
    P_GRAVITY,
    P_IDLE_POWER,
    P_KIND,
    P_MASS,
    S_AMPS,
    S_ATTITUDE,
    S_AWAKE,
    S_CONTACT_SPEED,
    S_CONTACTS,
    S_DISTANCE,
    S_FORCE,
    S_GROUND,
    S_GUST,
    S_ON_GROUND,
    S_PAYLOAD_ENERGY,
    S_POSITION,
    S_RATES,
    S_RESTING,
    S_VELOCITY,
    S_VOLTS,
    U_PAYLOAD,
    U_THROTTLE,
    U_WIND,
    Advance,
    Array,
    Bodies,
    Work,
)
from volery.world.compiled import digest_of, world_sources
from volery.world.multirotor import (
    electrical_power,
    lift,
    multirotor_slope,
    rotation_matrix,
    volts_amps,
)
from volery.world.rover import S_SPEED, drive_power, follow_ground, rover_slope
from volery.world.sensors import sense
from volery.world.terrain import ground_height
from volery.world.wind import GUST_EVERY, blow

STEP_S = 0.002
_STILL_SPEED = 0.02  # [m/s]
_STILL_RATE = 0.05  # [rad/s]
_LIGHT = 0.7  # of its weight: a body whose rotors lift less than this stays where it landed


@njit(cache=False)
def new_work() -> Work:
    """Scratch for one compiled call."""
    return Work(
        np.zeros(INTEGRATED),
        np.zeros(INTEGRATED),
        np.zeros(INTEGRATED),
        np.zeros((3, 3)),
        np.zeros(3),
        np.zeros(3),
        np.zeros(3),
        np.zeros(1),
        np.zeros(4),
        np.zeros(3),
        np.zeros((3, 3)),
        np.zeros(3),
    )


@njit(cache=False)
def _slope(flying: bool, inputs: Array, parameters: Array, work: Work, resting: bool) -> None:
    if flying:
        multirotor_slope(work.y, inputs, parameters, work, resting)
    else:
        rover_slope(work.y, inputs, parameters, work, resting)


@njit(cache=False)
def _integrate(flying: bool, state: Array, inputs: Array, parameters: Array, work: Work) -> None:
    """The classical fourth-order Runge-Kutta step (Kutta 1901) of the integrated columns."""
    resting = state[S_RESTING] > 0.5
    y, slope, total = work.y, work.slope, work.total
    for i in range(INTEGRATED):
        y[i] = state[i]
    _slope(flying, inputs, parameters, work, resting)
    for i in range(INTEGRATED):
        total[i] = slope[i]
        y[i] = state[i] + 0.5 * STEP_S * slope[i]
    _slope(flying, inputs, parameters, work, resting)
    for i in range(INTEGRATED):
        total[i] += 2.0 * slope[i]
        y[i] = state[i] + 0.5 * STEP_S * slope[i]
    _slope(flying, inputs, parameters, work, resting)
    for i in range(INTEGRATED):
        total[i] += 2.0 * slope[i]
        y[i] = state[i] + STEP_S * slope[i]
    _slope(flying, inputs, parameters, work, resting)
    for i in range(INTEGRATED):
        state[i] += STEP_S / 6.0 * (total[i] + slope[i])


@njit(cache=False)
def _normalise(state: Array) -> None:
    square = 0.0
    for i in range(4):
        square += state[S_ATTITUDE + i] * state[S_ATTITUDE + i]
    norm = sqrt(square)
    for i in range(4):
        state[S_ATTITUDE + i] /= norm


@njit(cache=False)
def _touches(state: Array, parameters: Array, rotation: Array) -> bool:
    lowest = (
        parameters[P_FEET] * abs(rotation[2, 0])
        + parameters[P_FEET + 1] * abs(rotation[2, 1])
        + parameters[P_FEET + 2] * rotation[2, 2]
    )
    touching: bool = state[S_POSITION + 2] - lowest < state[S_GROUND]
    return touching


@njit(cache=False)
def _settle_flyer(state: Array, parameters: Array, work: Work) -> None:
    """Contact, rest and power at the end of a multirotor's step."""
    touching = _touches(state, parameters, work.rotation)
    if touching and state[S_ON_GROUND] == 0.0:
        state[S_CONTACT_SPEED] = max(0.0, -work.before[2])
        state[S_CONTACTS] += 1.0
    state[S_ON_GROUND] = 1.0 if touching else 0.0
    light = lift(state, parameters) < _LIGHT * parameters[P_MASS] * parameters[P_GRAVITY]
    speed = 0.0
    spin = 0.0
    for axis in range(3):
        speed = max(speed, abs(state[S_VELOCITY + axis]))
        spin = max(spin, abs(state[S_RATES + axis]))
    still = state[S_RESTING] > 0.5 or (speed < _STILL_SPEED and spin < _STILL_RATE)
    resting = touching and light and still
    state[S_RESTING] = 1.0 if resting else 0.0
    if resting:
        for axis in range(3):
            state[S_VELOCITY + axis] = 0.0
            state[S_RATES + axis] = 0.0


@njit(cache=False)
def _settle_rover(state: Array, parameters: Array, work: Work, height_before: float) -> None:
    """Height, velocity and rest at the end of a rover's step."""
    climb = (state[S_GROUND] - height_before) / STEP_S
    state[S_ON_GROUND] = 1.0
    resting = work.throttle[1] == 0.0 and work.throttle[0] == 0.0 and abs(state[S_SPEED]) < 0.01
    state[S_RESTING] = 1.0 if resting else 0.0
    if resting:
        state[S_SPEED] = 0.0
        climb = 0.0
    follow_ground(state, parameters, state[S_GROUND], climb)


@njit(cache=False)
def _felt(state: Array, parameters: Array, work: Work) -> None:
    """The step's mean specific force in body axes, and the way gone."""
    rotation, before = work.rotation, work.before
    ae = (state[S_VELOCITY] - before[0]) / STEP_S
    an = (state[S_VELOCITY + 1] - before[1]) / STEP_S
    au = (state[S_VELOCITY + 2] - before[2]) / STEP_S + parameters[P_GRAVITY]
    for axis in range(3):
        state[S_FORCE + axis] = rotation[0, axis] * ae + rotation[1, axis] * an + rotation[2, axis] * au
    square = 0.0
    for axis in range(3):
        square += state[S_VELOCITY + axis] * state[S_VELOCITY + axis]
    state[S_DISTANCE] += sqrt(square) * STEP_S


@njit(cache=False)
def _power(flying: bool, state: Array, inputs: Array, parameters: Array, work: Work) -> None:
    if flying:
        power = electrical_power(state, inputs, parameters)
    else:
        power = electrical_rover(state, inputs, parameters, work)
    volts, amps = volts_amps(state, parameters, power)
    state[S_VOLTS] = volts
    state[S_AMPS] = amps
    state[S_PAYLOAD_ENERGY] += inputs[U_PAYLOAD] * STEP_S


@njit(cache=False)
def electrical_rover(state: Array, inputs: Array, parameters: Array, work: Work) -> float:
    """Watts drawn at a rover's battery."""
    drive = drive_power(state[S_SPEED], work.slope[S_SPEED], parameters)
    power: float = drive + parameters[P_IDLE_POWER] + inputs[U_PAYLOAD]
    return power


@njit(cache=False)
def step_body(bodies: Bodies, body: int, work: Work) -> None:
    """Advance one body from its grid step to the next under ``work.throttle``, and take the samples due
    there.
    """
    state, inputs, parameters = bodies.state[body], bodies.inputs[body], bodies.parameters[body]
    flying = parameters[P_KIND] == MULTIROTOR
    for axis in range(3):
        work.before[axis] = state[S_VELOCITY + axis]
        work.air[axis] = inputs[U_WIND + axis] + state[S_GUST + axis]
    work.ground[0] = state[S_GROUND]
    _integrate(flying, state, inputs, parameters, work)
    height_before = state[S_POSITION + 2]
    state[S_GROUND] = ground_height(bodies.heights, bodies.grid, state[S_POSITION], state[S_POSITION + 1])
    if flying:
        _normalise(state)
        rotation_matrix(state, work.rotation)
        _settle_flyer(state, parameters, work)
    else:
        _settle_rover(state, parameters, work, height_before)
        rotation_matrix(state, work.rotation)
    _felt(state, parameters, work)
    _power(flying, state, inputs, parameters, work)
    bodies.reached[body] += 1
    k = bodies.reached[body]
    if k % GUST_EVERY == 0:
        blow(state, inputs, parameters, bodies.keys[body], k)
    sense(bodies, body, work.rotation, k)


@njit(cache=False)
def wake_body(bodies: Bodies, body: int, work: Work) -> None:
    """What the instruments show at grid step 0, before anything moved."""
    state, parameters = bodies.state[body], bodies.parameters[body]
    rotation_matrix(state, work.rotation)
    for axis in range(3):
        state[S_FORCE + axis] = work.rotation[2, axis] * parameters[P_GRAVITY]
    _power(parameters[P_KIND] == MULTIROTOR, state, bodies.inputs[body], parameters, work)
    sense(bodies, body, work.rotation, 0)
    state[S_AWAKE] = 1.0


def _compose(sources: str) -> Advance:
    @njit(cache=True)
    def advance_bodies(bodies: Bodies, goals: NDArray[np.int64]) -> None:
        if not sources:  # never so: its being named here makes the digest part of the cache's key
            return
        work = new_work()
        for body in range(goals.shape[0]):
            if bodies.state[body, S_AWAKE] == 0.0:
                wake_body(bodies, body, work)
            while bodies.reached[body] < goals[body]:
                for i in range(4):
                    work.throttle[i] = bodies.inputs[body, U_THROTTLE + i]
                step_body(bodies, body, work)

    compiled: Advance = advance_bodies
    return compiled


advance_bodies = _compose(digest_of(world_sources()))
"""Advance each body to its goal step with the motor commands in its inputs: no autopilot at all."""
