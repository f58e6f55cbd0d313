"""The one compiled step: all bodies with their estimators and inner loops, composed by import.

A grid step is: guidance (every fifth step) and attitude loops on what is believed at step k, then the body's
law from k to k + 1 and the samples due there, then the estimate of k + 1.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from volery.autopilots.simulated.flight_attitude import fly_attitude
from volery.autopilots.simulated.flight_columns import C_CONTROL, K_BOOTED, K_HOVER, K_LANDED, K_MOTORS
from volery.autopilots.simulated.flight_estimator import know
from volery.autopilots.simulated.flight_guidance import GUIDE_EVERY, guide
from volery.autopilots.simulated.flight_landed import detect_landing
from volery.autopilots.simulated.flight_rover import guide_rover
from volery.world.bodies import new_work, step_body
from volery.world.columns import MULTIROTOR, P_KIND, Bodies, Work
from volery.world.multirotor import rotation_matrix

_FIRST_HOVER = 0.35  # MOT_THST_HOVER's default


@njit(cache=True)
def _boot(bodies: Bodies, body: int, work: Work) -> None:
    """What an autopilot believes before its first step."""
    memory = bodies.memory[body]
    memory[K_HOVER] = _FIRST_HOVER
    memory[K_LANDED] = 1.0
    rotation_matrix(bodies.state[body], work.rotation)
    know(memory, bodies.state[body], bodies.inputs[body], bodies.parameters[body], work.rotation)
    memory[K_BOOTED] = 1.0


@njit(cache=True)
def _control(bodies: Bodies, body: int, work: Work) -> None:
    """From the belief at this step to motor commands."""
    memory, command, parameters = bodies.memory[body], bodies.inputs[body], bodies.parameters[body]
    due = bodies.reached[body] % GUIDE_EVERY == 0
    if parameters[P_KIND] != MULTIROTOR:
        if due:
            guide_rover(memory, command, parameters)
        work.throttle[0] = -memory[K_MOTORS]
        work.throttle[1] = memory[K_MOTORS + 1]
        return
    if due:
        guide(memory, command)
        detect_landing(memory, int(command[C_CONTROL]))
    fly_attitude(memory, parameters, int(command[C_CONTROL]))
    for i in range(4):
        work.throttle[i] = memory[K_MOTORS + i]


@njit(cache=True)
def advance_flights(bodies: Bodies, goals: NDArray[np.int64]) -> None:
    """Advance each body to its goal step."""
    work = new_work()
    for body in range(goals.shape[0]):
        if bodies.memory[body, K_BOOTED] == 0.0:
            _boot(bodies, body, work)
        while bodies.reached[body] < goals[body]:
            _control(bodies, body, work)
            step_body(bodies, body, work)
            know(
                bodies.memory[body],
                bodies.state[body],
                bodies.inputs[body],
                bodies.parameters[body],
                work.rotation,
            )
