"""What a vehicle did, read from a run folder, a tlog, a DataFlash log or a ULog: the same fields of each.

Tracks are metres east, north and up of the place where the vehicle first armed, attitude is in degrees with
the nose up and the right side down positive and the heading clockwise from north. Of a run that is the truth
where the simulation knows it, else, and of every log, the autopilot's estimate. Times are seconds since the
start of the run or log; those of a tlog go by the vehicle's own clock, which a simulator may run at any pace.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.base.errors import UsageError
from volery.base.frames import LocalFrame
from volery.base.time import to_seconds
from volery.control.log_signals import euler_degrees
from volery.links.flight_logs import (
    DATAFLASH,
    TIME,
    TLOG,
    ULOG,
    LoggedText,
    Table,
    Tables,
    log_format,
    read_flight_log,
    vehicles_in,
)
from volery.links.mavlink_messages import entry_name
from volery.trace.events import Operation, Text, VehicleState
from volery.trace.mcap_writer import TRACE_FILE
from volery.trace.reader import OpenTrace
from volery.vehicles.drivers.ardupilot.modes import mode_name as ardupilot_mode
from volery.vehicles.drivers.px4.modes import MODES as PX4_MODES
from volery.vehicles.drivers.px4.modes import mode_name as px4_mode
from volery.vehicles.drivers.steps import DRONE_KIND, ROVER_KIND

Array = NDArray[np.float64]
EAST, NORTH, HEIGHT, ROLL, PITCH, YAW, SPEED, BATTERY = (
    "east", "north", "height", "roll", "pitch", "yaw", "speed", "battery",
)  # fmt: skip
PLACE, ANGLES = (EAST, NORTH, HEIGHT), (ROLL, PITCH, YAW)
DONE = ("ok", "ACCEPTED")
"""Outcomes of what was done as asked."""


class Curve(NamedTuple):
    """Values over time, s. Headings go on beyond a full turn instead of jumping."""

    times: Array
    values: Array


class State(NamedTuple):
    """Whether a vehicle is armed, and in which mode, from a time on until the next state."""

    at: float
    armed: bool
    mode: str


class Stretch(NamedTuple):
    """A part of a flight, s."""

    begin: float
    end: float


class FlightAnswer(NamedTuple):
    """What a vehicle was asked, and what came of it: an operation of a run, an acknowledgement in a log."""

    at: float
    asked: str
    outcome: str
    said: str = ""


@dataclass(frozen=True)
class VehicleFlight:
    """What one vehicle did.

    Attributes:
        vehicle: Its name.
        curves: East, north and height [m], roll, pitch and yaw [deg], speed [m/s], battery [%]; what is not
            known has no times.
        states: Changes of arming and mode.
        flies: False for a rover.
        operations: Operations of a run; none of a log.
        answers: In order.
        texts: Of the autopilot, in order.
    """

    vehicle: str
    curves: Mapping[str, Curve]
    states: tuple[State, ...]
    flies: bool = True
    operations: tuple[Operation, ...] = ()
    answers: tuple[FlightAnswer, ...] = ()
    texts: tuple[LoggedText, ...] = ()

    @cached_property
    def armed(self) -> tuple[Stretch, ...]:
        """Every stretch from arming to disarming, or to the last known position."""
        last = max(
            (float(curve.times[-1]) for curve in self.curves.values() if len(curve.times)), default=0.0
        )
        found: list[Stretch] = []
        for state, end in _lasting(self.states, last):
            if not state.armed:
                continue
            if found and found[-1].end == state.at:
                found[-1] = found[-1]._replace(end=end)
            else:
                found.append(Stretch(state.at, end))
        return tuple(one for one in found if one.end > one.begin)

    @property
    def ends_armed(self) -> bool:
        """Whether the record ends before the vehicle disarms."""
        return bool(self.states) and self.states[-1].armed

    def modes(self, within: Stretch) -> list[tuple[str, Stretch]]:
        """Return each mode in a stretch, in order."""
        found: list[tuple[str, Stretch]] = []
        for state, end in _lasting(self.states, within.end):
            part = Stretch(max(state.at, within.begin), min(end, within.end))
            if part.end <= part.begin:
                continue
            if found and found[-1][0] == state.mode:
                found[-1] = state.mode, found[-1][1]._replace(end=part.end)
            else:
                found.append((state.mode, part))
        return found

    def values(self, name: str, times: Array) -> Array:
        """Return a quantity at some times; NaN if it is not known."""
        curve = self.curves[name]
        return np.interp(times, *curve) if len(curve.times) else np.full(len(times), np.nan)

    def places(self, times: Array) -> Array:
        """Return east, north and up at some times, one row each."""
        return np.column_stack([self.values(name, times) for name in PLACE])


def _lasting(states: Sequence[State], last: float) -> Iterable[tuple[State, float]]:
    """Yield each state and its end."""
    for state, after in pairwise(states):
        yield state, after.at
    if states:
        yield states[-1], max(last, states[-1].at)


def read_flights(path: Path) -> tuple[VehicleFlight, ...]:
    """Return the flights in a run folder or a log, one for each vehicle.

    Args:
        path: Run folder, tlog, DataFlash log or ULog.

    Returns:
        The flights. A run may have none, and its vehicles may never arm; those of a log have armed.

    Raises:
        UsageError: The folder has no trace, the file is no flight log, or no vehicle flies in it.
    """
    if path.is_dir():
        return _flights_of_run(path)
    if path.suffix in {".bag", ".db3", ".mcap"}:
        raise UsageError(
            f"{path} is a recording of ROS topics, which does not state modes and arming alike; compare the "
            "run folder, or the tlog, DataFlash log (.bin) or ULog (.ulg) of the same flight"
        )
    kind = log_format(path)
    texts: list[LoggedText] = []
    tables = read_flight_log(path, _WANTED[kind], _ALSO[kind], texts.append)
    made = [
        _READ[kind](tables, vehicle, [_tidy(said) for said in texts if said.vehicle == vehicle])
        for vehicle in vehicles_in(tables)
    ]
    flown = [_about_arming(one) for one in made if one.armed and len(one.curves[EAST].times)]
    if not flown:
        never = "it has no position" if any(one.armed for one in made) else "no vehicle arms in it"
        raise UsageError(f"{path} ({kind}) has no flight: {never}; give a log from arming to landing")
    return tuple(flown)


def _tidy(said: LoggedText) -> LoggedText:
    """Return a text without the tab with which PX4 ends one that it repeats as an event."""
    return said._replace(text=" ".join(said.text.split()))


def _about_arming(flight: VehicleFlight) -> VehicleFlight:
    """Return the flight with its track about the place where it first arms, else where it begins."""
    times = flight.curves[EAST].times
    if not len(times):
        return flight
    begin = flight.armed[0].begin if flight.armed else float(times[0])
    (here,) = flight.places(np.array([begin]))
    moved = {
        name: Curve(flight.curves[name].times, flight.curves[name].values - offset)
        for name, offset in zip(PLACE, here, strict=True)
    }
    return replace(flight, curves={**flight.curves, **moved})


def _curves(times: Array, columns: Mapping[str, Array]) -> dict[str, Curve]:
    """Return curves of columns with common times, each without what is not known."""
    found = {}
    for name, values in columns.items():
        known = ~np.isnan(values)
        kept = values[known]
        found[name] = Curve(times[known], np.unwrap(kept, period=360.0) if name == YAW else kept)
    return found


def _changes(states: Iterable[State]) -> tuple[State, ...]:
    found: list[State] = []
    for state in states:
        if not found or found[-1][1:] != state[1:]:
            found.append(state)
    return tuple(found)


# -- runs


def _flights_of_run(folder: Path) -> tuple[VehicleFlight, ...]:
    if not (folder / TRACE_FILE).exists():
        raise UsageError(
            f"{folder} has no {TRACE_FILE}: it is no run folder, or its run was recorded without a trace; "
            "run again with `--record trace`"
        )
    states: dict[str, list[VehicleState]] = {}
    operations: dict[str, list[Operation]] = {}
    texts: dict[str, list[LoggedText]] = {}
    with OpenTrace(folder / TRACE_FILE) as reading:
        kinds = {vehicle.name: vehicle.kind for vehicle in reading.setup.vehicles}
        for event in reading.events({VehicleState, Operation, Text}):
            if isinstance(event, VehicleState):
                states.setdefault(event.vehicle, []).append(event)
            elif isinstance(event, Operation):
                operations.setdefault(event.vehicle, []).append(event)
            elif isinstance(event, Text):
                said = LoggedText(to_seconds(event.at), event.severity, event.text)
                texts.setdefault(event.source, []).append(_tidy(said))
    return tuple(
        _about_arming(
            VehicleFlight(
                name,
                _curves_of_run(seen),
                _changes(State(to_seconds(one.at), one.armed, one.mode) for one in seen),
                kinds.get(name) != "rover",
                asked := tuple(sorted(operations.get(name, ()), key=lambda one: one.start)),
                tuple(
                    FlightAnswer(to_seconds(one.start), one.operation, one.outcome, one.said) for one in asked
                ),
                tuple(texts.get(name, ())),
            )
        )
        for name, seen in states.items()
    )


def _curves_of_run(seen: Sequence[VehicleState]) -> dict[str, Curve]:
    times = np.array([to_seconds(one.at) for one in seen])
    east, north, up = np.array([one.where() for one in seen]).T
    attitude = np.array([(one.qw, one.qx, one.qy, one.qz) for one in seen]).T
    roll, pitch, yaw = euler_degrees(*attitude)  # of forward, left, up in east, north, up
    speed = np.sqrt([one.vx * one.vx + one.vy * one.vy + one.vz * one.vz for one in seen])
    battery = np.array([100.0 * one.battery for one in seen])
    columns = (east, north, up, roll, -pitch, 90.0 - yaw, speed, battery)
    return _curves(times, dict(zip((*PLACE, *ANGLES, SPEED, BATTERY), columns, strict=True)))


# -- logs

_WANTED: Mapping[str, set[str]] = {
    TLOG: {"GLOBAL_POSITION_INT", "LOCAL_POSITION_NED", "ATTITUDE"},
    DATAFLASH: {"POS", "GPS", "ATT"},
    ULOG: {"vehicle_local_position", "vehicle_attitude"},
}
_ALSO: Mapping[str, set[str]] = {
    TLOG: {"HEARTBEAT", "SYS_STATUS", "COMMAND_ACK", "MISSION_ACK", "STATUSTEXT"},
    DATAFLASH: {"MODE", "EV", "ARM", "BAT", "MSG", "MAVC"},
    ULOG: {"vehicle_status", "battery_status", "vehicle_command_ack"},
}
_NONE: Table = {TIME: np.array([])}
_UNKNOWN = Curve(np.array([]), np.array([]))
_ARDUPILOT, _ROVERS = 3, (10, 11)
"""MAV_AUTOPILOT; MAV_TYPE of a ground rover and a boat."""
_ARMED_FLAG, _ULOG_ARMED = 128, 2
_EV_ARMED, _EV_DISARMED = 10, 11
_IN_PROGRESS = 5
"""MAV_RESULT of an acknowledgement before the last one."""
_SET_MODE = 11
"""What ArduPilot acknowledges as a command although it is the message SET_MODE."""
_MOST_BACK_S = 1.0
"""Seconds by which a clock goes back where frames overtake each other; by more, the autopilot has booted."""


def _flight(
    vehicle: str,
    curves: Mapping[str, Curve],
    states: Iterable[State],
    answers: Iterable[FlightAnswer],
    texts: Iterable[LoggedText],
    *,
    flies: bool = True,
) -> VehicleFlight:
    return VehicleFlight(
        vehicle.rstrip(".") or "vehicle",
        {name: curves.get(name, _UNKNOWN) for name in (*PLACE, *ANGLES, SPEED, BATTERY)},
        _changes(states),
        flies,
        (),
        tuple(sorted(answers, key=lambda one: one.at)),
        tuple(texts),
    )


def _flight_of_tlog(tables: Tables, vehicle: str, texts: Sequence[LoggedText]) -> VehicleFlight:
    def table(name: str) -> Table:
        rows = tables.get(f"{vehicle}{name}", _NONE)
        return {**rows, TIME: clock(rows[TIME])}

    clock = _own_clock(tables, vehicle)
    beats = table("HEARTBEAT")
    if not len(beats[TIME]):
        return _flight(vehicle, {}, (), (), ())
    autopilot, kind = int(beats["autopilot"][0]), int(beats["type"][0])
    flies = kind not in _ROVERS
    name_mode: Callable[[int], str] = (
        partial(ardupilot_mode, DRONE_KIND if flies else ROVER_KIND) if autopilot == _ARDUPILOT else px4_mode
    )
    states = [
        State(float(at), bool(int(base) & _ARMED_FLAG), name_mode(int(mode)))
        for at, base, mode in zip(beats[TIME], beats["base_mode"], beats["custom_mode"], strict=True)
    ]
    attitude, power = table("ATTITUDE"), table("SYS_STATUS")
    curves = _curves(
        attitude[TIME], {name: np.degrees(attitude[name]) for name in ANGLES if name in attitude}
    )
    if len(power[TIME]):
        left = power["battery_remaining"]
        curves |= _curves(power[TIME], {BATTERY: np.where(left < 0.0, np.nan, left)})
    fixes, local = table("GLOBAL_POSITION_INT"), table("LOCAL_POSITION_NED")
    if len(fixes[TIME]) and np.any(fixes["lat"]):
        curves |= _global_track(fixes[TIME], fixes["lat"] / 1e7, fixes["lon"] / 1e7, fixes["alt"] / 1e3)
        curves |= _curves(fixes[TIME], {SPEED: _length(fixes["vx"], fixes["vy"], fixes["vz"]) / 100.0})
    elif len(local[TIME]):
        curves |= _local_track(local)
    uploads = table("MISSION_ACK")
    answers = _acknowledged(table("COMMAND_ACK"), "command", "result") + [
        FlightAnswer(
            float(at), "mission", entry_name("MAV_MISSION_RESULT", int(kind)).removeprefix("MAV_MISSION_")
        )
        for at, kind in zip(uploads[TIME], uploads.get("type", ()), strict=True)
    ]
    said = [text._replace(time=float(clock(np.array([text.time]))[0])) for text in texts]
    return _flight(vehicle, curves, states, answers, said, flies=flies)


def _own_clock(tables: Tables, vehicle: str) -> Callable[[Array], Array]:
    """Return what turns times of arrival into times of the vehicle's clock, from the first message on."""
    for name in ("ATTITUDE", "GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"):
        rows = tables.get(f"{vehicle}{name}", _NONE)
        arrived = rows[TIME]
        if len(arrived) < 2:
            continue
        own = np.maximum.accumulate(rows["time_boot_ms"] / 1e3)
        if np.max(own - rows["time_boot_ms"] / 1e3) > _MOST_BACK_S:
            break
        ahead = own - arrived  # goes on beyond both ends as it is there
        return lambda times: times + np.interp(times, arrived, ahead) - ahead[0]
    return lambda times: times


