"""What a vehicle speaks through: its outlet for words, and the way to those who command it.

A face is one protocol. On links it serves any number of them; on a graph it is a node. The flight stack
knows neither.
"""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

from volery.kernel.api import Action
from volery.kernel.task import ExecutionContext
from volery.links.link import Link
from volery.ros.graph import RosGraph


class VehicleOutput(Protocol):
    """Through which a vehicle speaks to whoever listens."""

    def say(self, severity: int, text: str) -> None:
        """Words for people; severity as in syslog."""

    def parameter(self, name: str) -> None:
        """A parameter has another value."""

    def mode_changed(self) -> None:
        """It flies another mode."""

    def home_changed(self) -> None:
        """Home is elsewhere."""

    def announce(self, message: str) -> None:
        """Send that message of the firmware's protocol now, to everyone."""

    def tell(self, message: str, fields: dict[str, Any]) -> None:
        """Send an event with these fields, to everyone."""

    def after_answer(self, action: Action) -> None:
        """Do it once the frame that is being handled has been answered; at once if none is."""


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
