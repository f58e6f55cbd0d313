"""PX4: its sequences, written once, over a MAVLink link."""

from __future__ import annotations

from collections.abc import Mapping

from volery.drivers.mavlink.options import OPTIONS, check_options
from volery.drivers.px4.driver import PX4
from volery.drivers.px4.mavlink import MavlinkCommands
from volery.kernel.api import Kernel
from volery.links.link import Link
from volery.vehicles.driver import DriverFactory

__all__ = ["DRIVER", "PX4", "open_driver"]


def open_driver(kernel: Kernel, link: Link, name: str, options: Mapping[str, str]) -> PX4:
    """A PX4 behind a MAVLink *link*. It begins to listen and to send heartbeats at once.

    Options: ``rate`` of the position and ``attitude`` in Hz, ``system`` id; and ``texts=unrecorded``
    where the autopilot records its texts itself, as a simulated one does.
    """
    check_options("px4", options, *OPTIONS)
    return PX4(kernel, name, MavlinkCommands(kernel, link, name, options))


DRIVER = DriverFactory(on_link=open_driver)
"""PX4 on a MAVLink link."""
