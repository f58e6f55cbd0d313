"""The surroundings of the system in one run: places, ways, zones, air, vehicles, workload, faults.

Frozen data. Every point is given twice, as WGS-84 degrees with metres AMSL and as metres east and north of
the origin, so that no other package converts frames. Most classes declare how they are written in a model;
points, ways and prisms are written differently from what they become, so each has a text form beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from itertools import pairwise
from math import hypot, inf, pi
from pathlib import Path as FilePath
from typing import Annotated, Any

from volery.base import units
from volery.base.elementary import cos, sin
from volery.base.errors import Location, choices
from volery.base.frames import LocalFrame
from volery.base.position import AMSL, Position
from volery.base.time import Ns
from volery.model import rules
from volery.model.added_sensors import ADDED_SENSOR, AddedSensor, Odometry
from volery.model.airframes import AIRFRAME, BATTERY, LOAD, MASS, Airframe, BatterySpec
from volery.model.components import FileBeside
from volery.model.faults import FAULT, Fault
from volery.model.fields import (
    AUTOPILOT,
    DISTANCE,
    HEADING,
    LATITUDE,
    LENGTH,
    LONGITUDE,
    NUMBER,
    PERIOD,
    RATE,
    SPEED,
    TEXT,
    TIME,
    VEHICLE,
    Key,
    ListOf,
    MapOf,
    OneOf,
    QuantityField,
    Record,
    Schema,
    Shared,
    Shorter,
    Syntax,
    Whole,
    WrongValueError,
    read_child,
)
from volery.model.floor_plan import FLOOR_PLAN, FloorPlan
from volery.model.fmu_bodies import FMU, Fmu
from volery.model.prices import PRICE, StatedPrice
from volery.model.reading import ModelReading
from volery.model.recorded_inputs import INPUTS, RecordedInput
from volery.model.resources import POWER
from volery.model.text import Path, TextNode

MOST_COPIES = 1000
"""The greatest `count` of a vehicle."""

VEHICLE_KINDS = ("multirotor", "rover")
VEHICLE_NAMES = (
    *("mavros", "roscopter", "pprzros"),
    *("px4", "px4-1.16", "px4-1.15", "px4-1.14"),
    *("ardupilot", "ardupilot-4.5"),
)
SENSOR_SETS = ("consumer", "rtk", "sih")
STARTS = ("warm", "cold")
LIGHTS = ("day", "dusk", "night")
MARKERS = {"36h11": 587, "16h5": 30, "aruco_4x4": 50, "aruco_5x5": 100, "aruco_6x6": 250}
"""How many markers there are of each family."""

CIRCLE_CORNERS = 32
FARTHEST_M = 100_000.0
"""A local frame is a tangent plane: farther away the ground has curved away by hundreds of metres."""

_ENVIRONMENT: Path = ("environment",)


# -- points


@dataclass(frozen=True, slots=True)
class PlaceSpec:
    """A named point on the ground. ``role`` is free text that components may choose places by.

    A vehicle that stands there disarmed gets a full battery after ``battery_swap_ns``, and ``charging_w``
    into the one it has.
    """

    name: str
    latitude: float
    longitude: float
    amsl_m: float
    east_m: float
    north_m: float
    role: str = ""
    battery_swap_ns: Ns | None = None
    charging_w: float = 0.0

    @property
    def position(self) -> Position:
        """The place as a position with a typed altitude."""
        return Position(self.latitude, self.longitude, AMSL(self.amsl_m))


@dataclass(frozen=True, slots=True)
class OriginSpec:
    """The origin of the local frame. The ground is flat at its altitude."""

    latitude: Annotated[float, LATITUDE, "WGS-84 latitude."]
    longitude: Annotated[float, LONGITUDE, "WGS-84 longitude."]
    amsl: Annotated[float, LENGTH, "Altitude of the ground above mean sea level."] = 0.0


@dataclass(frozen=True, slots=True)
class PointSpec:
    """A point on the ground: a place, WGS-84 degrees, or metres from either or from the origin."""

    place: Annotated[str | None, TEXT, "Name of a place of the environment."] = None
    east_m: Annotated[float | None, LENGTH, "Distance east of that point, or of the origin."] = None
    north_m: Annotated[float | None, LENGTH, "Distance north of that point, or of the origin."] = None
    latitude: Annotated[float | None, LATITUDE, "WGS-84 latitude."] = None
    longitude: Annotated[float | None, LONGITUDE, "WGS-84 longitude."] = None


@dataclass(frozen=True, slots=True)
class NamedPoint(PointSpec):
    """A named point on the ground."""

    role: Annotated[str, TEXT, "Free text that components may choose places by, such as `hospital`."] = ""
    battery_swap_ns: Annotated[
        Ns | None, PERIOD, "A vehicle that stands there disarmed has a full battery after this time."
    ] = None
    charging_w: Annotated[float, POWER, "Power into the battery of a vehicle that stands there disarmed."] = (
        0.0
    )
    per: Annotated[
        str | None, VEHICLE, "A vehicle with a `count`: a place for each, `spacing` beside one another."
    ] = None


class Geography:
    """The local frame and the named places of a model that is being read. Use with ``ModelReading.once``."""

    def __init__(self, reading: ModelReading) -> None:
        origin = OriginSpec(0.0, 0.0)
        node = reading.root.at((*_ENVIRONMENT, "origin"))
        if node is not None:
            right, found = read_child(Record(OriginSpec), node, (*_ENVIRONMENT, "origin"), reading)
            origin = found if right else origin
        self.reading = reading
        self.frame = LocalFrame(origin.latitude, origin.longitude, origin.amsl)
        self.places: dict[str, PlaceSpec] = {}
        node = reading.root.at((*_ENVIRONMENT, "places"))
        if node is not None:
            self._read_places(node)

    def _read_places(self, node: TextNode) -> None:
        """Read the named places. A place may stand where another one does; those are read last."""
        path = (*_ENVIRONMENT, "places")
        right, points = read_child(MapOf(Record(NamedPoint)), node, path, self.reading)
        if not right:
            return
        later = [name for name, point in points.items() if point.place is not None]
        for name in [*(name for name in points if name not in later), *later]:
            point = points[name]
            found = self.place((*path, name), name, point)
            if found is not None:
                at = found.latitude, found.longitude, found.amsl_m, found.east_m, found.north_m
                self.places[name] = PlaceSpec(name, *at, point.role, point.battery_swap_ns, point.charging_w)
        self.places = {name: self.places[name] for name in points if name in self.places}

    def place(self, path: Path, name: str, point: PointSpec) -> PlaceSpec | None:
        """Return where the *point* at *path* is; None after reporting a problem."""
        stated = {one.name for one in fields(PointSpec) if getattr(point, one.name) is not None}
        start, moved = stated - {"east_m", "north_m"}, stated & {"east_m", "north_m"}
        frame = self.frame
        if start == {"place"} and point.place is not None:
            if not self.reading.known(path, point.place, "place", self.places):
                return None
            base = self.places[point.place]
            if not moved:
                return base
            east, north = base.east_m, base.north_m
        elif (
            start == {"latitude", "longitude"} and point.latitude is not None and point.longitude is not None
        ):
            east, north, _ = frame.to_enu(point.latitude, point.longitude, frame.amsl)
        elif moved and not start:
            east = north = 0.0
        else:
            what = "a point is {east, north} from the origin, {latitude, longitude}, or the name of a place"
            self.reading.problems.add(path, what)
            return None
        if moved:
            east, north = east + (point.east_m or 0.0), north + (point.north_m or 0.0)
            latitude, longitude, _ = frame.from_enu((east, north, 0.0))
        else:
            latitude, longitude = point.latitude or 0.0, point.longitude or 0.0
        if hypot(east, north) > FARTHEST_M:
            away = hypot(east, north) / 1000.0
            what = f"{away:.0f} km from the origin; at most {FARTHEST_M / 1000:.0f} km make sense"
            self.reading.problems.add(path, what)
        return PlaceSpec(name, latitude, longitude, frame.amsl, east, north)


@dataclass(frozen=True)
class _Resolved(Syntax):
    """What is written as a record ``text`` and becomes what ``resolve`` makes of it."""

    text: Syntax
    resolve: Callable[[Any, Path, ModelReading], Any]

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> Any:
        """See ``Syntax``."""
        made = self.resolve(self.text.read(node, path, reading), path, reading)
        if made is None:  # its problem has been reported
            raise WrongValueError("")
        return made

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return self.text.schema(definitions)


def _place(point: PointSpec, path: Path, reading: ModelReading) -> PlaceSpec | None:
    return reading.once(Geography).place(path, str(path[-2]), point)


def _junction(point: PointSpec, path: Path, reading: ModelReading) -> PlaceSpec | None:
    return reading.once(Geography).place(path, str(path[-1]), point)


PLACE = _Resolved(Shorter(Record(PointSpec), key="place"), _place)
"""A point that belongs to something, and is named after it."""


def _frame(reading: ModelReading) -> LocalFrame:
    return reading.once(Geography).frame


def _places(reading: ModelReading) -> dict[str, PlaceSpec]:
    return reading.once(Geography).places


# -- ways and volumes


@dataclass(frozen=True, slots=True)
class Ways:
    """A graph of roads, or of air corridors: places and junctions by name, joined by straight two-way edges.

    ``height_m`` above ground is where corridors run; 0 for roads. ``edges`` hold two names and the length in
    metres.
    """

    nodes: Mapping[str, PlaceSpec] = field(default_factory=dict)
    edges: tuple[tuple[str, str, float], ...] = ()
    height_m: float = 0.0


@dataclass(frozen=True, slots=True)
class WaysText:
    """A graph of roads or air corridors."""

    height_m: Annotated[float, DISTANCE, "Height above ground; 0 for roads."] = 0.0
    junctions: Annotated[
        Mapping[str, PlaceSpec], MapOf(_Resolved(Record(PointSpec), _junction)), "Points that only join ways."
    ] = field(default_factory=dict)
    ways: Annotated[
        tuple[tuple[str, ...], ...],
        ListOf(ListOf(TEXT)),
        "Each way is a list of places and junctions, joined one after another in both directions.",
    ] = ()


def _ways(text: WaysText, path: Path, reading: ModelReading) -> Ways:
    known = {**reading.once(Geography).places, **text.junctions}
    edges: list[tuple[str, str, float]] = []
    for number, way in enumerate(text.ways):
        here: Path = (*path, "ways", number)
        if len(way) < 2:
            reading.problems.add(here, "a way joins at least two places or junctions")
        ends = [known[name] for name in way if reading.known(here, name, "place or junction", known)]
        edges += [
            (one.name, other.name, hypot(other.east_m - one.east_m, other.north_m - one.north_m))
            for one, other in pairwise(ends)
        ]
    used = {name for edge in edges for name in edge[:2]}
    nodes = {name: place for name, place in known.items() if name in used}
    return Ways(nodes, tuple(edges), text.height_m)


@dataclass(frozen=True, slots=True)
class Prism:
    """An upright volume over a polygon: a no-fly zone or a building. Corners are (east, north) metres.

    It reaches from ``floor_m`` to ``ceiling_m`` above the origin's ground.
    """

    name: str
    corners: tuple[tuple[float, float], ...]
    floor_m: float = 0.0
    ceiling_m: float = inf


@dataclass(frozen=True, slots=True)
class PrismText:
    """An upright volume over a polygon of corners, or over a circle."""

    corners: Annotated[tuple[PlaceSpec, ...], ListOf(PLACE), "Corners of the polygon, in order."] = ()
    centre: Annotated[PlaceSpec | None, PLACE, "Centre of the circle."] = None
    radius_m: Annotated[float | None, DISTANCE, "Radius of the circle."] = None
    floor_m: Annotated[float, DISTANCE, "Lower end, above the origin's ground."] = 0.0
    ceiling_m: Annotated[float | None, DISTANCE, "Upper end; unlimited if it is not given."] = None


def _prism(text: PrismText, path: Path, reading: ModelReading) -> Prism | None:
    ceiling = text.ceiling_m if text.ceiling_m is not None else inf
    if ceiling <= text.floor_m:
        what = f"its ceiling ({ceiling:g} m) is not above its floor ({text.floor_m:g} m)"
        reading.problems.add(path, what)
    if text.centre is not None and text.radius_m and not text.corners:
        corners = _circle(text.centre, text.radius_m)
    elif len(text.corners) >= 3 and text.centre is None and text.radius_m is None:
        corners = tuple((corner.east_m, corner.north_m) for corner in text.corners)
        if _on_a_line(corners):
            reading.problems.add(
                path, "its corners lie on one line and enclose nothing; give at least three others"
            )
        crossing = _crossing(corners)
        if crossing is not None:
            first, second = (f"{one + 1} to {(one + 1) % len(corners) + 1}" for one in crossing)
            what = f"its sides from corner {first} and {second} cross; give the corners in order around it"
            reading.problems.add(path, what)
    else:
        reading.problems.add(path, "give at least three corners, or a centre and a radius")
        return None
    return Prism(str(path[-1]), corners, text.floor_m, ceiling)


def _on_a_line(corners: tuple[tuple[float, float], ...]) -> bool:
    """Return whether all corners, in metres, lie within a millimetre of a line."""
    (east, north), *others = corners
    far_east, far_north = max(others, key=lambda one: hypot(one[0] - east, one[1] - north))
    along_east, along_north = far_east - east, far_north - north
    length = hypot(along_east, along_north)
    return all(abs(along_east * (n - north) - along_north * (e - east)) <= 0.001 * length for e, n in others)


def _crossing(corners: tuple[tuple[float, float], ...]) -> tuple[int, int] | None:
    """Return two sides of a polygon that cross, by their first corners from 0; None if none do.

    The sides are taken from west to east: only those that begin before another one ends can cross it.
    """
    count = len(corners)
    sides = sorted(range(count), key=lambda one: min(corners[one][0], corners[(one + 1) % count][0]))
    reached: list[int] = []
    for side in sides:
        here, to = corners[side], corners[(side + 1) % count]
        west = min(here[0], to[0])
        reached = [one for one in reached if max(corners[one][0], corners[(one + 1) % count][0]) >= west]
        for one in reached:
            start, end = corners[one], corners[(one + 1) % count]
            if _parts(here, to, start, end) and _parts(start, end, here, to):
                return min(one, side), max(one, side)
        reached.append(side)
    return None


def _parts(
    start: tuple[float, float], end: tuple[float, float], one: tuple[float, float], other: tuple[float, float]
) -> bool:
    """Return whether the line from *start* to *end* has *one* on one side and *other* on the other."""
    along, up = end[0] - start[0], end[1] - start[1]
    left = along * (one[1] - start[1]) - up * (one[0] - start[0])
    right = along * (other[1] - start[1]) - up * (other[0] - start[0])
    return (left > 0.0 > right) or (left < 0.0 < right)


def _circle(centre: PlaceSpec, radius: float) -> tuple[tuple[float, float], ...]:
    """Return the regular polygon around a circle: no part of the circle is outside it."""
    outer = radius / cos(pi / CIRCLE_CORNERS)
    angles = [2.0 * pi * corner / CIRCLE_CORNERS for corner in range(CIRCLE_CORNERS)]
    return tuple(
        (centre.east_m + outer * cos(angle), centre.north_m + outer * sin(angle)) for angle in angles
    )


@dataclass(frozen=True, slots=True)
class MarkerSpec:
    """A square marker that lies level on the ground, or on the building at its place, for cameras to see."""

    name: str
    at: Annotated[PlaceSpec, PLACE, "Where its centre is."]
    size_m: Annotated[float, QuantityField(units.LENGTH, above=0), "Side of its black square."]
    number: Annotated[int, Key("id"), Whole(least=0), "Its number in the family."]
    family: Annotated[
        str, OneOf(MARKERS), "Family: `36h11` and `16h5` are AprilTags, the others ArUco markers."
    ] = "36h11"
    yaw_deg: Annotated[float, HEADING, "Where its upper edge points, clockwise from north."] = 0.0


class _Marker(Record):
    """A marker. Its family must have its number."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> Any:
        """See ``Syntax``."""
        made: MarkerSpec = super().read(node, path, reading)
        if made.number >= MARKERS[made.family]:
            raise WrongValueError(f"{made.family} has the numbers 0 to {MARKERS[made.family] - 1}")
        return made


