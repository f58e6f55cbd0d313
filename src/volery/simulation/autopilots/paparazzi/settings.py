"""Settings: variables of the firmware that a ground station reads and writes by number.

The numbers are those of the stock rotorcraft (``links.pprz_aircraft``). A value outside a setting's bounds
is taken as it comes, as in the firmware: the bounds are the ground station's.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import NamedTuple

from volery.links.paparazzi_aircraft import stock_aircraft
from volery.simulation.autopilots.paparazzi.airframe import AUTO2_SWITCH
from volery.simulation.autopilots.paparazzi.modes import set_mode_by_datalink, set_motors
from volery.simulation.autopilots.vehicle_state import Vehicle


class Variable(NamedTuple):
    """How one is read and written."""

    read: Callable[[Vehicle], float]
    write: Callable[[Vehicle, float], None]


def _parameter(name: str) -> Variable:
    def write(vehicle: Vehicle, value: float) -> None:
        vehicle.set_parameter(name, value)

    return Variable(lambda vehicle: vehicle.parameters[name], write)


def _nothing(_vehicle: Vehicle, _value: float) -> None:
    """There is no such hardware."""


VARIABLES = {
    "auto2": _parameter(AUTO2_SWITCH),
    "kill_throttle": Variable(
        lambda vehicle: float(not vehicle.armed), lambda vehicle, value: set_motors(vehicle, value == 0.0)
    ),
    "autopilot_power_switch": Variable(lambda _vehicle: 1.0, _nothing),
    "mode": Variable(
        lambda vehicle: float(vehicle.mode.number),
        lambda vehicle, value: set_mode_by_datalink(vehicle, int(value)),
    ),
}
"""By the name that the stock rotorcraft gives them."""

NUMBERED = {one.number: VARIABLES[one.name] for one in stock_aircraft().settings}


def read(vehicle: Vehicle, number: int) -> float | None:
    """Its value; ``None`` if there is none of that number."""
    variable = NUMBERED.get(number)
    return None if variable is None else variable.read(vehicle)


def write(vehicle: Vehicle, number: int, value: float) -> float | None:
    """Set it, and return what it is then; ``None`` if there is none of that number."""
    variable = NUMBERED.get(number)
    if variable is None:
        return None
    if isfinite(value):
        variable.write(vehicle, value)
    return variable.read(vehicle)
