"""The catalogue of faults: which there are, what they do to what, and with which arguments. Data only.

One class per kind declares its arguments with their units, ranges, defaults and descriptions. From it follow
the model's parser, its JSON Schema and the generated page of faults. The effect of each kind on a simulated
run is in ``volery.run.assembly.fault_effects``; fault trials (``volery.testing.fault_trials``) use the
same classes.

A new kind of fault: a class here with ``@fault``, its effect there.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Annotated, Any, TypeVar

from volery.base import units
from volery.base.errors import Location
from volery.base.time import Ns
from volery.model import rules
from volery.model.added_sensors import ADDED_SENSORS, AddedSensor, CameraSpec, RangingSensor
from volery.model.airframes import FRAMES
from volery.model.fields import (
    ACCELERATION,
    HEADING,
    NETWORK,
    PROCESSOR,
    SHARE,
    SPEED,
    TEXT,
    TIME,
    TURN_RATE,
    VEHICLE,
    Angle,
    Duration,
    NameField,
    Record,
    Schema,
    Syntax,
    Whole,
    WrongValueError,
    expected,
    shown,
)
from volery.model.reading import ModelReading
from volery.model.text import Path, TextNode

ONLY_TRIALS = "Only in fault trials: a model cannot state it."


@dataclass(frozen=True, kw_only=True)
class Fault:
    """Something that breaks at a stated time, for good or for a while.

    ``kind`` is the name of the kind. ``subject`` is the name of the thing that breaks.
    """

    kind = ""

    name: str = ""
    at_ns: Annotated[Ns, TIME, "When it happens, from the start of the run."]
    duration_ns: Annotated[Ns | None, TIME, "How long it lasts; for good if it is not given."] = None
    where: Location | None = field(default=None, compare=False)

    @property
    def subject(self) -> str:
        """The name of the vehicle, processor or network that breaks."""
        return ""


@dataclass(frozen=True, kw_only=True)
class VehicleFault(Fault):
    """A fault of one vehicle."""

    vehicle: Annotated[str, VEHICLE, "The vehicle that it happens to."]

    @property
    def subject(self) -> str:
        """The name of the vehicle."""
        return self.vehicle


@dataclass(frozen=True, kw_only=True)
class ProcessorFault(Fault):
    """A fault of one computer."""

    processor: Annotated[str, PROCESSOR, "The computer that it happens to."]

    @property
    def subject(self) -> str:
        """The name of the processor."""
        return self.processor


@dataclass(frozen=True, kw_only=True)
class NetworkFault(Fault):
    """A fault of one network."""

    network: Annotated[str, NETWORK, "The network that it happens to."]

    @property
    def subject(self) -> str:
        """The name of the network."""
        return self.network


FAULTS: dict[str, type[Fault]] = {}
"""The kinds that a model can state, by name."""

TRIAL_FAULTS: dict[str, type[Fault]] = {}
"""The kinds that only fault trials know, by name."""

C = TypeVar("C", bound=type[Fault])


def fault(kind: str, *, trials_only: bool = False) -> Callable[[C], C]:
    """Register a class of the catalogue under the name of its *kind*."""

    def register(cls: C) -> C:
        cls.kind = kind
        (TRIAL_FAULTS if trials_only else FAULTS)[kind] = cls
        return cls

    return register


# -- the airframe


def _multirotors(reading: ModelReading) -> list[str]:
    vehicles = reading.root.at(("environment", "vehicles"))
    return [
        name
        for name, node in (vehicles.items if vehicles else {}).items()
        if (kind := node.child("kind")) is not None and kind.value == "multirotor"
    ]


USUAL_MOTORS = 4
"""Motors of a multirotor without an airframe of the model's own."""

MULTIROTOR = NameField("multirotor", _multirotors)


