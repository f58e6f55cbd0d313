"""Paparazzi rotorcraft: its sequences, written once, and two ways to reach it: pprzlink and pprzros topics.

From public definitions of the protocol; not flown. ``modes.ASSUMED`` lists what is taken for granted.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from volery.kernel.api import Kernel
from volery.links.link import Link
from volery.links.paparazzi_aircraft import PaparazziAircraft, read_aircraft, stock_aircraft
from volery.links.pprzlink_codec import PPRZLINK
from volery.ros.graph import Node
from volery.vehicles.address import check_options
from volery.vehicles.driver import DriverFactory
from volery.vehicles.drivers.paparazzi.backend import PaparazziBackend
from volery.vehicles.drivers.paparazzi.driver import Paparazzi
from volery.vehicles.drivers.paparazzi.modes import LAND_BLOCK, START_BLOCK, TAKEOFF_BLOCK
from volery.vehicles.drivers.paparazzi.pprzros_link import PprzrosLink
from volery.vehicles.drivers.paparazzi.sequences import Blocks

__all__ = ["DRIVER", "Paparazzi", "open_driver", "open_pprzros"]

OPTIONS = ("aircraft", "land", "start", "system", "takeoff", "texts")
CARRIERS = ("baud", "from", "uplink")
"""Options that are not the driver's, but of what carries it."""


def open_driver(kernel: Kernel, link: Link, name: str, options: Mapping[str, str]) -> Paparazzi:
    """A Paparazzi rotorcraft behind a pprzlink. It begins to listen and to send pings at once.

    Options: ``aircraft``, the folder with its XML, else it is taken for the stock rotorcraft; ``system``, its
    id, else the XML's, else the first that speaks; ``start``, ``takeoff`` and ``land``, other names of these
    blocks of its flight plan; ``texts=unrecorded`` where it records its texts itself, as a simulated one.
    """
    check_options("paparazzi", options, *OPTIONS, *CARRIERS)
    uplink = PaparazziBackend(kernel, link, name, _aircraft(options), options)
    return Paparazzi(kernel, uplink, _blocks(options))


def open_pprzros(kernel: Kernel, node: Node, name: str, options: Mapping[str, str]) -> Paparazzi:
    """A Paparazzi rotorcraft behind the pprzros bridge, commanded by *node*. It begins to listen at once.

    Options: ``namespace`` of the bridge, else the root, where ``/pprzros/to_ros`` and ``/pprzros/from_ros``
    are; and those of ``open_driver``.
    """
    check_options("paparazzi", options, *OPTIONS, "namespace")
    aircraft, blocks = _aircraft(options), _blocks(options)
    link = PprzrosLink(kernel, node, options.get("namespace", "/"))
    return Paparazzi(kernel, PaparazziBackend(kernel, link, name, aircraft, options), blocks)


def _aircraft(options: Mapping[str, str]) -> PaparazziAircraft:
    given = options.get("aircraft")
    return read_aircraft(Path(given)) if given else stock_aircraft()


def _blocks(options: Mapping[str, str]) -> Blocks:
    return Blocks(
        options.get("start", START_BLOCK),
        options.get("takeoff", TAKEOFF_BLOCK),
        options.get("land", LAND_BLOCK),
    )


DRIVER = DriverFactory(on_link=open_driver, codec=PPRZLINK, on_graph=open_pprzros, graph_names="pprzros")
"""Paparazzi on a pprzlink; on a graph it goes by pprzros's names."""
