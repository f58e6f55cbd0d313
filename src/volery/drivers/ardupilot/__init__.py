"""ArduPilot: its sequences, written once, and two ways to reach it: a MAVLink link, and MAVROS on a graph."""

from __future__ import annotations

from collections.abc import Mapping

from volery.drivers.ardupilot.driver import ArduPilot
from volery.drivers.ardupilot.mavlink import OPTIONS, MavlinkCommands, check_options
from volery.kernel.api import Kernel
from volery.links.link import Link

__all__ = ["ArduPilot", "open_driver"]


def open_driver(kernel: Kernel, link: Link, name: str, options: Mapping[str, str]) -> ArduPilot:
    """An ArduPilot behind a MAVLink *link*. It begins to listen and to send heartbeats at once."""
    check_options(options, *OPTIONS)
    return ArduPilot(kernel, name, MavlinkCommands(kernel, link, name, options))
