"""Driver of an autopilot behind MAVROS topic names: ArduPilot, unless the address names another."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from volery.base.errors import UsageError, choices, did_you_mean
from volery.kernel.api import Kernel
from volery.vehicles.driver import Driver, DriverFactory, Opener
from volery.vehicles.drivers import ardupilot, px4

if TYPE_CHECKING:
    from volery.ros.graph import Node

AUTOPILOTS: Mapping[str, Opener] = {"ardupilot": ardupilot.open_mavros, "px4": px4.open_mavros}


def open_driver(kernel: Kernel, node: Node, name: str, options: Mapping[str, str]) -> Driver:
    """Open a vehicle behind MAVROS names.

    Args:
        kernel: clock and tasks.
        node: the node that commands the vehicle.
        name: name of the vehicle.
        options: ``autopilot`` (``ardupilot`` or ``px4``); ``namespace`` of the topics, by default ``/`` and
            *name*; ``geoid``: ``egm96`` (default) or its height above the ellipsoid in metres.
    """
    rest = dict(options)
    autopilot = rest.pop("autopilot", "ardupilot")
    opener = AUTOPILOTS.get(autopilot)
    if opener is None:
        hint = did_you_mean(autopilot, AUTOPILOTS)
        raise UsageError(f"autopilot={autopilot!r} over MAVROS{hint}; there is {choices(AUTOPILOTS)}")
    return opener(kernel, node, name, rest)


MAVROS = DriverFactory(on_graph=open_driver)
