"""The one compiled step: all bodies with their estimators and inner loops, composed by import.

A grid step is: guidance (every fifth step) and attitude loops on what is believed at step k, then the body's
law from k to k + 1 and the samples due there, then the estimate of k + 1.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numba import njit
from numpy.typing import NDArray

from volery.autopilots.simulated.flight_attitude import fly_attitude
from volery.autopilots.simulated.flight_columns import C_CONTROL, K_HOVER, K_LANDED, K_MOTORS
from volery.autopilots.simulated.flight_estimator import believe, first_belief
from volery.autopilots.simulated.flight_guidance import GUIDE_EVERY, guide
from volery.autopilots.simulated.flight_landed import detect_landing
from volery.autopilots.simulated.flight_rover import guide_rover
from volery.world.bodies import new_work, step_body, wake_body
from volery.world.columns import MULTIROTOR, P_KIND, S_AWAKE, Advance, Bodies, Work
from volery.world.compiled import digest_of, world_sources

_FIRST_HOVER = 0.35  # MOT_THST_HOVER's default


@njit(cache=False)
def _boot(bodies: Bodies, body: int, work: Work) -> None:
    """What an autopilot believes before its first step."""
    memory = bodies.memory[body]
    memory[K_HOVER] = _FIRST_HOVER
    memory[K_LANDED] = 1.0
    first_belief(bodies, body, work)


@njit(cache=False)
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


def _compose(sources: str) -> Advance:
    @njit(cache=True)
    def advance_flights(bodies: Bodies, goals: NDArray[np.int64]) -> None:
        if not sources:  # never so: its being named here makes the digest part of the cache's key
            return
        work = new_work()
        for body in range(goals.shape[0]):
            if bodies.state[body, S_AWAKE] == 0.0:
                wake_body(bodies, body, work)
                _boot(bodies, body, work)
            while bodies.reached[body] < goals[body]:
                _control(bodies, body, work)
                step_body(bodies, body, work)
                believe(bodies, body, work)

    compiled: Advance = advance_flights
    return compiled


advance_flights = _compose(digest_of([*world_sources(), *Path(__file__).parent.glob("flight*.py")]))
"""Advance each body to its goal step under the set-points in its inputs."""
