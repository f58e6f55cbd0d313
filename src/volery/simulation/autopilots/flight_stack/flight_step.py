"""The compiled step of all vehicles with their flight stacks.

One grid step of a vehicle is: guidance (every fifth step) and attitude loops on the estimate of step k, then
the body's motion from k to k + 1 with the samples due there, then the estimate of k + 1. Under external
control only the body moves, by the motor commands in its inputs. For a body that is moved from outside the
step halts after the loops until the motion is given.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from volery.base.numeric_code import NumericCode, numeric
from volery.simulation.autopilots.flight_stack.control_loops import (
    detect_landing,
    guide_rover,
    run_attitude_loops,
)
from volery.simulation.autopilots.flight_stack.estimator import (
    estimate_angles,
    initialise_estimate,
    update_estimate,
)
from volery.simulation.autopilots.flight_stack.flight_state import (
    C_CONTROL,
    EXTERNAL,
    K_HOVER_THROTTLE,
    K_LANDED,
    K_MOTORS,
    K_STORED_HOVER,
)
from volery.simulation.autopilots.flight_stack.guidance import GUIDE_EVERY, guide_multirotor
from volery.simulation.world.body_step import (
    goal_of,
    is_finite,
    start_body,
    step_body,
    world_sources,
)
from volery.simulation.world.state_layout import (
    BODIES_ARGUMENTS,
    MOTION_AWAITED,
    MOTION_GIVEN,
    MULTIROTOR,
    P_KIND,
    P_ROTORS,
    ROTORS,
    S_STARTED,
    U_MOVED,
    U_THROTTLE,
    W_THROTTLE,
    Array,
    Bodies,
)

_FIRST_HOVER = 0.35


@numeric
def _boot(row: Array) -> None:
    """Initialise the flight stack of one vehicle before its first step."""
    row[K_HOVER_THROTTLE] = row[K_STORED_HOVER] = _FIRST_HOVER
    row[K_LANDED] = 1.0
    initialise_estimate(row)


@numeric
def _control(row: Array, k: int) -> None:
    """Compute the motor commands of step *k* from the estimate at that step."""
    due = k % GUIDE_EVERY == 0
    if row[P_KIND] != MULTIROTOR:
        if due:
            guide_rover(row)
        row[W_THROTTLE] = -row[K_MOTORS]
        row[W_THROTTLE + 1] = row[K_MOTORS + 1]
        return
    control = int(row[C_CONTROL])
    if due:
        guide_multirotor(row)
        detect_landing(row, control)
    run_attitude_loops(row, control)
    for i in range(int(row[P_ROTORS])):
        row[W_THROTTLE + i] = row[K_MOTORS + i]


@numeric
def _command_motors(row: Array, k: int, external: bool) -> None:
    """Write the motor commands of step *k*, unless they are there because the motion waited for them."""
    if external:
        for i in range(ROTORS):
            row[W_THROTTLE + i] = row[U_THROTTLE + i]
    elif row[U_MOVED] != MOTION_GIVEN:
        _control(row, k)


def _compose(digest: str) -> Callable[..., int]:
    def advance_flights(  # noqa: PLR0913, PLR0917  # the arrays of Bodies
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
                _boot(row)
            goal = goal_of(bodies, body)
            while reached[body] < goal:
                external = row[C_CONTROL] == EXTERNAL
                _command_motors(row, reached[body], external)
                if row[U_MOVED] == MOTION_AWAITED:
                    break
                step_body(bodies, body, row)
                if external:
                    continue
                k = reached[body]
                update_estimate(row, k)
                if k % GUIDE_EVERY == 0 or k == goal:  # for guidance, and for those who read
                    estimate_angles(row)
            finite = finite and is_finite(row)
        return 1 if digest and finite else 0

    return advance_flights


_SOURCES = (*world_sources(), *Path(__file__).parent.glob("*.py"))
advance_flights = NumericCode("advance_flights", _compose, _SOURCES, BODIES_ARGUMENTS)
"""Advance the bodies of the span under the set-points in their rows."""
