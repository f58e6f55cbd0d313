"""What surrounds the system in one run: places, ways, zones, air, vehicles, workload. Frozen data, all of it.

Every point is given twice, as WGS-84 degrees with metres AMSL and as metres east and north of the origin, so
that nobody above converts frames for themselves.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from volery.base.errors import Location
from volery.base.frames import LocalFrame
from volery.base.position import AMSL, Position
from volery.base.time import Ns

VEHICLE_KINDS = ("multirotor", "rover")
SENSOR_SETS = ("consumer", "rtk")
STARTS = ("warm", "cold")


@dataclass(frozen=True, slots=True)
class Place:
    """A named point on the ground. ``role`` is free text that components may choose by: ``hospital``,
    ``port``.
    """

    name: str
    latitude: float
    longitude: float
    amsl_m: float
    east_m: float
    north_m: float
    role: str = ""

    @property
    def position(self) -> Position:
        """The same as a position with a typed altitude."""
        return Position(self.latitude, self.longitude, AMSL(self.amsl_m))


@dataclass(frozen=True, slots=True)
class Ways:
    """A graph of roads, or of air corridors: places and junctions by name, joined by straight two-way edges.

    ``height_m`` above ground is where corridors run; 0 for roads. ``edges`` hold two names and the length in
    metres.
    """

    nodes: Mapping[str, Place] = field(default_factory=dict)
    edges: tuple[tuple[str, str, float], ...] = ()
    height_m: float = 0.0


@dataclass(frozen=True, slots=True)
class Prism:
    """An upright volume over a polygon: a no-fly zone or a building. Corners are (east, north) metres, in
    order.

    It reaches from ``floor_m`` to ``ceiling_m`` above the origin's ground.
    """

    name: str
    corners: tuple[tuple[float, float], ...]
    floor_m: float = 0.0
    ceiling_m: float = float("inf")


@dataclass(frozen=True, slots=True)
class Wind:
    """``direction_deg``: where it blows *from*, clockwise from north. ``gusts_m_s``: standard deviation."""

    speed_m_s: float = 0.0
    direction_deg: float = 0.0
    gusts_m_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Battery:
    """``charge`` is 0..1 at the start; ``voltage_v`` nominal, ``None`` for the usual one of the vehicle's
    kind.
    """

    capacity_coulomb: float
    charge: float = 1.0
    voltage_v: float | None = None


@dataclass(frozen=True, slots=True)
class Vehicle:
    """A drone or a rover with its autopilot.

    ``at`` is where it stands at the start, ``heading_deg`` clockwise from north. ``battery`` is ``None`` for
    the usual one of its kind. ``sensors`` is ``consumer`` or ``rtk``; ``started`` ``warm`` (estimator
    settled, GPS fixed) or ``cold``. ``parameters`` are the autopilot's own, by its own names. ``processor``
    is where the node runs that serves it under MAVROS's names, ``None`` where no computer of the model does.
    """

    name: str
    kind: str
    autopilot: str
    at: Place
    heading_deg: float = 0.0
    battery: Battery | None = None
    sensors: str = "consumer"
    started: str = "warm"
    parameters: Mapping[str, float] = field(default_factory=dict)
    processor: str | None = None
    where: Location | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class Workload:
    """What is asked of the system: ``rate_hz`` orders a second on average, ``count`` in all (``None``: no
    end).

    ``stream`` names the random stream that the orders are drawn from.
    """

    requesters: int = 1
    rate_hz: float = 0.0
    count: int | None = None
    first_ns: Ns = 0
    stream: str = "workload"


@dataclass(frozen=True, slots=True)
class Fault:
    """Something that breaks at a stated time; ``duration_ns`` ``None`` means for good."""

    name: str
    kind: str
    vehicle: str
    at_ns: Ns
    duration_ns: Ns | None = None


@dataclass(frozen=True, slots=True)
class Environment:
    """The surroundings. The terrain is flat at the origin's altitude."""

    origin: LocalFrame = field(default_factory=lambda: LocalFrame(0.0, 0.0, 0.0))
    places: Mapping[str, Place] = field(default_factory=dict)
    roads: Ways = Ways()
    corridors: Ways = Ways()
    no_fly_zones: tuple[Prism, ...] = ()
    buildings: tuple[Prism, ...] = ()
    wind: Wind = Wind()
    vehicles: tuple[Vehicle, ...] = ()
    workload: Workload = Workload()
    faults: tuple[Fault, ...] = ()

    def places_with(self, role: str) -> tuple[Place, ...]:
        """The places of one role, in the order of the model."""
        return tuple(place for place in self.places.values() if place.role == role)