class _Motor(Whole):
    """Number of a motor of the vehicle that the fault names."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> int:
        """See ``Syntax``."""
        motor: int = super().read(node, path, reading)
        fault = reading.root.at(path[:-1])
        vehicle = fault.child("vehicle") if fault else None
        where = ("environment", "vehicles", str(vehicle.value if vehicle else ""), "airframe", "frame")
        frame = reading.root.at(where)
        motors = FRAMES.get(str(frame.value), USUAL_MOTORS) if frame else USUAL_MOTORS
        if motor > motors:
            reading.problems.add(path, f"the vehicle has {motors} motors, no motor {motor}", node.where)
        return motor


@fault("motor-dead")
@dataclass(frozen=True, kw_only=True)
class MotorDead(VehicleFault):
    """A motor of a multirotor gives no thrust, or only a share of it."""

    vehicle: Annotated[str, MULTIROTOR, "The vehicle that it happens to."]
    motor: Annotated[int, _Motor(least=1), "Number of the motor, up to that of its frame."] = 1
    thrust: Annotated[float, SHARE, "Share of its thrust that is left."] = 0.0


@fault("battery-low")
@dataclass(frozen=True, kw_only=True)
class BatteryLow(VehicleFault):
    """The battery is drained to a share of its capacity at once. What was drained does not come back."""

    charge: Annotated[float, SHARE, "Share of the capacity that is left."] = 0.08


@fault("battery-cell-dead")
@dataclass(frozen=True, kw_only=True)
class BatteryCellDead(VehicleFault):
    """Cells of the battery are short-circuited: its voltage drops by theirs."""

    cells: Annotated[int, Whole(least=1, most=12), "Number of dead cells; at least one cell stays alive."] = 1


# -- sensors


@fault("gps-lost")
@dataclass(frozen=True, kw_only=True)
class GpsLost(VehicleFault):
    """The satellite receiver sees no satellites."""


@fault("gps-drift")
@dataclass(frozen=True, kw_only=True)
class GpsDrift(VehicleFault):
    """The position that the satellite receiver reports drifts away from the true one.

    The reported velocity contains the drift. When the fault is over, the report jumps back to the truth.
    """

    speed_m_s: Annotated[float, SPEED, "Speed of the drift."] = 1.0
    direction_deg: Annotated[float, HEADING, "Where it drifts to, clockwise from north."] = 0.0


@fault("barometer-stuck")
@dataclass(frozen=True, kw_only=True)
class BarometerStuck(VehicleFault):
    """The barometer repeats its last value."""


@fault("compass-stuck")
@dataclass(frozen=True, kw_only=True)
class CompassStuck(VehicleFault):
    """The compass repeats its last value."""


class _EighthTurns(Angle):
    """An angle by which a sensor can be mounted wrongly about the vertical: eighths of a turn."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> float:
        """See ``Syntax``."""
        angle = super().read(node, path, reading)
        if angle % 45.0 or not angle:
            raise WrongValueError(f"{shown(node)}: give a multiple of 45 deg, such as 90 deg")
        return angle

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return super().schema(definitions) | {"x-quantity": "degrees, a multiple of 45"}


@fault("compass-turned")
@dataclass(frozen=True, kw_only=True)
class CompassTurned(VehicleFault):
    """The compass is turned on its mount, or its orientation is stated wrongly."""

    turn_deg: Annotated[
        float,
        _EighthTurns(360.0, turn=True),
        "Angle of the turn, clockwise from above: a multiple of 45 deg.",
    ] = 90.0


@fault("imu-biased")
@dataclass(frozen=True, kw_only=True)
class ImuBiased(VehicleFault):
    """Gyroscope and accelerometer are off by constant values, the same on each of their three axes."""

    gyro_deg_s: Annotated[float, TURN_RATE, "Error of the gyroscope."] = 3.0
    accel_m_s2: Annotated[float, ACCELERATION, "Error of the accelerometer."] = 0.5


@fault("imu-noisy")
@dataclass(frozen=True, kw_only=True)
class ImuNoisy(VehicleFault):
    """Gyroscope and accelerometer have more white noise, as on a mount that passes vibration on."""

    gyro_deg_s: Annotated[float, TURN_RATE, "Standard deviation that is added to the gyroscope's."] = 10.0
    accel_m_s2: Annotated[float, ACCELERATION, "Standard deviation that is added to the accelerometer's."] = (
        5.0
    )


