"""Synthetic events of a delivery, for tests of what reads traces.

Nothing is simulated: vehicles move along straight lines and components compute periodically. Every kind of
event occurs and every figure is plausible. The same arguments give the same events.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from itertools import pairwise
from math import hypot, nan
from typing import NamedTuple

from volery.base.seeds import stream
from volery.base.time import MS, US, Ns, S, from_seconds
from volery.requirements.record import DELIVERY_KIND
from volery.trace.attachments import (
    Area,
    ChainSetup,
    ComponentSetup,
    LawSetup,
    Origin,
    Place,
    ProcessorSetup,
    RequirementSetup,
    RunSetup,
    Scenery,
    VehicleSetup,
)
from volery.trace.events import (
    NONE,
    Activation,
    BatteryService,
    Call,
    Charge,
    Collision,
    ControlSample,
    Event,
    Failure,
    LinkState,
    Message,
    Milestone,
    Omitted,
    Operation,
    Preemption,
    Published,
    Slice,
    Text,
    Transmission,
    Unserved,
    VehicleState,
    Verdict,
)

_PERIOD = 100 * MS
_DEADLINE = 100 * MS


class _Leg(NamedTuple):
    """A leg of a vehicle: to (x, y, z), m, at `speed` m/s, then a rest of `rest` s."""

    x: float
    y: float
    z: float
    speed: float
    rest: float = 0.0


_STORE, _PORT_NORTH, _PORT_SOUTH = (-420.0, -180.0), (-300.0, -60.0), (310.0, 120.0)
_HOSPITALS = {"san_rafael": (420.0, 200.0), "la_paz": (260.0, -40.0), "santa_clara": (-60.0, 240.0)}

_FLIGHT = (
    _Leg(*_PORT_NORTH, 30.0, 2.5),
    _Leg(0.0, 130.0, 30.0, 12.0),
    _Leg(*_PORT_SOUTH, 30.0, 12.0, 1.0),
    _Leg(*_PORT_SOUTH, 0.0, 1.0, 12.0),
    _Leg(*_PORT_SOUTH, 30.0, 2.5),
    _Leg(0.0, 130.0, 30.0, 12.0),
    _Leg(*_PORT_NORTH, 30.0, 12.0, 1.0),
    _Leg(*_PORT_NORTH, 0.0, 1.0, 20.0),
)
_ROUTES: dict[str, tuple[tuple[float, float, float], tuple[_Leg, ...]]] = {
    "drone_1": ((*_PORT_NORTH, 0.0), _FLIGHT),
    "drone_2": ((_PORT_NORTH[0] + 6.0, _PORT_NORTH[1] + 4.0, 0.0), ()),
    "rover_north": (
        (*_STORE, 0.0),
        (_Leg(-300.0, -180.0, 0.0, 3.0), _Leg(*_PORT_NORTH, 0.0, 3.0, 15.0), _Leg(*_STORE, 0.0, 3.0)),
    ),
    "rover_south": (
        (*_PORT_SOUTH, 0.0),
        (_Leg(420.0, 120.0, 0.0, 3.0), _Leg(420.0, 200.0, 0.0, 3.0, 30.0), _Leg(*_PORT_SOUTH, 0.0, 3.0)),
    ),
}
_STARTS = {"drone_1": 75.0, "drone_2": 0.0, "rover_north": 5.0, "rover_south": 190.0}

_REQUIREMENTS = (
    RequirementSetup("landing", "drone_1.landing_offset", "max", 0.3, "m"),
    RequirementSetup("control", "drone_control.deadline_misses", "max", 0.0),
    RequirementSetup("delivered", "application.delivered", "min", 1.0),
)
_LAWS = (
    LawSetup("ROS calls of roscpp", "the paper's Table II", "measured", "600 to 1500 MHz"),
    LawSetup(
        "ROS calls of rospy",
        "the paper's Table II",
        "estimated",
        "measured for C++ nodes",
        "drone_control is a Python node charged with figures of roscpp",
    ),
)


def sample_setup(seed: int = 7, onboard_mhz: float = 1500.0) -> RunSetup:
    """Return the set-up of the synthetic run."""
    return RunSetup(
        system="hospital-delivery",
        fidelity="code",
        allocation="fast" if onboard_mhz >= 1500.0 else "slow",
        scenario="sample",
        seed=seed,
        components=(
            ComponentSetup("central", "DeliveryCentral", "python", "ground"),
            ComponentSetup("planner", "RouteGenerator", "python", "ground"),
            _looping("rover_control", "RoverControl", "ground", 5),
            _looping("drone_control", "DroneControl", "onboard", 10),
            _looping("landing", "PrecisionLanding", "onboard", 20),
            ComponentSetup("requesters", "Requester", "python"),
        ),
        processors=(
            ProcessorSetup("ground", "intel-i5-3470", 3000.0, "round-robin", 4, 25.0, 77.0),
            ProcessorSetup("onboard", "rpi4-cortex-a72", onboard_mhz, "fixed-priority", 4, 2.7, 6.4),
        ),
        vehicles=tuple(
            VehicleSetup(name, "ardupilot", "rover" if name.startswith("rover") else "multirotor")
            for name in _ROUTES
        ),
        chains=(ChainSetup("state_to_control", ("/drone_1/state",)),),
        requirements=_REQUIREMENTS,
        laws=_LAWS,
        not_counted=("operating system and ROS master",),
        warnings=("wind: none was stated",),
    )


def _looping(name: str, kind: str, processor: str, priority: int) -> ComponentSetup:
    return ComponentSetup(name, kind, "rospy", processor, True, _PERIOD, _DEADLINE, priority)


def sample_scenery() -> Scenery:
    """Return the map of the synthetic run."""
    ports = (Place("port_north", *_PORT_NORTH, "port"), Place("port_south", *_PORT_SOUTH, "port"))
    hospitals = tuple(Place(name, *where, "hospital") for name, where in _HOSPITALS.items())
    return Scenery(
        origin=Origin(43.4623, -3.81, 12.0),
        places=(Place("store", *_STORE, "store"), *ports, *hospitals),
        roads=(
            ((-420.0, -180.0), (-300.0, -180.0), (-300.0, -60.0), (-300.0, 240.0), (-60.0, 240.0)),
            (
                (-300.0, -180.0),
                (260.0, -180.0),
                (260.0, -40.0),
                (310.0, 120.0),
                (420.0, 120.0),
                (420.0, 200.0),
            ),
            ((-60.0, 240.0), (420.0, 240.0), (420.0, 200.0)),
        ),
        corridors=((_PORT_NORTH, (0.0, 130.0), _PORT_SOUTH),),
        areas=(
            Area("cathedral", ((-60.0, -60.0), (80.0, -80.0), (110.0, 40.0), (-20.0, 70.0))),
            Area("harbour", ((-480.0, 300.0), (480.0, 300.0), (480.0, 360.0), (-480.0, 360.0)), "water"),
        ),
    )


def sample_events(seed: int = 7, seconds: float = 300.0, onboard_mhz: float = 1500.0) -> Iterator[Event]:
    """Yield the events of the synthetic run in the order of recording."""
    random = stream(seed, "sample run")
    journeys = {name: _journey(name) for name in _ROUTES}
    stories = sorted(_story(journeys["drone_1"]), key=_told_at)
    ending = from_seconds(seconds)
    for tick in range(int(ending // _PERIOD)):
        now = tick * _PERIOD
        while stories and _told_at(stories[0]) < now + _PERIOD:
            yield stories.pop(0)
        for name, journey in journeys.items():
            yield _state(name, journey, now, random.gauss(0.0, 0.2))
        yield from _loop("rover_control", "ground", now, 3 * MS + round(random.random() * MS))
        slowness = 1500.0 / onboard_mhz
        yield from _loop(
            "drone_control", "onboard", now, round((38.0 + 4.0 * random.random()) * slowness * MS)
        )
        yield from _loop(
            "landing", "onboard", now, round((6.0 + 2.0 * random.random()) * slowness * MS), core=1
        )
        if tick % 10 == 0:
            yield from _talk(now)
    yield from _verdicts(ending, onboard_mhz)


def _told_at(event: Event) -> Ns:
    return event.end if isinstance(event, Call | Operation) else event[0]


def _journey(name: str) -> list[tuple[Ns, float, float, float]]:
    """Return times and positions of a vehicle at the corners of its path."""
    (x, y, z), legs = _ROUTES[name]
    at = _STARTS[name]
    corners = [(0, x, y, z), (from_seconds(at), x, y, z)]
    for leg in legs:
        at += hypot(leg.x - x, leg.y - y, leg.z - z) / leg.speed
        x, y, z = leg.x, leg.y, leg.z
        corners.append((from_seconds(at), x, y, z))
        at += leg.rest
        corners.append((from_seconds(at), x, y, z))
    return corners


def _state(name: str, journey: list[tuple[Ns, float, float, float]], now: Ns, off: float) -> VehicleState:
    x, y, z = journey[-1][1:]
    vx = vy = vz = 0.0
    for (t0, x0, y0, z0), (t1, x1, y1, z1) in pairwise(journey):
        if t0 <= now < t1:
            share = (now - t0) / (t1 - t0)
            x, y, z = x0 + share * (x1 - x0), y0 + share * (y1 - y0), z0 + share * (z1 - z0)
            per_second = S / (t1 - t0)
            vx, vy, vz = (x1 - x0) * per_second, (y1 - y0) * per_second, (z1 - z0) * per_second
            break
    under_way = len(journey) > 2 and journey[1][0] <= now < journey[-1][0]
    known = now > 2 * S
    amperes = (18.0 if z > 0.0 else 3.0) if under_way else 0.4
    return VehicleState(
        at=now,
        vehicle=name,
        x=x,
        y=y,
        z=z,
        qw=1.0,
        qx=0.0,
        qy=0.0,
        qz=0.0,
        vx=vx,
        vy=vy,
        vz=vz,
        estimated_x=x + off if known else nan,
        estimated_y=y - off if known else nan,
        estimated_z=z + 0.5 * off if known else nan,
        battery=max(0.1, 1.0 - now / S * 0.001 * (1.0 if under_way else 0.05)),
        volts=12.4 - now / S * 0.001,
        amperes=amperes,
        armed=under_way,
        mode="GUIDED" if under_way else "HOLD" if name.startswith("rover") else "STABILIZE",
    )


def _loop(component: str, processor: str, now: Ns, work: Ns, core: int = 0) -> Iterator[Event]:
    """Yield one activation of a 10 Hz loop: its code, two ROS calls, and the slice that executes them."""
    calls = 350 * US
    yield Charge(now, component, processor, "code", work, 0, 0.0)
    yield Charge(now, component, processor, "ros:publish", calls, 40 * US, 0.0)
    yield Charge(now, component, processor, "ros:sleep", 90 * US, 0, 0.0)
    finished = now + work + calls + 90 * US
    yield Slice(now, min(finished, now + _PERIOD), processor, core, component, component)
    yield Activation(now, finished, component, now + _DEADLINE)


def _cdr_string(text: str) -> bytes:
    raw = text.encode() + b"\0"
    return b"\0\1\0\0" + struct.pack("<I", len(raw)) + raw


def _talk(now: Ns) -> Iterator[Event]:
    data = _cdr_string("GUIDED")
    yield Published(now, "/drone_1/state", "std_msgs/msg/String", "drone_1", data)
    yield Transmission(now, now + 3 * MS, MS, "radio", len(data))
    yield Message(now, now + 3 * MS, "/drone_1/state", "drone_1", "drone_control", len(data))
    lost = now % (30 * S) == 0
    yield Message(now, NONE if lost else now + 22 * MS, "/drone_1/state", "drone_1", "central", len(data))


_PARCEL_STEPS = (
    (0.0, "ordered", "central", "2 units of blood for san_rafael"),
    (4.0, "planned", "central", "rover_north, drone_1, rover_south"),
    (5.0, "on rover_north", "rover_control", ""),
    (60.0, "at port_north", "rover_control", ""),
    (75.0, "on drone_1", "drone_control", ""),
    (188.0, "at port_south", "drone_control", ""),
    (190.0, "on rover_south", "rover_control", ""),
    (255.0, "delivered", "rover_control", "san_rafael"),
)


def _story(journey: list[tuple[Ns, float, float, float]]) -> Iterator[Event]:
    """Yield the events that occur once: orders, parcels, vehicle operations, texts."""
    for number, delay in enumerate((1.0, 12.0, 40.0), start=1):
        at = from_seconds(delay)
        yield Call(at, at + 30 * MS, "requesters", "central", "order", "ok")
        yield Call(at + 5 * MS, at + 25 * MS, "central", "planner", "get_path", "ok")
        yield Charge(at + 5 * MS, "planner", "ground", "operation:get_path", 18 * MS, 0, 0.004)
        yield Slice(at + 5 * MS, at + 23 * MS, "ground", 1, "central", "planner")
        yield Charge(at, "central", "ground", "operation:order", 2 * MS, 0, 0.003)
        yield Slice(at + 23 * MS, at + 25 * MS, "ground", 1, "central", "central")
        yield Preemption(at + 25 * MS, "ground", 1, "central", "planner")
        for after, state, component, detail in _PARCEL_STEPS if number == 1 else _PARCEL_STEPS[: 4 - number]:
            yield Milestone(
                at + from_seconds(after), component, DELIVERY_KIND, f"parcel_{number}", state, detail
            )
    names = ["takeoff", "goto", "goto", "land", "takeoff", "goto", "goto", "land"]
    for (start, *_), (end, x, y, z), name in zip(journey[1::2], journey[2::2], names, strict=False):
        where = f"{x:g} m east, {y:g} m north, {z:g} m up"
        yield Operation(start, end, "drone_1", name, where, "ok", "", 0.21, 0.08, 0.84, 0.31)
    yield Operation(
        20 * S,
        21 * S,
        "drone_2",
        "takeoff",
        "30 m above home",
        "Refused",
        "Arm: Battery below minimum",
        *[nan] * 4,
    )
    yield Text(2 * S, "drone_1", 6, "EKF3 IMU0 is using GPS")
    yield Unserved(22 * S, "service", "/mavros/land", "", "/ground", 0, 2 * S, "did you mean /drone_1/land?")
    yield Omitted(22 * S, "/drone_1/camera", "sensor_msgs/msg/Image", "/camera", 230_456)
    yield Text(21 * S, "drone_2", 4, "Arm: Battery below minimum")
    yield LinkState(500 * MS, "drone_1", "up", "")
    figures = 0.3, 0.2, 0.1, 0.1, 0.0, 0.0, 0.1
    yield ControlSample(600 * MS, "drone_1", "altitude", "P", "m", 0.0, *figures)
    yield BatteryService(23 * S, "drone_1", "depot", "swap", 0, 0.4)
    yield Collision(21 * S, "drone_2", "depot", 3.4, 20.0, 10.0, 5.0)
    yield Failure(21 * S, "drone_2", "takeoff refused: Arm: Battery below minimum")


def _verdicts(now: Ns, onboard_mhz: float) -> Iterator[Event]:
    misses = 0.0 if onboard_mhz >= 1500.0 else 1374.0
    yield Verdict(now, "landing", "drone_1.landing_offset", "max", 0.3, 0.12, True)
    yield Verdict(now, "control", "drone_control.deadline_misses", "max", 0.0, misses, misses == 0.0)
    yield Verdict(now, "delivered", "application.delivered", "min", 1.0, 1.0, True)
