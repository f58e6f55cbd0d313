"""The catalogue of sensors that a model adds to a vehicle: which there are, with which settings. Data only.

One class per kind declares its settings; parser, JSON Schema and reference follow. What a sensor of each kind
measures is in ``volery.simulation.added_sensors``, and ``volery.run.assembly.mounted_sensors`` makes one of
the settings.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, TypeVar

from volery.base import units
from volery.base.time import Ns
from volery.model.fields import (
    HEADING,
    LENGTH,
    NAME,
    NUMBER,
    PERIOD,
    SHARE,
    TEXT,
    TIME,
    Angle,
    Key,
    ListOf,
    QuantityField,
    Record,
    Schema,
    Syntax,
    Whole,
    WrongValueError,
    expected,
)
from volery.model.reading import ModelReading
from volery.model.text import Path, TextNode

MOST_BEAMS = 1_000_000
_RATE = QuantityField(units.RATE, above=0, most=500)
_RANGE = QuantityField(units.LENGTH, above=0, most=100_000)
_PITCH = Angle(90.0)
_CONE = QuantityField(units.ANGLE, above=0, most=120)
_NOISE = QuantityField(units.LENGTH, least=0)
_NEAREST = QuantityField(units.LENGTH, least=0)


class _Point(Syntax):
    """Three lengths: forward, left and up."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> tuple[float, ...]:
        """See ``Syntax``. The values are in metres."""
        found = ListOf(LENGTH).read(_in_metres(node), path, reading)
        if len(found) != 3:
            raise WrongValueError(f"three lengths are expected (forward, left, up), not {len(found)}")
        return found

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return {"type": "array", "items": LENGTH.schema(definitions), "minItems": 3, "maxItems": 3}


def _in_metres(node: TextNode) -> TextNode:
    if not isinstance(node.value, list):
        return node
    bare = [isinstance(one.value, int | float) and not isinstance(one.value, bool) for one in node.value]
    return TextNode(
        [
            TextNode(f"{one.value!r} m", one.where) if number else one
            for one, number in zip(node.value, bare, strict=True)
        ],
        node.where,
    )


class _Name(Syntax):
    """A name of a topic and a frame."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> str:
        """See ``Syntax``."""
        name = TEXT.read(node, path, reading)
        if re.search(NAME, name) is None:
            raise WrongValueError(f"{name!r} is no name: letters, digits, _ and -, starting with a letter")
        return name

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return {"type": "string", "pattern": NAME}


@dataclass(frozen=True, kw_only=True)
class AddedSensor:
    """A sensor that a model adds to a vehicle. ``kind`` is the name of the kind."""

    kind = ""

    name: Annotated[
        str,
        _Name(),
        "Its name and that of its frame, where a vehicle has several of a kind: its topics are then below "
        "`/<vehicle>/<name>/`.",
    ] = ""

    @property
    def named(self) -> str:
        """Its name: by default that of its kind."""
        return self.name or self.kind

    def topic(self, usual: str) -> str:
        """Return a topic below the vehicle's, given its usual one."""
        return f"{self.name}/{usual}" if self.name else usual


@dataclass(frozen=True, kw_only=True)
class SensorSpec(AddedSensor):
    """A sensor at a place of the body."""

    at: Annotated[
        tuple[float, ...], _Point(), "Where it is: metres forward, left and up of the body's centre."
    ] = (0.0, 0.0, 0.0)
    heading_deg: Annotated[float, HEADING, "Where it looks, clockwise from ahead."] = 0.0
    pitch_deg: Annotated[float, _PITCH, "How far it looks down: 90 deg is straight down, -90 deg up."] = 0.0


@dataclass(frozen=True, kw_only=True)
class RangingSensor(SensorSpec):
    """A sensor of distances."""

    range_m: Annotated[float, _RANGE, "Longest distance that it measures."] = 12.0
    nearest_m: Annotated[float, _NEAREST, "Shortest distance that it measures."] = 0.1
    rate_hz: Annotated[float, _RATE, "Samples a second."] = 10.0
    noise_m: Annotated[float, _NOISE, "Standard deviation of a distance."] = 0.01
    lost: Annotated[float, SHARE, "Share of the readings that find nothing though something is there."] = 0.0


