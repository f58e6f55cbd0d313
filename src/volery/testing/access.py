"""Access to a vehicle under test, on links or graph nodes whose directions can be interrupted."""

from __future__ import annotations

from abc import ABC, abstractmethod
from itertools import count
from random import Random
from typing import Protocol

from volery.base.seeds import stream
from volery.kernel.api import Action, Kernel
from volery.kernel.task import ExecutionContext
from volery.links.frame import Frame
from volery.links.link import Link, Receiver
from volery.links.wire_faults import FaultyLink, WireFaults
from volery.ros.graph.interface import NodeId, Route
from volery.run.assembly.simulated_fleet import SimulatedFleet
from volery.run.assembly.simulated_vehicles import SimulatedVehicle
from volery.run.assembly.vehicle_nodes import (
    GIVE_UP_AFTER,
    SIMULATED_LINK_OPTIONS,
    GraphWire,
    graph_access,
    private_graph,
    reached_over_links,
    serve_on_graph,
)
from volery.testing.checks import NotPossibleError
from volery.vehicles.driver import Driver, drivers


class ControlledLink:
    """A link of a driver that can be interrupted; ``receives`` and ``sends`` enable its directions."""

    def __init__(self, link: Link) -> None:
        self.name = link.name
        self.receives = True
        self.sends = True
        self._link = link
        self._others: list[Link] = []
        self._receiver: Receiver | None = None
        link.receive(self._arrived)

    def drop(self) -> None:
        """Drop all frames in both directions."""
        self.receives = self.sends = False

    def restore(self) -> None:
        """Restore both directions."""
        self.receives = self.sends = True

    def share(self, other: Link) -> None:
        """Connect `other` to the same medium: its frames arrive here, and frames sent here go to it, too."""
        self._others.append(other)
        other.receive(self._arrived)

    def send(self, frame: Frame) -> None:
        """Send a frame unless the direction is interrupted."""
        if self.sends:
            for link in (self._link, *self._others):
                link.send(frame)

    def receive(self, receiver: Receiver) -> None:
        """Pass every frame that arrives to `receiver` unless the direction is interrupted."""
        self._receiver = receiver

    def _arrived(self, frame: Frame) -> None:
        if self.receives and self._receiver is not None:
            self._receiver(frame)

    def problem(self) -> str:
        """Return the problem of the link below, empty for none."""
        return self._link.problem()

    @property
    def statistics(self) -> object:
        """Receive statistics of the link below, or None if it keeps none."""
        return getattr(self._link, "statistics", None)

    def close(self) -> None:
        """Close all links."""
        for link in (self._link, *self._others):
            link.close()


class WireControl(Protocol):
    """Control over the wire of the first program, in either direction."""

    receives: bool
    sends: bool

    def drop(self) -> None:
        """Drop everything."""

    def restore(self) -> None:
        """Restore both directions."""


class Access(ABC):
    """Opens drivers. ``control`` is that of the first driver's wire, ``link`` the wire if it is a link."""

    control: WireControl
    link: Link | None = None
    protocol = ""

    @abstractmethod
    def first(self) -> Driver:
        """Return the driver of the program under test."""

    @abstractmethod
    def set_faults(self, faults: WireFaults) -> None:
        """Apply faults to the wire from now on; raise ``NotPossibleError`` if it supports none."""

    @abstractmethod
    def another(self, vehicle: str, **options: str) -> tuple[Driver, Link | None]:
        """Return the driver of another program, and its link if there is one."""


