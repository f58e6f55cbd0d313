"""How programs reach a simulated vehicle: each on a link of its own, or each as a node of one graph."""

from __future__ import annotations

from abc import ABC, abstractmethod
from itertools import count
from typing import Protocol

from volery.base.errors import CapabilityError
from volery.graph import Graph
from volery.graph.node import NodeId
from volery.kernel.api import Action, Kernel
from volery.kernel.task import Place
from volery.links.link import Link
from volery.run.airfield import LINK_DELAY, Airfield
from volery.run.graph_wire import FREE
from volery.run.serving import SIMULATED, serve, serving
from volery.run.simulated import Simulated, link_to
from volery.testing.tap import Tap
from volery.vehicles.driver import Driver, drivers


class Hand(Protocol):
    """A hand on the wire of the first program: what passes, in either direction."""

    hears: bool
    speaks: bool

    def cut(self) -> None:
        """Nothing passes any more."""

    def mend(self) -> None:
        """All passes again."""


class Access(ABC):
    """Opens drivers. ``hand`` is on the wire of the first; ``link`` is that wire, where there is one."""

    hand: Hand
    link: Link | None = None
    protocol = ""

    @abstractmethod
    def first(self) -> Driver:
        """That of the program under test."""

    @abstractmethod
    def another(self, vehicle: str, **options: str) -> tuple[Driver, Link | None]:
        """That of another program, beside it; and its link, where there are links."""


class ByLink(Access):
    """Over links; what *sharing* says and hears is on the first program's link, too."""

    def __init__(
        self, kernel: Kernel, airfield: Airfield, wanted: Simulated, seed: int, sharing: str = ""
    ) -> None:
        self._kernel, self._airfield = kernel, airfield
        self._vehicle = wanted.vehicle.name
        self._factory = drivers.load(wanted.vehicle.autopilot)
        self.protocol = self._factory.codec.name
        self.link = link_to(kernel, airfield, wanted, seed)
        self._tap = self.hand = Tap(self.link)
        if sharing:
            self._tap.share(airfield.link(sharing))

    def first(self) -> Driver:
        """Through the hand."""
        return self._open(self._tap, self._vehicle, {})

    def another(self, vehicle: str, **options: str) -> tuple[Driver, Link | None]:
        """On a new link."""
        link = self._airfield.link(vehicle)
        return self._open(link, vehicle, options), link

    def _open(self, link: Link, vehicle: str, options: dict[str, str]) -> Driver:
        open_driver = self._factory.on_link
        assert open_driver is not None, "seen by access_to"
        return open_driver(self._kernel, link, vehicle, {**SIMULATED, **options})


class _Carrier:
    """Carries the messages of a graph, unless the hand has cut off the node that it is laid on."""

    def __init__(self, kernel: Kernel) -> None:
        self.hears = self.speaks = True
        self.held = ""
        self._kernel = kernel

    def cut(self) -> None:
        """What is sent from now on is lost."""
        self.hears = self.speaks = False

    def mend(self) -> None:
        """All passes again."""
        self.hears = self.speaks = True

    def carry(self, one: NodeId, other: NodeId, size: int, sure: bool, deliver: Action, lost: Action) -> None:
        """As long as over a serial line."""
        del size, sure
        silenced = (one.name == self.held and not self.speaks) or (other.name == self.held and not self.hears)
        self._kernel.call_at(self._kernel.now() + LINK_DELAY, lost if silenced else deliver)


class ByGraph(Access):
    """As nodes of one graph that holds the vehicles and their commanders alone."""

    protocol = "a graph"

    def __init__(self, kernel: Kernel, airfield: Airfield, wanted: Simulated, sharing: str = "") -> None:
        self._kernel = kernel
        self._vehicle, self._autopilot = wanted.vehicle.name, wanted.vehicle.autopilot
        self._carrier = self.hand = _Carrier(kernel)
        self._graph = Graph(
            kernel, lambda node, call, x: FREE, self._carrier.carry, records=lambda topic: False
        )
        self._numbers = count(1)
        for vehicle in filter(None, (self._vehicle, sharing)):
            serve(self._graph, airfield, vehicle, serving(self._autopilot, vehicle), Place(vehicle))

    def first(self) -> Driver:
        """With the hand on its node."""
        driver, name = self._commander(self._vehicle, {})
        self._carrier.held = name
        return driver

    def another(self, vehicle: str, **options: str) -> tuple[Driver, Link | None]:
        """As another node."""
        return self._commander(vehicle, options)[0], None

    def _commander(self, vehicle: str, options: dict[str, str]) -> tuple[Driver, str]:
        how = serving(self._autopilot, vehicle)
        name = f"commander_{next(self._numbers)}"
        node = self._graph.node(name, f"/{vehicle}", place=Place(name))
        driver = how.open_driver(self._kernel, node, vehicle, {"namespace": how.namespace, **options})
        return driver, node.name


def access_to(kernel: Kernel, airfield: Airfield, wanted: Simulated, seed: int, sharing: str = "") -> Access:
    """The way to a vehicle that its autopilot and driver have in common: links first.

    Raises ``CapabilityError`` for faults of a wire where there is none.
    """
    name, autopilot = wanted.vehicle.name, wanted.vehicle.autopilot
    if airfield.family(name).codec is not None and drivers.load(autopilot).on_link is not None:
        return ByLink(kernel, airfield, wanted, seed, sharing)
    if wanted.faults is not None:
        raise CapabilityError(f"{name}: {autopilot} is reached over a graph: there is no wire to it")
    return ByGraph(kernel, airfield, wanted, sharing)
