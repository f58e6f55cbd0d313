"""A link with a hand on it: what passes, in either direction, and who else is heard on it.

How programs reach a simulated vehicle: each on a link of its own, or each as a node of one graph.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from itertools import count
from random import Random
from typing import Protocol

from volery.base.seeds import stream
from volery.kernel.api import Action, Kernel
from volery.kernel.task import ExecutionContext
from volery.links.link import Frame, Link, Receiver
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
    """Stands between a driver and its link, simulated or real. ``hears`` and ``speaks`` say what passes."""

    def __init__(self, link: Link) -> None:
        self.name = link.name
        self.hears = True
        self.speaks = True
        self._link = link
        self._others: list[Link] = []
        self._receiver: Receiver | None = None
        link.receive(self._arrived)

    def cut(self) -> None:
        """Nothing passes any more, in either direction."""
        self.hears = self.speaks = False

    def mend(self) -> None:
        """All passes again."""
        self.hears = self.speaks = True

    def share(self, other: Link) -> None:
        """The same air: what is said goes to *other*, too, and what *other* says is heard here."""
        self._others.append(other)
        other.receive(self._arrived)

    def send(self, frame: Frame) -> None:
        """Send, unless it is cut."""
        if self.speaks:
            for link in (self._link, *self._others):
                link.send(frame)

    def receive(self, receiver: Receiver) -> None:
        """From now on hand every frame that arrives to *receiver*, unless it is cut."""
        self._receiver = receiver

    def _arrived(self, frame: Frame) -> None:
        if self.hears and self._receiver is not None:
            self._receiver(frame)

    def problem(self) -> str:
        """What is wrong with the wire below."""
        return self._link.problem()

    @property
    def statistics(self) -> object:
        """Receive statistics of the link below, or None if it keeps none."""
        return getattr(self._link, "statistics", None)

    def close(self) -> None:
        """Close all links."""
        for link in (self._link, *self._others):
            link.close()


class LinkControl(Protocol):
    """A hand on the wire of the first program: what passes, in either direction."""

    hears: bool
    speaks: bool

    def cut(self) -> None:
        """Nothing passes any more."""

    def mend(self) -> None:
        """All passes again."""


class Access(ABC):
    """Opens drivers. ``hand`` is on the wire of the first; ``link`` is that wire, where there is one."""

    hand: LinkControl
    link: Link | None = None
    protocol = ""

    @abstractmethod
    def first(self) -> Driver:
        """That of the program under test."""

    @abstractmethod
    def set_faults(self, faults: WireFaults) -> None:
        """From now on this happens to what passes. Raises ``NotPossibleError`` where nothing can."""

    @abstractmethod
    def another(self, vehicle: str, **options: str) -> tuple[Driver, Link | None]:
        """That of another program, beside it; and its link, where there are links."""


class ByLink(Access):
    """Over links; what *sharing* says and hears is on the first program's link, too."""

    def __init__(
        self, kernel: Kernel, fleet: SimulatedFleet, wanted: SimulatedVehicle, seed: int, sharing: str = ""
    ) -> None:
        self._kernel, self._airfield = kernel, fleet
        self._vehicle = wanted.vehicle.name
        self._factory = drivers.load(wanted.vehicle.autopilot)
        self.protocol = self._factory.codec.name
        self.link = fleet.link_for(wanted)
        self._tap = self.hand = ControlledLink(self.link)
        if sharing:
            self._tap.share(fleet.link(sharing))

    def first(self) -> Driver:
        """Through the hand."""
        return self._open(self._tap, self._vehicle, {})

    def another(self, vehicle: str, **options: str) -> tuple[Driver, Link | None]:
        """On a new link."""
        link = self._airfield.link(vehicle)
        return self._open(link, vehicle, options), link

    def set_faults(self, faults: WireFaults) -> None:
        """On a link through bytes."""
        if not isinstance(self.link, FaultyLink):
            raise NotPossibleError("nothing can happen to values; add wire=bytes to the address")
        self.link.set_faults(faults)

    def _open(self, link: Link, vehicle: str, options: dict[str, str]) -> Driver:
        open_driver = self._factory.on_link
        assert open_driver is not None, "seen by access_to"
        return open_driver(self._kernel, link, vehicle, {**SIMULATED_LINK_OPTIONS, **options})


class _HandOnNode(GraphWire):
    """The wire of a graph, with a hand on the part of it that leads to the node called ``held``."""

    def __init__(self, kernel: Kernel, random: Random, faults: WireFaults | None) -> None:
        super().__init__(kernel, random, faults)
        self.hears = self.speaks = True
        self.held = ""

    def cut(self) -> None:
        """What is sent from now on is lost."""
        self.hears = self.speaks = False

    def mend(self) -> None:
        """All passes again."""
        self.hears = self.speaks = True

    def route(self, sender: NodeId, receiver: NodeId) -> Route:
        """See ``GraphWire``; what the hand does not let pass is lost."""
        whole = super().route(sender, receiver)

        def way(size: int, reliable: bool, deliver: Action, lost: Action) -> None:
            unheard = receiver.name == self.held and not self.hears
            if unheard or (sender.name == self.held and not self.speaks):
                self._kernel.call_at(self._kernel.now() + GIVE_UP_AFTER, lost)
            else:
                whole(size, reliable, deliver, lost)

        return way


class ByGraph(Access):
    """As nodes of one graph that holds the vehicles and their commanders alone."""

    protocol = "a graph"

    def __init__(
        self, kernel: Kernel, fleet: SimulatedFleet, wanted: SimulatedVehicle, seed: int, sharing: str = ""
    ) -> None:
        self._kernel = kernel
        self._vehicle, self._autopilot = wanted.vehicle.name, wanted.vehicle.autopilot
        random = stream(seed, f"wire/{self._vehicle}")
        self._wire = self.hand = _HandOnNode(kernel, random, wanted.faults)
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
        """From now on this happens to what passes, in both directions."""
        self._wire.set_faults(faults)

    def first(self) -> Driver:
        """With the hand on its node."""
        driver, name = self._commander(self._vehicle, {})
        self._wire.held = name
        return driver

    def another(self, vehicle: str, **options: str) -> tuple[Driver, Link | None]:
        """As another node."""
        return self._commander(vehicle, options)[0], None

    def _commander(self, vehicle: str, options: dict[str, str]) -> tuple[Driver, str]:
        how = graph_access(self._autopilot, vehicle)
        name = f"commander_{next(self._numbers)}"
        node = self._graph.node(name, f"/{vehicle}", context=ExecutionContext(name))
        driver = how.open_driver(self._kernel, node, vehicle, {"namespace": how.namespace, **options})
        return driver, node.name


def access_to(
    kernel: Kernel, fleet: SimulatedFleet, wanted: SimulatedVehicle, seed: int, sharing: str = ""
) -> Access:
    """The way to a vehicle that its autopilot and driver have in common: links first."""
    if reached_over_links(fleet, wanted):
        return ByLink(kernel, fleet, wanted, seed, sharing)
    return ByGraph(kernel, fleet, wanted, seed, sharing)
