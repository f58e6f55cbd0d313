"""What a vehicle speaks through: its outlet for words, and the way to those who command it.

A face is one protocol. On links it serves any number of them; on a graph it is a node. The flight stack
knows neither.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from volery.kernel.task import ExecutionContext
from volery.links.link import Link
from volery.ros.graph import RosGraph
from volery.simulation.autopilots.vehicle_state import VehicleOutput


class ProtocolEndpoint(VehicleOutput, Protocol):
    """One vehicle's protocol."""

    def start(self) -> None:
        """The vehicle was switched on: what it sends regularly is sent from its boot on."""

    def stop(self) -> None:
        """Fall silent: it was switched off."""

    def hang_up(self) -> None:
        """Serve nobody any more."""


@runtime_checkable
class LinkEndpoint(ProtocolEndpoint, Protocol):
    """A protocol on links."""

    @property
    def banner(self) -> bytes:
        """The first bytes on a wire after the autopilot was switched on, if they are no frame."""

    def connect(self, link: Link, use: str = "") -> None:
        """Listen to and speak on this link, too. *use* is what the firmware has it for."""

    def disconnect(self, link: Link) -> None:
        """Nobody is there any more."""


@runtime_checkable
class GraphEndpoint(ProtocolEndpoint, Protocol):
    """A protocol of topics and services on a graph."""

    def join(self, graph: RosGraph, namespace: str, place: ExecutionContext) -> None:
        """Serve on that graph: all its names are under *namespace*, its computing is spent at *place*."""
