"""ArduPilot: its sequences, written once, and two ways to reach it: a MAVLink link, and MAVROS on a graph."""

from __future__ import annotations

from volery.drivers.ardupilot.driver import ArduPilot
from volery.drivers.ardupilot.mavlink import MavlinkCommands
from volery.drivers.ardupilot.mavros import MavrosCommands
from volery.drivers.mavlink.opening import Opening
from volery.vehicles.driver import DriverFactory

__all__ = ["DRIVER", "ArduPilot", "open_driver", "open_mavros"]

_OPENING = Opening("ardupilot", ArduPilot, MavlinkCommands, MavrosCommands)

open_driver = _OPENING.on_link
open_mavros = _OPENING.on_graph

DRIVER = DriverFactory(on_link=open_driver, on_graph=open_mavros)
"""ArduPilot on a MAVLink link; on a graph it goes by MAVROS's names."""
