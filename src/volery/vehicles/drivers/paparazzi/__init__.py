"""Paparazzi rotorcraft: one driver, over pprzlink or over pprzros topics.

It follows the public definitions of the protocol and what version 6.2 did in its own simulator;
``decoder.ASSUMED`` lists the assumptions.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from volery.base.errors import UsageError
from volery.kernel.api import Kernel
from volery.links.link import Link
from volery.links.paparazzi_aircraft import PaparazziAircraft, read_aircraft, stock_aircraft
from volery.links.pprzlink_codec import PPRZLINK
from volery.vehicles.address import check_options
from volery.vehicles.driver import DriverFactory
from volery.vehicles.drivers.paparazzi.backend import PaparazziBackend
from volery.vehicles.drivers.paparazzi.decoder import LAND_BLOCK, START_BLOCK, TAKEOFF_BLOCK
from volery.vehicles.drivers.paparazzi.driver import Paparazzi
from volery.vehicles.drivers.paparazzi.takeoff_and_landing import Blocks

if TYPE_CHECKING:
    from volery.ros.graph import Node

__all__ = ["DRIVER", "Paparazzi", "open_driver", "open_pprzros"]

OPTIONS = ("aircraft", "land", "start", "system", "takeoff", "texts")
LINK_OPTIONS = ("baud", "bind", "from", "uplink")
"""Options of an address that belong to the link."""


def open_driver(kernel: Kernel, link: Link, name: str, options: Mapping[str, str]) -> Paparazzi:
    """Open a Paparazzi rotorcraft on a pprzlink; pings are sent from now on.

    Args:
        kernel: clock and tasks.
        link: link to the aircraft.
        name: name of the vehicle.
        options: ``aircraft``, the folder with its XML (default: the simulated rotorcraft only);
            ``system``, its id (default: the id in the XML, or the first that is received); ``start``,
            ``takeoff`` and ``land``, the names of these blocks of its flight plan; ``texts=unrecorded`` if
            the aircraft records its texts itself, as a simulated one does.
    """
    check_options("paparazzi", options, *OPTIONS, *LINK_OPTIONS)
    backend = PaparazziBackend(kernel, link, name, _aircraft(options), options)
    return Paparazzi(kernel, backend, _blocks(options))


def open_pprzros(kernel: Kernel, node: Node, name: str, options: Mapping[str, str]) -> Paparazzi:
    """Open a Paparazzi rotorcraft behind the pprzros bridge.

    Args:
        kernel: clock and tasks.
        node: the node that commands the vehicle.
        name: name of the vehicle.
        options: ``namespace`` of ``pprzros/to_ros`` and ``pprzros/from_ros`` (default: the root), and the
            options of ``open_driver``.
    """
    from volery.vehicles.drivers.paparazzi.pprzros_link import PprzrosLink

    check_options("paparazzi", options, *OPTIONS, "namespace")
    aircraft, blocks = _aircraft(options), _blocks(options)
    link = PprzrosLink(kernel, node, options.get("namespace", "/"))
    return Paparazzi(kernel, PaparazziBackend(kernel, link, name, aircraft, options), blocks)


def _aircraft(options: Mapping[str, str]) -> PaparazziAircraft:
    given = options.get("aircraft")
    if not given:
        return stock_aircraft()
    aircraft = read_aircraft(Path(given))
    if modes := aircraft.generated_modes:
        raise UsageError(
            f"{given}: a generated autopilot, whose modes have numbers of its own ({', '.join(modes)}); "
            "only the static autopilot can be flown: build the aircraft without USE_GENERATED_AUTOPILOT"
        )
    return aircraft


def _blocks(options: Mapping[str, str]) -> Blocks:
    return Blocks(
        options.get("start", START_BLOCK),
        options.get("takeoff", TAKEOFF_BLOCK),
        options.get("land", LAND_BLOCK),
    )


DRIVER = DriverFactory(on_link=open_driver, codec=PPRZLINK, on_graph=open_pprzros, graph_names="pprzros")