def _acknowledged(rows: Table, command: str, result: str) -> list[FlightAnswer]:
    """Return the commands that were answered, each with its last answer."""
    return [
        FlightAnswer(
            float(at),
            "SET_MODE" if asked == _SET_MODE else entry_name("MAV_CMD", int(asked)),
            entry_name("MAV_RESULT", int(outcome)),
        )
        for at, asked, outcome in zip(rows[TIME], rows.get(command, ()), rows.get(result, ()), strict=True)
        if outcome != _IN_PROGRESS
    ]


def _length(*components: Array) -> Array:
    found: Array = np.sqrt(np.sum(np.square(components), axis=0))
    return found


def _global_track(times: Array, latitude: Array, longitude: Array, amsl: Array) -> dict[str, Curve]:
    """Return the track of degrees and metres AMSL about its first place; 0, 0 is no fix."""
    fixed = (latitude != 0.0) | (longitude != 0.0)
    if not fixed.any():
        return {}
    rows = np.column_stack([latitude, longitude, amsl])[fixed]
    frame = LocalFrame(*map(float, rows[0]))
    places = np.array([frame.to_enu(*map(float, row)) for row in rows])
    return _curves(times[fixed], dict(zip(PLACE, places.T, strict=True)))


def _local_track(rows: Table) -> dict[str, Curve]:
    """Return track and speed of metres north, east, down."""
    speed = _length(rows["vx"], rows["vy"], rows["vz"])
    return _curves(rows[TIME], {EAST: rows["y"], NORTH: rows["x"], HEIGHT: -rows["z"], SPEED: speed})