@fault("rc-lost")
@dataclass(frozen=True, kw_only=True)
class RcLost(VehicleFault):
    """The receiver of the pilot's transmitter hears nothing."""


# -- sensors that a model adds


def _names(sensors: TextNode | None, kinds: Collection[str] | None) -> list[str]:
    """Return the names of the sensors in a vehicle's ``added_sensors``, of some kinds only."""
    found = []
    for one in sensors.value if sensors is not None and isinstance(sensors.value, list) else ():
        kind, settings = one.value, None
        if isinstance(one.value, dict) and len(one.items) == 1:
            ((kind, settings),) = one.items.items()
        name = settings.child("name") if settings is not None and isinstance(settings.value, dict) else None
        if kinds is None or kind in kinds:
            found.append(str(name.value if name is not None else kind))
    return found


@dataclass(frozen=True)
class _AddedSensor(Syntax):
    """The name of an added sensor of the vehicle that the fault names. ``kinds``: of these kinds only."""

    noun: str
    kinds: tuple[str, ...] | None = None

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> str:
        """See ``Syntax``."""
        name: str = TEXT.read(node, path, reading)
        fault = reading.root.at(path[:-1])
        vehicle = fault.child("vehicle") if fault else None
        if vehicle is not None:
            where = ("environment", "vehicles", str(vehicle.value), "added_sensors")
            reading.known(path, name, self.noun, _names(reading.root.at(where), self.kinds))
        return name

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return {"type": "string", "x-quantity": f"the name of a vehicle's {self.noun}"}


SENSOR = _AddedSensor("added sensor")
CAMERA = _AddedSensor("camera", (CameraSpec.kind,))
RANGING = _AddedSensor(
    "sensor of distances",
    tuple(kind for kind, cls in ADDED_SENSORS.items() if issubclass(cls, RangingSensor)),
)


@dataclass(frozen=True, kw_only=True)
class AddedSensorFault(VehicleFault):
    """A fault of a sensor that the model adds to a vehicle."""

    sensor: Annotated[str, SENSOR, "The sensor: its `name`, or its kind if it has none."]


@dataclass(frozen=True, kw_only=True)
class RangingFault(AddedSensorFault):
    """A fault of an added sensor that measures distances."""

    sensor: Annotated[str, RANGING, "The sensor: its `name`, or its kind if it has none."]


def can_happen_to(kind: type[AddedSensorFault], sensor: AddedSensor | str) -> bool:
    """Return whether a kind of fault can happen to an added sensor; text names one of another package."""
    if issubclass(kind, RangingFault):
        return isinstance(sensor, RangingSensor)
    return isinstance(sensor, CameraSpec) or not issubclass(kind, CameraBlack)


@fault("sensor-silent")
@dataclass(frozen=True, kw_only=True)
class SensorSilent(AddedSensorFault):
    """An added sensor gives no samples."""


@fault("sensor-stuck")
@dataclass(frozen=True, kw_only=True)
class SensorStuck(AddedSensorFault):
    """An added sensor repeats its last sample, with new stamps."""


@fault("sensor-clock-off")
@dataclass(frozen=True, kw_only=True)
class SensorClockOff(AddedSensorFault):
    """The stamps of an added sensor jump, and stay off by this time."""

    by_ns: Annotated[
        Ns, Duration(units.TIME), "What is added to its stamps; back in time if negative."
    ] = -5_000_000_000


@fault("camera-black")
@dataclass(frozen=True, kw_only=True)
class CameraBlack(AddedSensorFault):
    """No light reaches an added camera: its pictures are black but for the noise of reading."""

    sensor: Annotated[str, CAMERA, "The camera: its `name`, or `camera` if it has none."]


@fault("ranges-maximum")
@dataclass(frozen=True, kw_only=True)
class RangesMaximum(RangingFault):
    """Every beam of an added sensor reads the longest distance that it measures."""


@fault("ranges-not-a-number")
@dataclass(frozen=True, kw_only=True)
class RangesNotANumber(RangingFault):
    """Every beam of an added sensor reads NaN."""


