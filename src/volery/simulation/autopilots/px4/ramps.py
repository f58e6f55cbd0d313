"""Speeds that depend on something by straight lines between points."""

from __future__ import annotations

from itertools import pairwise

from volery.base.time import to_seconds
from volery.simulation.autopilots.manual_control import NEVER
from volery.simulation.autopilots.vehicle_state import Vehicle

CLIMB_RAMP = ((0.0, 0.05), (1.0, 0.3), (1.33, 0.75), (3.0, 1.0))
"""Share of a climb rate over the time since it left the ground, in MPC_TKO_RAMP_T: as recorded."""


def interpolated(value: float, low: tuple[float, float], high: tuple[float, float]) -> float:
    """Between two points (value, result), and their results beyond them."""
    if high[0] <= low[0]:
        return high[1] if value > low[0] else low[1]
    share = min(1.0, max(0.0, (value - low[0]) / (high[0] - low[0])))
    return low[1] + share * (high[1] - low[1])


def climb_share(vehicle: Vehicle) -> float:
    """How much of its climb rate it may use: little just after it has left the ground."""
    lifted = vehicle.memory.lifted_at
    if lifted == NEVER:
        return CLIMB_RAMP[0][1]
    along = to_seconds(vehicle.kernel.now() - lifted) / max(0.1, vehicle.parameters["MPC_TKO_RAMP_T"])
    for low, high in pairwise(CLIMB_RAMP):
        if along <= high[0]:
            return interpolated(along, low, high)
    return 1.0
