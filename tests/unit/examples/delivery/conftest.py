"""The delivery service's components, each alone, among made-up neighbours."""

from __future__ import annotations

from pathlib import Path

import pytest

from volery.base.frames import LocalFrame
from volery.base.time import S
from volery.components.instance import Allocation, RunningInstance
from volery.components.loader import Loader
from volery.components.programs import load_program, start
from volery.components.virtual_stdlib import virtual_modules
from volery.kernel.virtual import VirtualKernel
from volery.model.environment import Environment, PlaceSpec, Prism, Ways, Workload
from volery.trace.events import Milestone, Text

COMPONENTS = Path(__file__).parents[4] / "examples" / "delivery" / "components"
FRAME = LocalFrame(43.46, -3.81, 20.0)


def place(name, east, north, role=""):
    latitude, longitude, _ = FRAME.from_enu((east, north, 0.0))
    return PlaceSpec(name, latitude, longitude, FRAME.amsl, east, north, role)


PLACES = {
    one.name: one
    for one in (
        place("store", 0.0, -60.0, "store"),
        place("port_a", 0.0, 0.0, "port"),
        place("port_b", 0.0, 400.0, "port"),
        place("hospital_a", 60.0, 0.0, "hospital"),
        place("hospital_b", 50.0, 400.0, "hospital"),
        place("aside", 200.0, 200.0),
    )
}


def ways(*edges, height=0.0):
    found = []
    for one, other in edges:
        a, b = PLACES[one], PLACES[other]
        found.append((one, other, ((a.east_m - b.east_m) ** 2 + (a.north_m - b.north_m) ** 2) ** 0.5))
    return Ways({name: PLACES[name] for edge in edges for name in edge}, tuple(found), height)


def square(name, east, north, half, floor=0.0, ceiling=float("inf")):
    corners = ((east - half, north - half), (east + half, north - half), (east + half, north + half))
    return Prism(name, (*corners, (east - half, north + half)), floor, ceiling)


CITY = Environment(
    origin=FRAME,
    places=PLACES,
    roads=ways(("store", "port_a"), ("port_a", "hospital_a"), ("port_a", "port_b"), ("port_b", "hospital_b")),
    corridors=ways(("port_a", "port_b"), ("port_a", "aside"), ("aside", "port_b"), height=25.0),
    no_fly_zones=(square("school", 0.0, 200.0, 50.0),),
    workload=Workload(requesters=2, rate_hz=0.01, count=5, first_ns=3 * S),
)


class Bench:
    """A kernel on which single components of the service run."""

    def __init__(self, seed=1, **modules):
        self.events = []
        self.kernel = VirtualKernel(self.events.append)
        self.loader = Loader({**virtual_modules(self.kernel, seed), **modules})
        self.failures = []

    def start(self, file, class_name, operations=(), active=True, **given):
        instance = RunningInstance(
            self.kernel, class_name, Allocation(priority=0 if active else None), operations=operations
        )
        program = load_program(self.loader, class_name, COMPONENTS / file, class_name)
        start(instance, program, given, self.kernel.root, lambda *told: self.failures.append(told))
        return instance

    def run(self, seconds):
        self.kernel.every(S, lambda: None)  # around what is tested, life goes on
        self.kernel.run(round(seconds * S))

    @property
    def types(self):
        return self.loader.sibling("delivery_types", COMPONENTS)

    def parcels(self):
        """Each parcel's states, in order."""
        found = {}
        for event in self.events:
            if isinstance(event, Milestone):
                found.setdefault(event.subject, []).append(event.state)
        return found

    def texts(self):
        return [event.text for event in self.events if isinstance(event, Text)]


@pytest.fixture
def make_bench():
    return Bench


@pytest.fixture
def city():
    return CITY


@pytest.fixture
def make_square():
    return square
