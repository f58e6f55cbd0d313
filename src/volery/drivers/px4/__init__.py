"""PX4: its sequences, written once, and two ways to reach it: a MAVLink link, and MAVROS on a graph."""

from __future__ import annotations

from collections.abc import Mapping

from volery.drivers.mavlink.mavros import namespace_and_geoid
from volery.drivers.options import OPTIONS, check_options
from volery.drivers.px4.driver import PX4
from volery.drivers.px4.mavlink import MavlinkCommands
from volery.drivers.px4.mavros import MavrosCommands
from volery.graph import Node
from volery.kernel.api import Kernel
from volery.links.link import Link
from volery.vehicles.driver import DriverFactory

__all__ = ["DRIVER", "PX4", "open_driver", "open_mavros"]


def open_driver(kernel: Kernel, link: Link, name: str, options: Mapping[str, str]) -> PX4:
    """A PX4 behind a MAVLink *link*. It begins to listen and to send heartbeats at once.

    Options: ``rate`` of the position and ``attitude`` in Hz, ``system`` id; and ``texts=unrecorded``
    where the autopilot records its texts itself, as a simulated one does.
    """
    check_options("px4", options, *OPTIONS)
    return PX4(kernel, name, MavlinkCommands(kernel, link, name, options))


def open_mavros(kernel: Kernel, node: Node, name: str, options: Mapping[str, str]) -> PX4:
    """A PX4 behind a vehicle node with MAVROS's names, commanded by *node*.

    Options: ``namespace`` of the vehicle node (else ``/`` and *name*), ``geoid``: ``egm96`` or metres.
    """
    where = namespace_and_geoid("px4", name, options)
    return PX4(kernel, name, MavrosCommands(kernel, node, name, *where))


DRIVER = DriverFactory(on_link=open_driver, on_graph=open_mavros)
"""PX4 on a MAVLink link; on a graph it goes by MAVROS's names."""
