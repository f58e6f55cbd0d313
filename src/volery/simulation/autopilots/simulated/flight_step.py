"""The one compiled step: all bodies with their estimators and inner loops, composed by import.

A grid step is: guidance (every fifth step) and attitude loops on what is believed at step k, then the body's
law from k to k + 1 and the samples due there, then the estimate of k + 1.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numba import njit
from numpy.typing import NDArray

from volery.simulation.autopilots.simulated.flight_attitude import fly_attitude
from volery.simulation.autopilots.simulated.flight_columns import C_CONTROL, K_HOVER, K_LANDED, K_MOTORS
from volery.simulation.autopilots.simulated.flight_estimator import believe, first_belief
from volery.simulation.autopilots.simulated.flight_guidance import GUIDE_EVERY, guide
from volery.simulation.autopilots.simulated.flight_landed import detect_landing
from volery.simulation.autopilots.simulated.flight_rover import guide_rover
from volery.simulation.world.bodies import step_body, wake_body
from volery.simulation.world.columns import MULTIROTOR, P_KIND, S_AWAKE, W_THROTTLE, Advance, Array, Bodies
from volery.simulation.world.compiled import digest_of, world_sources

_FIRST_HOVER = 0.35  # MOT_THST_HOVER's default


@njit(cache=False)
def _boot(row: Array) -> None:
    """What an autopilot believes before its first step."""
    row[K_HOVER] = _FIRST_HOVER
    row[K_LANDED] = 1.0
    first_belief(row)


@njit(cache=False)
def _control(row: Array, k: int) -> None:
    """From the belief at step *k* to motor commands."""
    due = k % GUIDE_EVERY == 0
    if row[P_KIND] != MULTIROTOR:
        if due:
            guide_rover(row)
        row[W_THROTTLE] = -row[K_MOTORS]
        row[W_THROTTLE + 1] = row[K_MOTORS + 1]
        return
    control = int(row[C_CONTROL])
    if due:
        guide(row)
        detect_landing(row, control)
    fly_attitude(row, control)
    for i in range(4):
        row[W_THROTTLE + i] = row[K_MOTORS + i]


def _compose(sources: str) -> Advance:
    @njit(cache=True)
    def advance_flights(bodies: Bodies, goals: NDArray[np.int64]) -> None:
        if not sources:  # never so: its being named here makes the digest part of the cache's key
            return
        for body in range(goals.shape[0]):
            row = bodies.rows[body]
            if row[S_AWAKE] == 0.0:
                wake_body(bodies, body, row)
                _boot(row)
            while bodies.reached[body] < goals[body]:
                _control(row, bodies.reached[body])
                step_body(bodies, body, row)
                believe(row, bodies.reached[body])

    compiled: Advance = advance_flights
    return compiled


advance_flights = _compose(digest_of([*world_sources(), *Path(__file__).parent.glob("flight*.py")]))
"""Advance each body to its goal step under the set-points in its inputs."""