WAYS = _Resolved(Record(WaysText), _ways)
PRISMS = MapOf(_Resolved(Record(PrismText), _prism), values_only=True)


# -- air, vehicles, workload


@dataclass(frozen=True, slots=True)
class WindSpec:
    """Wind: a mean and gusts. Written as its mean speed alone, or as a mapping."""

    speed_m_s: Annotated[float, SPEED, "Mean speed."] = 0.0
    direction_deg: Annotated[float, HEADING, "Where it blows from, clockwise from north."] = 0.0
    gusts_m_s: Annotated[float, SPEED, "Standard deviation of the gusts."] = 0.0


@dataclass(frozen=True, slots=True)
class FirmwareProgram:
    """The program of real firmware that flies a vehicle.

    ``program`` is a path, or a name without ``/`` that is searched when a run starts. ``parameters`` are
    files of parameters; a later one wins.
    """

    program: str
    parameters: tuple[FilePath, ...] = ()
    repeatable: bool = False


@dataclass(frozen=True, slots=True)
class AutopilotText:
    """What flies a vehicle: a simulated autopilot, or with `firmware` a program of the real one."""

    project: Annotated[str, Key("is"), AUTOPILOT, "Autopilot, such as `ardupilot`."]
    firmware: Annotated[
        str,
        TEXT,
        "Program of its real firmware, which flies in lock step with virtual time: a path relative to the "
        "model, or a name. `arducopter`, `ardurover` and `px4` are searched in the environment variables "
        "`VOLERY_ARDUCOPTER`, `VOLERY_ARDUROVER` and `VOLERY_PX4`, then on PATH as any other name is.",
    ] = ""
    parameters: Annotated[
        tuple[FilePath, ...],
        ListOf(FileBeside(), bare=True),
        "Files of parameters of that program, as ground stations write them: a later one wins, and the "
        "`parameters` of the vehicle win over all.",
    ] = ()
    repeatable: Annotated[
        bool,
        OneOf((False, True)),
        "Whether that program gives the same answers in each run; it keeps no log then.",
    ] = False


