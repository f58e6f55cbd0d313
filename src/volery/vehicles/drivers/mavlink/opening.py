"""How a MAVLink autopilot's driver is opened: on a link, or behind a vehicle node with MAVROS's names."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from volery.base.geoid import Geoid
from volery.kernel.api import Kernel
from volery.links.link import Link
from volery.ros.graph import Node
from volery.vehicles.drivers.mavlink.mavros import namespace_and_geoid
from volery.vehicles.drivers.options import OPTIONS, check_options

D = TypeVar("D")


@dataclass(frozen=True)
class Opening(Generic[D]):
    """Of the autopilot called ``name``: its ``driver``, and what carries it over either way."""

    name: str
    driver: Callable[[Kernel, str, Any], D]
    mavlink: Callable[[Kernel, Link, str, Mapping[str, str]], Any]
    mavros: Callable[[Kernel, Node, str, str, Geoid], Any]

    def on_link(self, kernel: Kernel, link: Link, name: str, options: Mapping[str, str]) -> D:
        """One behind a MAVLink *link*. It begins to listen and to send heartbeats at once.

        Options: ``rate`` of the position and ``attitude`` in Hz, ``system`` id; and ``texts=unrecorded``
        where the autopilot records its texts itself, as a simulated one does.
        """
        check_options(self.name, options, *OPTIONS)
        return self.driver(kernel, name, self.mavlink(kernel, link, name, options))

    def on_graph(self, kernel: Kernel, node: Node, name: str, options: Mapping[str, str]) -> D:
        """One behind a vehicle node with MAVROS's names, commanded by *node*.

        Options: ``namespace`` of the vehicle node (else ``/`` and *name*), ``geoid``: ``egm96`` or metres.
        """
        where = namespace_and_geoid(self.name, name, options)
        return self.driver(kernel, name, self.mavros(kernel, node, name, *where))