class ByLink(Access):
    """Access over links; the vehicle `sharing` is on the first program's link, too."""

    def __init__(
        self, kernel: Kernel, fleet: SimulatedFleet, wanted: SimulatedVehicle, seed: int, sharing: str = ""
    ) -> None:
        self._kernel, self._airfield = kernel, fleet
        self._vehicle = wanted.vehicle.name
        self._factory = drivers.load(wanted.vehicle.autopilot)
        self.protocol = self._factory.codec.name
        self.link = fleet.link_for(wanted)
        self._tap = self.control = ControlledLink(self.link)
        if sharing:
            self._tap.share(fleet.link(sharing))

    def first(self) -> Driver:
        """Return the driver of the program under test, on the controlled link."""
        return self._open(self._tap, self._vehicle, {})

    def another(self, vehicle: str, **options: str) -> tuple[Driver, Link | None]:
        """Return the driver of another program, on a new link."""
        link = self._airfield.link(vehicle)
        return self._open(link, vehicle, options), link

    def set_faults(self, faults: WireFaults) -> None:
        """Return a driver on a link that encodes and decodes frames."""
        if not isinstance(self.link, FaultyLink):
            raise NotPossibleError("nothing can happen to values; add wire=bytes to the address")
        self.link.set_faults(faults)

    def _open(self, link: Link, vehicle: str, options: dict[str, str]) -> Driver:
        open_driver = self._factory.on_link
        assert open_driver is not None, "seen by access_to"
        return open_driver(self._kernel, link, vehicle, {**SIMULATED_LINK_OPTIONS, **options})


class _HandOnNode(GraphWire):
    """The wire of a graph, with control over the messages from and to the node called ``held``."""

    def __init__(self, kernel: Kernel, random: Random, faults: WireFaults | None) -> None:
        super().__init__(kernel, random, faults)
        self.receives = self.sends = True
        self.held = ""

    def drop(self) -> None:
        """Drop everything that is sent from now on."""
        self.receives = self.sends = False

    def restore(self) -> None:
        """Restore both directions."""
        self.receives = self.sends = True

    def route(self, sender: NodeId, receiver: NodeId) -> Route:
        """Return the route between two nodes, see ``GraphWire``; dropped messages count as lost."""
        whole = super().route(sender, receiver)

        def way(size: int, reliable: bool, deliver: Action, lost: Action) -> None:
            unheard = receiver.name == self.held and not self.receives
            if unheard or (sender.name == self.held and not self.sends):
                self._kernel.call_at(self._kernel.now() + GIVE_UP_AFTER, lost)
            else:
                whole(size, reliable, deliver, lost)

        return way


class ByGraph(Access):
    """Access as nodes of a graph that has only the vehicles and their commanders."""

    protocol = "a graph"

    def __init__(
        self, kernel: Kernel, fleet: SimulatedFleet, wanted: SimulatedVehicle, seed: int, sharing: str = ""
    ) -> None:
        self._kernel = kernel
        self._vehicle, self._autopilot = wanted.vehicle.name, wanted.vehicle.autopilot
        self._home = drivers.load(self._autopilot).home_options(wanted.home)
        random = stream(seed, f"wire/{self._vehicle}")
        self._wire = self.control = _HandOnNode(kernel, random, wanted.faults)
        self._graph = private_graph(kernel, self._wire, as_bytes=wanted.faults is not None)
        self._numbers = count(1)
        for vehicle in filter(None, (self._vehicle, sharing)):
            serve_on_graph(
                self._graph,
                fleet,
                vehicle,
                graph_access(self._autopilot, vehicle),
                ExecutionContext(vehicle),
            )

    def set_faults(self, faults: WireFaults) -> None:
        """Apply faults to both directions from now on."""
        self._wire.set_faults(faults)

    def first(self) -> Driver:
        """Return the driver of the program under test, on the controlled node."""
        driver, name = self._commander(self._vehicle, {})
        self._wire.held = name
        return driver

    def another(self, vehicle: str, **options: str) -> tuple[Driver, Link | None]:
        """Return the driver of another program, on another node."""
        return self._commander(vehicle, options)[0], None

    def _commander(self, vehicle: str, options: dict[str, str]) -> tuple[Driver, str]:
        how = graph_access(self._autopilot, vehicle)
        name = f"commander_{next(self._numbers)}"
        node = self._graph.node(name, f"/{vehicle}", context=ExecutionContext(name))
        options = {"namespace": how.namespace, **self._home, **options}
        driver = how.open_driver(self._kernel, node, vehicle, options)
        return driver, node.name


def access_to(
    kernel: Kernel, fleet: SimulatedFleet, wanted: SimulatedVehicle, seed: int, sharing: str = ""
) -> Access:
    """Return the access that autopilot and driver have in common, links before graphs."""
    if reached_over_links(fleet, wanted):
        return ByLink(kernel, fleet, wanted, seed, sharing)
    return ByGraph(kernel, fleet, wanted, seed, sharing)
