"""Sets of sources of ArduPilot's estimator, chosen by command or switch.

EK3_SRCn_POSXY of the chosen set decides whether satellites are used; it is read when the set is chosen. The
other sources a set may name do not exist here, so that such a set has no position.
"""

from __future__ import annotations

from volery.simulation.autopilots.ardupilot.parameter_checks import GPS, SETS
from volery.simulation.autopilots.mavlink.messages import ACCEPTED, DENIED, Command
from volery.simulation.autopilots.vehicle_state import Vehicle

SET_SOURCES, SOURCES_OPTION = 42_007, 90
"""MAV_CMD, and value of RCn_OPTION."""


def choose_sources(vehicle: Vehicle, number: int) -> None:
    """Use the sources of a set, from 1; before the estimator has an origin nothing changes."""
    ignored = vehicle.parameters[f"EK3_SRC{number}_POSXY"] != GPS
    started = vehicle.uptime() > vehicle.rules.startup.origin_after
    if started and ignored != vehicle.switches.satellites_ignored:
        vehicle.switches.satellites_ignored = ignored
        vehicle.flight.use_gps(not ignored)


def on_set_sources(vehicle: Vehicle, command: Command) -> int:
    """Handle SET_EKF_SOURCE_SET: param1 is the set, 1 to 3."""
    if not SETS[0] <= command.param1 < SETS[-1] + 1:
        return DENIED
    choose_sources(vehicle, int(command.param1))
    return ACCEPTED


def switch_sources(vehicle: Vehicle, position: int) -> None:
    """Choose the first set with the switch down, the second in the middle, the third up."""
    choose_sources(vehicle, position + 2)