ADDED_SENSORS: dict[str, type[AddedSensor]] = {}
"""The kinds, by name."""

C = TypeVar("C", bound=type[AddedSensor])


def added_sensor(kind: str) -> Callable[[C], C]:
    """Register a class of the catalogue under the name of its *kind*."""

    def register(cls: C) -> C:
        cls.kind = kind
        ADDED_SENSORS[kind] = cls
        return cls

    return register


@added_sensor("lidar")
@dataclass(frozen=True, kw_only=True)
class LidarSpec(RangingSensor):
    """A laser scanner in a plane: `sensor_msgs/LaserScan` on `scan`."""

    beams: Annotated[int, Whole(least=2, most=MOST_BEAMS), "Number of its beams."] = 360
    field_deg: Annotated[
        float,
        QuantityField(units.ANGLE, above=0, most=360),
        "Angle that they cover, half of it to each side.",
    ] = 360.0


@added_sensor("lidar3d")
@dataclass(frozen=True, kw_only=True)
class RingLidarSpec(RangingSensor):
    """A laser scanner with several rings, one above the other: `sensor_msgs/PointCloud2` on `points`."""

    rings: Annotated[int, Whole(least=1, most=256), "Number of its rings."] = 16
    columns: Annotated[int, Whole(least=2, most=4096), "Number of beams of a ring."] = 900
    lowest_deg: Annotated[float, _PITCH, "Elevation of the lowest ring."] = -15.0
    highest_deg: Annotated[float, _PITCH, "Elevation of the highest ring."] = 15.0
    range_m: Annotated[float, _RANGE, "Longest distance that it measures."] = 100.0


@added_sensor("depth_camera")
@dataclass(frozen=True, kw_only=True)
class DepthCameraSpec(RangingSensor):
    """A depth camera: `sensor_msgs/Image` of 32FC1 on `depth/image_rect`, and `depth/camera_info`."""

    width: Annotated[int, Whole(least=2, most=2048), "Pixels in a row."] = 160
    height: Annotated[int, Whole(least=1, most=2048), "Rows."] = 120
    field_deg: Annotated[
        float, QuantityField(units.ANGLE, above=0, most=170), "Angle from the first column to the last."
    ] = 90.0


@added_sensor("range_finder")
@dataclass(frozen=True, kw_only=True)
class RangeFinderSpec(RangingSensor):
    """A laser range finder, which looks down unless it is turned: `sensor_msgs/Range` on `range`."""

    field_deg: Annotated[float, _CONE, "Angle of its cone; it reads the nearest return within."] = 2.0
    pitch_deg: Annotated[float, _PITCH, "How far it looks down: 90 deg is straight down, 0 deg ahead."] = 90.0
    range_m: Annotated[float, _RANGE, "Longest distance that it measures."] = 30.0
    rate_hz: Annotated[float, _RATE, "Samples a second."] = 20.0


@added_sensor("sonar")
@dataclass(frozen=True, kw_only=True)
class Sonar(RangingSensor):
    """An ultrasonic range finder, which looks ahead: `sensor_msgs/Range` on `sonar`."""

    field_deg: Annotated[float, _CONE, "Angle of its cone; it reads the nearest return within."] = 30.0
    range_m: Annotated[float, _RANGE, "Longest distance that it measures."] = 5.0
    nearest_m: Annotated[float, _NEAREST, "Shortest distance that it measures."] = 0.2
    noise_m: Annotated[float, _NOISE, "Standard deviation of a distance."] = 0.02


@added_sensor("imu_external")
@dataclass(frozen=True, kw_only=True)
class ExternalImuSpec(AddedSensor):
    """A second inertial sensor, of the grade `consumer`: `sensor_msgs/Imu` on `imu_external`."""

    rate_hz: Annotated[float, _RATE, "Samples a second."] = 200.0