def _flight_of_dataflash(tables: Tables, vehicle: str, texts: Sequence[LoggedText]) -> VehicleFlight:
    attitude, power = tables.get("ATT", _NONE), tables.get("BAT", _NONE)
    columns = {name: attitude[name.capitalize()] for name in ANGLES if name.capitalize() in attitude}
    curves = _curves(attitude[TIME], columns)
    if "RemPct" in power:
        curves |= _curves(power[TIME], {BATTERY: power["RemPct"]})
    fixes = tables.get("GPS", _NONE)
    for rows in (fixes, tables.get("POS", _NONE)):  # the estimate replaces the receiver's
        if "Lat" in rows:
            curves |= _global_track(rows[TIME], rows["Lat"], rows["Lng"], rows["Alt"])
    if "VZ" in fixes:
        curves |= _curves(fixes[TIME], {SPEED: _length(fixes["Spd"], fixes["VZ"])})
    rover = any("Rover" in text.text for text in texts)
    states = _states_of_dataflash(tables, ROVER_KIND if rover else DRONE_KIND)
    answers = _acknowledged(tables.get("MAVC", _NONE), "Cmd", "Res")
    return _flight(vehicle, curves, states, answers, texts, flies=not rover)


def _states_of_dataflash(tables: Tables, kind: str) -> list[State]:
    """Return arming and modes. A log that states no arming is one from arming on."""
    arming, events, modes = (tables.get(name, _NONE) for name in ("ARM", "EV", "MODE"))
    armed: list[tuple[float, bool]] = []
    if "ArmState" in arming:
        armed = [(float(at), bool(on > 0.0)) for at, on in zip(arming[TIME], arming["ArmState"], strict=True)]
    elif "Id" in events:
        of_it = np.isin(events["Id"], (_EV_ARMED, _EV_DISARMED))
        pairs = zip(events[TIME][of_it], events["Id"][of_it], strict=True)
        armed = [(float(at), bool(event == _EV_ARMED)) for at, event in pairs]
    named = [
        (float(at), ardupilot_mode(kind, int(mode)))
        for at, mode in zip(modes[TIME], modes.get("Mode", ()), strict=True)
    ]
    armed = armed or [(min((float(rows[TIME][0]) for rows in tables.values()), default=0.0), True)]
    first_mode = named[0][1] if named else ""

    def at(time: float) -> State:
        on = next((on for begin, on in reversed(armed) if begin <= time), not armed[0][1])
        return State(time, on, next((name for begin, name in reversed(named) if begin <= time), first_mode))

    return [at(time) for time in sorted({time for time, _ in (*armed, *named)})]


