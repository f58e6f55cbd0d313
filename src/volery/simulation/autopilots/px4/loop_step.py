"""The compiled step of PX4's trajectory, loops and estimate, of one vehicle."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from volery.base.numeric_code import NumericCode
from volery.simulation.autopilots.px4.airframe_loops import step_loops
from volery.simulation.autopilots.px4.estimate_error import step_errors
from volery.simulation.autopilots.px4.loop_state import DIRECT, I_TASK, REST
from volery.simulation.autopilots.px4.trajectory import move_trajectory
from volery.simulation.world.body_step import world_sources
from volery.simulation.world.state_layout import Array


def _compose(digest: str) -> Callable[..., int]:
    def fly_px4_loops(row: Array, keys: NDArray[np.uint64], span: NDArray[np.int64]) -> int:
        for step in range(span[0], span[1]):
            if row[I_TASK] == REST:
                step_errors(row, keys[0], step)
                continue
            if row[I_TASK] != DIRECT:
                move_trajectory(row)
            step_loops(row, keys[0], step)
        return 1 if digest else 0

    return fly_px4_loops


_SOURCES = tuple(
    Path(__file__).with_name(name)
    for name in (
        "loop_step.py",
        "loop_state.py",
        "trajectory.py",
        "heading_loop.py",
        "airframe_loops.py",
        "error_states.py",
        "field_fusion.py",
        "estimate_error.py",
    )
)
fly_px4_loops = NumericCode(
    "fly_px4_loops", _compose, (*world_sources(), *_SOURCES), ("float64[::1]", "uint64[::1]", "int64[::1]")
)
"""Advance the loops of a row from substep ``span[0]`` to ``span[1]``."""