class _Factors(Syntax):
    """Up to five factors of a lens."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> tuple[float, ...]:
        """See ``Syntax``. Factors that are not given are 0."""
        found: tuple[float, ...] = ListOf(NUMBER).read(node, path, reading)
        if len(found) > 5:
            raise WrongValueError(f"at most five factors are expected (k1, k2, p1, p2, k3), not {len(found)}")
        return (*found, *[0.0] * (5 - len(found)))

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return {"type": "array", "items": NUMBER.schema(definitions), "maxItems": 5}


@added_sensor("camera")
@dataclass(frozen=True, kw_only=True)
class CameraSpec(SensorSpec):
    """A grey camera: `sensor_msgs/Image` (mono8) on `camera/image_raw`, with its `camera/camera_info`."""

    width: Annotated[int, Whole(least=16, most=4096), "Columns of a picture."] = 320
    height: Annotated[int, Whole(least=16, most=4096), "Rows of a picture."] = 240
    field_deg: Annotated[
        float,
        QuantityField(units.ANGLE, above=0, most=150),
        "Angle between left and right edge of a picture.",
    ] = 67.0
    distortion: Annotated[
        tuple[float, ...], _Factors(), "Factors k1, k2, p1, p2, k3 of the lens, as in `plumb_bob`."
    ] = (0.0, 0.0, 0.0, 0.0, 0.0)
    rate_hz: Annotated[float, _RATE, "Pictures a second."] = 10.0
    latency_ns: Annotated[Ns, TIME, "Time from an exposure to its message, less than the period."] = (
        30_000_000
    )
    exposure_ns: Annotated[
        Ns, PERIOD, "Longest exposure; in less light the picture is amplified, with its noise."
    ] = 8_000_000


@added_sensor("odometry")
@dataclass(frozen=True, kw_only=True)
class Odometry(AddedSensor):
    """Where the vehicle is by its own reckoning: `nav_msgs/Odometry` on `odom`, and on `/tf`.

    Without `drift` and `scale` it is the autopilot's estimate. With one of them it is that of wheels or a
    camera, which needs no satellites.
    """

    rate_hz: Annotated[float, _RATE, "Messages a second."] = 50.0
    drift_deg_s: Annotated[
        float | None,
        Key("drift"),
        QuantityField(units.TURN_RATE),
        "How fast its heading turns away from the true one, anticlockwise.",
    ] = None
    scale: Annotated[
        float | None,
        QuantityField(units.RATIO, above=-1, most=1),
        "How much too long it takes every way to be; too short if negative.",
    ] = None

    @property
    def of_autopilot(self) -> bool:
        """Whether it is the autopilot's estimate."""
        return self.drift_deg_s is None and self.scale is None


class _AnySensor(Syntax):
    """A kind of the catalogue, alone or with its settings, or the name of a sensor of a package."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> Any:
        """See ``Syntax``."""
        packages = sorted(reading.vocabulary.sensors)
        if isinstance(node.value, str):
            kind, settings, where = node.value, TextNode({}, node.where), path
        elif isinstance(node.value, dict) and len(node.items) == 1:
            ((kind, settings),) = node.items.items()
            where = (*path, kind)
        else:
            raise expected("the name of a sensor, or one name with its settings,", node)
        if not reading.known(path, kind, "sensor", [*ADDED_SENSORS, *packages]):
            raise WrongValueError("")
        if kind not in ADDED_SENSORS:
            if settings.value:
                raise WrongValueError(f"{kind} is of a package and takes no settings: write its name alone")
            return kind
        if settings.value is None:
            settings = TextNode({}, settings.where)
        return Record(ADDED_SENSORS[kind]).read(settings, where, reading)

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        kinds = {
            kind: {"anyOf": [Record(cls).schema(definitions), {"type": "null"}]}
            for kind, cls in ADDED_SENSORS.items()
        }
        mapping = {
            "type": "object", "properties": kinds, "minProperties": 1, "maxProperties": 1,
            "additionalProperties": False,
        }  # fmt: skip
        return {"anyOf": [{"type": "string"}, mapping]}


ADDED_SENSOR = _AnySensor()