def _flight_of_ulog(tables: Tables, vehicle: str, texts: Sequence[LoggedText]) -> VehicleFlight:
    attitude, local = tables.get("vehicle_attitude", _NONE), tables.get("vehicle_local_position", _NONE)
    status, power = tables.get("vehicle_status", _NONE), tables.get("battery_status", _NONE)
    curves = _local_track(local) if "x" in local else {}
    if "q[0]" in attitude:
        angles = euler_degrees(*(attitude[f"q[{index}]"] for index in range(4)))
        curves |= _curves(attitude[TIME], dict(zip(ANGLES, angles, strict=True)))
    if "remaining" in power:
        left = power["remaining"]
        curves |= _curves(power[TIME], {BATTERY: np.where(left < 0.0, np.nan, 100.0 * left)})
    names = {mode.state: name for name, mode in PX4_MODES.items()}
    columns = status[TIME], status.get("arming_state", ()), status.get("nav_state", ())
    states = [
        State(float(at), bool(arming == _ULOG_ARMED), names.get(int(mode), f"MODE {int(mode)}"))
        for at, arming, mode in zip(*columns, strict=True)
    ]
    answers = _acknowledged(tables.get("vehicle_command_ack", _NONE), "command", "result")
    return _flight(vehicle, curves, states, answers, texts)


_READ: Mapping[str, Callable[[Tables, str, Sequence[LoggedText]], VehicleFlight]] = {
    TLOG: _flight_of_tlog,
    DATAFLASH: _flight_of_dataflash,
    ULOG: _flight_of_ulog,
}
