"""PX4: one driver with two backends, a MAVLink link and MAVROS on a graph."""

from __future__ import annotations

from volery.vehicles.driver import DriverFactory
from volery.vehicles.drivers.mavlink.driver import DriverOpeners
from volery.vehicles.drivers.px4.backend import PX4Mavlink, PX4Mavros
from volery.vehicles.drivers.px4.driver import PX4

__all__ = ["DRIVER", "PX4", "open_driver", "open_mavros"]

_OPENERS = DriverOpeners("px4", PX4, PX4Mavlink, PX4Mavros)

open_driver = _OPENERS.on_link
open_mavros = _OPENERS.on_graph

DRIVER = DriverFactory(on_link=open_driver, on_graph=open_mavros)