class _Autopilot(Shorter):
    """The name of an autopilot, or a mapping."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> AutopilotText:
        """See ``Syntax``. A problem of a name alone is one at *path*."""
        if isinstance(node.value, dict):
            read: AutopilotText = super().read(node, path, reading)
            return read
        return AutopilotText(AUTOPILOT.read(node, path, reading) or "")


_AUTOPILOT = _Autopilot(Record(AutopilotText), key="is")


def _project(text: AutopilotText, path: Path, reading: ModelReading) -> str:
    return text.project


@dataclass(frozen=True, slots=True)
class VehicleSpec:
    """A drone or a rover with its autopilot.

    ``firmware`` is the program of real firmware that flies it, None where a simulated one does.
    ``processor`` is where the node runs that serves it under MAVROS's names, None where no computer of the
    model does.
    """

    name: str
    kind: Annotated[str, OneOf(VEHICLE_KINDS), "Kind of vehicle."]
    autopilot: Annotated[
        str,
        _Resolved(_AUTOPILOT, _project),
        "What flies it, such as `ardupilot`; a mapping for a program of its real firmware.",
    ]
    at: Annotated[PlaceSpec, PLACE, "Where it stands at the start."]
    heading_deg: Annotated[float, HEADING, "Heading at the start, clockwise from north."] = 0.0
    battery: Annotated[
        BatterySpec | None, BATTERY, "Its battery; that of its airframe or its kind if it is not given."
    ] = None
    sensors: Annotated[
        str,
        OneOf(SENSOR_SETS),
        "Grade of its sensors: `consumer`, or `rtk` with a satellite receiver to 2 cm.",
    ] = "consumer"
    added_sensors: Annotated[
        tuple[AddedSensor | str, ...],
        ListOf(ADDED_SENSOR, bare=True),
        "Sensors that it carries as well: built-in ones, with settings or without, and those of packages.",
    ] = ()
    started: Annotated[
        str, OneOf(STARTS), "`warm`: estimator settled, satellites fixed. `cold`: just switched on."
    ] = "warm"
    parameters: Annotated[
        Mapping[str, float], MapOf(NUMBER, free=True), "Parameters of the autopilot, by its own names."
    ] = field(default_factory=dict)
    version: Annotated[
        str, TEXT, 'Version of that firmware, such as `"1.14"`; the newest that is simulated if not given.'
    ] = ""
    features: Annotated[
        str,
        TEXT,
        "Features of that firmware that are off by default: their names with commas between them, or `all`.",
    ] = ""
    names: Annotated[
        str,
        OneOf(VEHICLE_NAMES),
        "Whose ROS names the node that serves it has, below `/<vehicle>`: `mavros`, `roscopter` (with "
        "`send_rc`), for Paparazzi `pprzros`, or those of its autopilot's own ROS 2 interface, `px4` (1.17) "
        "and `ardupilot` (4.8) or an older one, which lie below `/` where one vehicle has them. The first "
        "that fits if it is not given.",
    ] = ""
    transmitter: Annotated[
        Mapping[str, int],
        MapOf(Whole(least=0, most=3000), free=True),
        "Where the pilot's transmitter rests: pulse widths in microseconds by channel, from 1.",
    ] = field(default_factory=dict)
    airframe: Annotated[
        Airframe | None,
        AIRFRAME,
        "Airframe of a multirotor, as a rule the name of its file; by default a usual quadrotor of 3 kg.",
    ] = None
    body: Annotated[
        Fmu | None,
        FMU,
        "What moves a multirotor: an FMU; by default the laws of its airframe.",
    ] = None
    payload_kg: Annotated[float, LOAD, "Mass that it carries from the start, beside its own."] = 0.0
    price: Annotated[
        StatedPrice | None, PRICE, "Its price without battery and computers; that of its airframe by default."
    ] = None
    firmware: FirmwareProgram | None = None
    processor: str | None = None
    where: Location | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class Spacing:
    """The distance between two copies of a vehicle that would stand at one point."""

    east_m: Annotated[float, LENGTH, "Distance east."] = 0.0
    north_m: Annotated[float, LENGTH, "Distance north."] = 0.0


@dataclass(frozen=True, slots=True)
class VehicleText(VehicleSpec):
    """A drone or a rover with its autopilot, or a number of them."""

    at: Annotated[
        PlaceSpec,
        ListOf(PLACE, bare=True),
        "Where it stands at the start. With a `count`, a list of points is taken in turn.",
    ]
    count: Annotated[
        int | None,
        Whole(least=1, most=MOST_COPIES),
        "A number of them, `NAME_1`, `NAME_2` and so on, each with what belongs to it.",
    ] = None
    spacing: Annotated[
        Spacing, Record(Spacing), "Distance between those that would stand at one point; by default 3 m east."
    ] = Spacing()


def _firmware(
    vehicle: VehicleSpec, node: TextNode, path: Path, reading: ModelReading
) -> FirmwareProgram | None:
    """Return the program that the `autopilot` of a vehicle states; None for a simulated autopilot."""
    here = (*path, "autopilot")
    text: AutopilotText = _AUTOPILOT.read(node.items["autopilot"], here, reading)
    if not text.firmware:
        for key in ("parameters", "repeatable"):
            if getattr(text, key):
                what = "this is of a program of real firmware: state it, too, as in `firmware: arducopter`"
                reading.problems.add((*here, key), what)
        return None
    for key, word in (
        ("version", "a version of its own; leave it out"),
        ("features", "features of its own; leave them out"),
    ):
        if getattr(vehicle, key):
            what = f"{text.firmware} has {word}"
            reading.problems.add((*path, key), what)
    program = str(reading.folder / text.firmware) if "/" in text.firmware else text.firmware
    return FirmwareProgram(program, text.parameters, text.repeatable)


class _Vehicle(Record):
    """A vehicle. A number of vehicles has been replaced by its copies when it is read."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> VehicleSpec:
        """See ``Syntax``. An airframe must be one that the autopilot flies, with the payload."""
        made: VehicleSpec = super().read(node, path, reading)
        made = replace(made, firmware=_firmware(made, node, path, reading))
        problems, airframe = reading.problems, made.airframe
        named = [sensor if isinstance(sensor, str) else sensor.named for sensor in made.added_sensors]
        for name in sorted({name for name in named if named.count(name) > 1}):
            what = f"two sensors are called {name!r}; give each a `name` of its own"
            problems.add((*path, "added_sensors"), what, rule=rules.DUPLICATE_NAME)
        if sum(isinstance(sensor, Odometry) for sensor in made.added_sensors) > 1:
            problems.add((*path, "added_sensors"), "it has two odometries; only one can move base_link")
        if made.kind != "multirotor" and made.body is not None:
            problems.add((*path, "body"), f"a {made.kind} has no body of its own; only a multirotor has one")
        if made.kind != "multirotor" and airframe is not None:
            here = reading.where((*path, "airframe", "file"))
            problems.add(
                (*path, "airframe"), f"a {made.kind} has no airframe; only a multirotor has one", here
            )
        elif airframe is not None:
            flying = sorted(reading.vocabulary.airframes)
            if made.autopilot not in flying and made.firmware is None:
                what = f"a simulated {made.autopilot} flies its own airframe; {choices(flying)} fly others"
                problems.add((*path, "airframe"), what, reading.where((*path, "airframe", "file")))
            if made.payload_kg > airframe.spare_kg >= 0.0:
                what = (
                    f"{made.payload_kg:g} kg are too heavy: beside its own {airframe.mass_kg:g} kg it lifts "
                    f"{airframe.spare_kg:.2g} kg at most"
                )
                problems.add((*path, "payload"), what)
        return made

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return Record(VehicleText).schema(definitions)