# -- the link between an autopilot and what commands it


@fault("link-cut")
@dataclass(frozen=True, kw_only=True)
class LinkCut(VehicleFault):
    """Nothing passes on the link to the autopilot, in either direction."""


@fault("link-degraded")
@dataclass(frozen=True, kw_only=True)
class LinkDegraded(VehicleFault):
    """The link to the autopilot loses, delays, doubles or damages what it carries, in both directions."""

    loss: Annotated[float, SHARE, "Share of the frames that are lost."] = 0.0
    delay_ns: Annotated[Ns, TIME, "Delay of frames: evenly drawn between nothing and this time."] = 0
    duplicate: Annotated[float, SHARE, "Share of the frames that arrive twice."] = 0.0
    reorder: Annotated[float, SHARE, "Share of the frames that are overtaken by those of the next 60 ms."] = (
        0.0
    )
    corrupt: Annotated[float, SHARE, "Share of the bytes that have one bit flipped."] = 0.0
    truncate: Annotated[float, SHARE, "Share of the frames that end too early."] = 0.0


# -- computers and what joins them


@fault("network-cut")
@dataclass(frozen=True, kw_only=True)
class NetworkCut(NetworkFault):
    """The network loses whatever is sent over it."""


@fault("network-degraded")
@dataclass(frozen=True, kw_only=True)
class NetworkDegraded(NetworkFault):
    """The network loses more than usual, or delays what it carries."""

    loss: Annotated[float, SHARE, "Share of the transmissions that are lost, if it is more than usual."] = 0.0
    delay_ns: Annotated[Ns, TIME, "Delay that is added to the usual latency."] = 0


@fault("computer-stopped")
@dataclass(frozen=True, kw_only=True)
class ComputerStopped(ProcessorFault):
    """The computer executes nothing. Afterwards it goes on where it stopped."""


@fault("computer-slowed")
@dataclass(frozen=True, kw_only=True)
class ComputerSlowed(ProcessorFault):
    """Something else takes a share of each core of the computer before all components."""

    load: Annotated[float, SHARE, "Share of each core that is taken."] = 0.5


# -- the air


@fault("wind")
@dataclass(frozen=True, kw_only=True)
class WindChange(Fault):
    """The wind changes over all of the world."""

    speed_m_s: Annotated[float, SPEED, "Mean speed."] = 12.0
    direction_deg: Annotated[float, HEADING, "Where it blows from, clockwise from north."] = 270.0
    gusts_m_s: Annotated[float, SPEED, "Standard deviation of the gusts."] = 1.5

    @property
    def subject(self) -> str:
        """The air has no name of its own."""
        return "wind"


# -- only in trials


@fault("other-station", trials_only=True)
@dataclass(frozen=True, kw_only=True)
class OtherStation(VehicleFault):
    """Another station lands the vehicle; on the ground it disarms it.

    Where all programs share one node, the pilot does so by remote control.
    """


@fault("program-killed", trials_only=True)
@dataclass(frozen=True, kw_only=True)
class ProgramKilled(VehicleFault):
    """The program that commands the vehicle is killed: it stops without closing its link."""


class _AnyFault(Syntax):
    """One of the kinds of faults that a model can state."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> Any:
        """See ``Syntax``."""
        if not isinstance(node.value, dict):
            raise expected("a mapping of keys", node)
        kind = node.items.get("kind")
        if kind is None or not isinstance(kind.value, str):
            what = "this key is missing" if kind is None else str(expected("text", kind))
            rule = rules.MISSING_KEY if kind is None else rules.WRONG_VALUE
            reading.problems.add((*path, "kind"), what, (kind or node).where, rule)
            raise WrongValueError("")
        if kind.value not in FAULTS:
            reading.problems.unknown((*path, "kind"), kind.value, "kind of fault", FAULTS)
            raise WrongValueError("")
        return Record(FAULTS[kind.value], kind=kind.value).read(node, path, reading)

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return {"anyOf": [Record(cls, kind=kind).schema(definitions) for kind, cls in FAULTS.items()]}


FAULT = _AnyFault()