@dataclass(frozen=True, slots=True)
class CarriedLoad:
    """Something that a gripper takes and carries, such as a parcel."""

    name: str
    at: Annotated[PlaceSpec, PLACE, "Where it lies at the start."]
    mass_kg: Annotated[float, MASS, "Its mass, which is part of the vehicle's while it is carried."]


@dataclass(frozen=True, slots=True)
class Orders:
    """Orders that requesters place."""

    rate_hz: Annotated[float, RATE, "Orders a second, on average."] = 0.0
    count: Annotated[int | None, Whole(least=0), "Number of orders in all; no end if it is not given."] = None
    first_ns: Annotated[Ns, TIME, "Time of the first order."] = 0
    stream: Annotated[str, Key("seed"), TEXT, "Name of the random stream that orders are drawn from."] = (
        "workload"
    )


@dataclass(frozen=True, slots=True)
class WorkloadText:
    """What is requested from the system."""

    requesters: Annotated[int, Whole(least=0), "Number of requesters."] = 1
    orders: Annotated[Orders, Record(Orders), "Orders that the requesters place."] = Orders()


@dataclass(frozen=True, slots=True)
class Workload(Orders):
    """What is requested from the system: the orders of a number of requesters."""

    requesters: int = 1


def _workload(text: WorkloadText, path: Path, reading: ModelReading) -> Workload:
    orders = text.orders
    return Workload(orders.rate_hz, orders.count, orders.first_ns, orders.stream, text.requesters)


@dataclass(frozen=True, slots=True)
class Environment:
    """The surroundings of the system. The terrain is flat at the origin's altitude."""

    origin: Annotated[LocalFrame, Shared(Record(OriginSpec), _frame), "Origin of the local frame."] = field(
        default_factory=lambda: LocalFrame(0.0, 0.0, 0.0)
    )
    places: Annotated[
        Mapping[str, PlaceSpec], Shared(MapOf(Record(NamedPoint)), _places), "Named points on the ground."
    ] = field(default_factory=dict)
    roads: Annotated[Ways, WAYS, "Roads, for rovers."] = Ways()
    corridors: Annotated[Ways, WAYS, "Air corridors, for drones."] = Ways()
    no_fly_zones: Annotated[tuple[Prism, ...], PRISMS, "Volumes that drones must not enter."] = ()
    buildings: Annotated[
        tuple[Prism, ...],
        PRISMS,
        "What stands in the world and can be hit: buildings, walls, bridges (with a floor).",
    ] = ()
    floor_plan: Annotated[
        FloorPlan | None,
        FLOOR_PLAN,
        "Walls from a picture, beside the buildings; its axes are east and north.",
    ] = None
    markers: Annotated[
        tuple[MarkerSpec, ...],
        MapOf(_Marker(MarkerSpec), values_only=True),
        "Markers that cameras see, by name.",
    ] = ()
    light: Annotated[
        str,
        OneOf(LIGHTS),
        "For cameras: an overcast `day`, `dusk` or a lit street, a `night` without lamps.",
    ] = "day"
    wind: Annotated[WindSpec, Shorter(Record(WindSpec), key="speed"), "Wind over all of the world."] = (
        WindSpec()
    )
    vehicles: Annotated[
        tuple[VehicleSpec, ...], MapOf(_Vehicle(VehicleSpec), values_only=True), "Drones and rovers, by name."
    ] = ()
    loads: Annotated[
        tuple[CarriedLoad, ...],
        MapOf(Record(CarriedLoad), values_only=True),
        "What grippers take and carry, by name: a gripper that closes within 2 m takes the nearest.",
    ] = ()
    workload: Annotated[
        Workload, _Resolved(Record(WorkloadText), _workload), "What is requested from the system."
    ] = Workload()
    faults: Annotated[
        tuple[Fault, ...], MapOf(FAULT, values_only=True), "What breaks, and when. See the list of faults."
    ] = ()
    inputs: Annotated[
        tuple[RecordedInput, ...], INPUTS, "Recordings that are played into the graph of a run, by name."
    ] = ()

    @property
    def solids(self) -> tuple[Prism, ...]:
        """Return the buildings and the walls of the floor plan."""
        plan = self.floor_plan
        if plan is None:
            return self.buildings
        walls = (
            Prism(f"{plan.name}_{number}", corners, 0.0, plan.height_m)
            for number, corners in enumerate(plan.walls, 1)
        )
        return *self.buildings, *walls

    def places_with(self, role: str) -> tuple[PlaceSpec, ...]:
        """Return the places of one role, in the order of the model."""
        return tuple(place for place in self.places.values() if place.role == role)
