"""Controlled quantities in records: run folders, rosbags, tlogs, DataFlash logs and ULogs.

Each kind of record has a table of which columns are a measurement and which its set-point, and of what
states that the vehicle is armed and in the air. ``read_signals`` returns all that a record has;
``chosen_signal`` any two columns that the caller names.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.base.errors import UsageError
from volery.base.installed import require_extra
from volery.base.time import to_seconds
from volery.control.laws import DEGREES
from volery.control.step_response import Array, ControlledSignal, GroundedStretch, make_signal
from volery.links.flight_logs import (
    DATAFLASH,
    STATION,
    TIME,
    TLOG,
    ULOG,
    VEHICLE,
    Table,
    Tables,
    columns_of,
    log_format,
    read_flight_log,
    vehicles_in,
)
from volery.links.mavlink_messages import constant
from volery.trace.events import ControlSample, VehicleState
from volery.trace.mcap_writer import TRACE_FILE
from volery.trace.reader import OpenTrace

Values = Callable[[Table], Array]
TURN = {"deg": DEGREES, "rad": 2.0 * np.pi}
LISTED = 40
"""Columns that an error lists."""


class SignalSource(NamedTuple):
    """Where a value stands: a table and how its columns give the value."""

    table: str
    value: Values
    needs: tuple[str, ...]


class LoggedQuantity(NamedTuple):
    """A controlled quantity of a format: its measurement, and set-points of which the first found counts."""

    name: str
    unit: str
    measured: SignalSource
    goals: tuple[SignalSource, ...] = ()
    angle: bool = False


def _column(table: str, column: str, factor: float = 1.0) -> SignalSource:
    return SignalSource(table, lambda rows: rows[column] * factor, (column,))


def _euler(table: str, axis: int, *columns: str) -> SignalSource:
    """Return roll, pitch or yaw (*axis* 0 to 2) in degrees of a quaternion given as w, x, y, z."""

    def value(rows: Table) -> Array:
        return euler_degrees(*(rows[column] for column in columns))[axis]

    return SignalSource(table, value, columns)


def euler_degrees(w: Array, x: Array, y: Array, z: Array) -> tuple[Array, Array, Array]:
    """Return roll, pitch and yaw of quaternions, degrees; at a pitch of 90 degrees the roll is taken as 0."""
    sine = np.clip(2.0 * (w * y - z * x), -1.0, 1.0)
    pole = np.abs(sine) > 0.999999
    roll = np.where(pole, 0.0, np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)))
    straight = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    yaw = np.where(pole, -np.sign(sine) * 2.0 * np.arctan2(x, w), straight)
    return np.degrees(roll), np.degrees(np.arcsin(sine)), np.degrees(yaw)


def _quaternion(table: str, axis: int, field: str) -> SignalSource:
    return _euler(table, axis, *(f"{field}[{index}]" for index in range(4)))


AXES = ("roll", "pitch", "yaw")
ALTITUDE = "altitude"

_OF_DATAFLASH = (
    *(
        LoggedQuantity(
            name, "deg", _column("ATT", name.capitalize()), (_column("ATT", f"Des{name.capitalize()}"),), True
        )
        for name in AXES
    ),
    *(
        LoggedQuantity(f"{name} rate", "deg/s", _column("RATE", letter), (_column("RATE", f"{letter}Des"),))
        for name, letter in zip(AXES, "RPY", strict=True)
    ),
    LoggedQuantity(ALTITUDE, "m", _column("CTUN", "Alt"), (_column("CTUN", "DAlt"),)),
    *(
        LoggedQuantity(
            name, "m", _column(f"PSC{letter}", f"P{letter}"), (_column(f"PSC{letter}", f"TP{letter}"),)
        )
        for name, letter in (("north", "N"), ("east", "E"))
    ),
)
_OF_ULOG = (
    *(
        LoggedQuantity(
            name,
            "deg",
            _quaternion("vehicle_attitude", axis, "q"),
            (_quaternion("vehicle_attitude_setpoint", axis, "q_d"),),
            True,
        )
        for axis, name in enumerate(AXES)
    ),
    *(
        LoggedQuantity(
            f"{name} rate",
            "deg/s",
            _column("vehicle_angular_velocity", f"xyz[{axis}]", np.degrees(1.0)),
            (_column("vehicle_rates_setpoint", name, np.degrees(1.0)),),
        )
        for axis, name in enumerate(AXES)
    ),
    *(
        LoggedQuantity(
            name,
            "m",
            _column("vehicle_local_position", axis, sign),
            (_column("vehicle_local_position_setpoint", axis, sign),),
        )
        for name, axis, sign in (("north", "x", 1.0), ("east", "y", 1.0), (ALTITUDE, "z", -1.0))
    ),
)
_OF_TLOG = (
    *(
        LoggedQuantity(
            name,
            "deg",
            _column("ATTITUDE", name, np.degrees(1.0)),
            (_quaternion("ATTITUDE_TARGET", axis, "q"), _column("NAV_CONTROLLER_OUTPUT", nav)),
            True,
        )
        for axis, (name, nav) in enumerate(zip(AXES, ("nav_roll", "nav_pitch", "nav_bearing"), strict=True))
    ),
    *(
        LoggedQuantity(
            name,
            "m",
            _column("LOCAL_POSITION_NED", axis, sign),
            (
                _column("POSITION_TARGET_LOCAL_NED", axis, sign),
                _column(f"{STATION}SET_POSITION_TARGET_LOCAL_NED", axis, sign),
            ),
        )
        for name, axis, sign in (("north", "x", 1.0), ("east", "y", 1.0), (ALTITUDE, "z", -1.0))
    ),
)
QUANTITIES: Mapping[str, tuple[LoggedQuantity, ...]] = {
    DATAFLASH: _OF_DATAFLASH,
    ULOG: _OF_ULOG,
    TLOG: _OF_TLOG,
}


def read_signals(path: Path) -> list[ControlledSignal]:
    """Return the controlled quantities that a record has.

    Args:
        path: a run folder or its trace, a rosbag, a tlog, a DataFlash log or a ULog.

    Raises:
        UsageError: there is no such record, it cannot be read, or it has no known quantity.
    """
    if _is_run(path):
        return _signals_of_run(path)
    if _is_bag(path):
        return _signals_of_bag(path, _bag_tables(path))
    kind = log_format(path)
    quantities = QUANTITIES[kind]
    wanted = {source.table for quantity in quantities for source in (quantity.measured, *quantity.goals)}
    tables = read_flight_log(path, wanted, STATES[kind])
    found = []
    for vehicle in vehicles_in(tables):
        idle = _IDLE[kind](tables, vehicle)
        for one in quantities:
            signal = _signal(tables, one, vehicle)
            if signal is not None:
                sent = _sent(tables, one, vehicle) if kind == TLOG else ()
                idle_here = _with_take_off(idle) if one.name == ALTITUDE else idle
                found.append(replace(signal, engaged=False, idle=idle_here, sent=sent))
    if not found:
        have = ", ".join(sorted({quantity.measured.table for quantity in quantities}))
        raise UsageError(f"{path} ({kind}) has neither attitude nor position: none of {have}")
    return found


# -- armed and in the air


DISARMED, LANDED = "disarmed", "on the ground"
STATES: Mapping[str, set[str]] = {
    TLOG: {
        "HEARTBEAT",
        "EXTENDED_SYS_STATE",
        *(
            f"{STATION}{one}"
            for one in (
                "COMMAND_LONG",
                "COMMAND_INT",
                "SET_ATTITUDE_TARGET",
                "SET_POSITION_TARGET_LOCAL_NED",
                "SET_POSITION_TARGET_GLOBAL_INT",
            )
        ),
    },
    ULOG: {"vehicle_status", "vehicle_land_detected"},
    DATAFLASH: {"EV"},
}
"""Messages, by format, that state whether a vehicle is armed and in the air, and what it was commanded."""
_ARMED_FLAG, _ON_GROUND, _ULOG_ARMED = 128, 1, 2
_EV_ARMED, _EV_DISARMED, _EV_LANDED, _EV_NOT_LANDED = 10, 11, 18, 28
TAKE_OFF_S = 3.0
"""Time before a take-off, s, in which an altitude may be commanded on the ground."""


def _held(times: Array, idle: NDArray[np.bool_], why: str) -> list[GroundedStretch]:
    """Return the stretches in which a state that holds until its next record is *idle*."""
    ends = np.append(times[1:], np.inf)
    found: list[GroundedStretch] = []
    for start, end, off in zip(times, ends, idle, strict=True):
        if off and found and found[-1].end == start:
            found[-1] = found[-1]._replace(end=float(end))
        elif off:
            found.append(GroundedStretch(float(start), float(end), why))
    return found


def _idle_of_tlog(tables: Tables, vehicle: str) -> list[GroundedStretch]:
    found: list[GroundedStretch] = []
    beats, state = tables.get(f"{vehicle}HEARTBEAT"), tables.get(f"{vehicle}EXTENDED_SYS_STATE")
    if beats is not None and len(beats[TIME]) > 1:  # one heartbeat states nothing of a flight
        armed = beats["base_mode"].astype(int) & _ARMED_FLAG
        found += _held(_from_the_start(beats[TIME]), armed == 0, DISARMED)
    if state is not None:
        found += _held(state[TIME], state["landed_state"] == _ON_GROUND, LANDED)
    return found


def _from_the_start(times: Array) -> Array:
    """Return times of which the first record stands for the time before it, too."""
    return np.concatenate(([-np.inf], times[1:]))


def _idle_of_ulog(tables: Tables, vehicle: str) -> list[GroundedStretch]:
    found: list[GroundedStretch] = []
    status, land = tables.get("vehicle_status"), tables.get("vehicle_land_detected")
    if status is not None and "arming_state" in status:
        found += _held(_from_the_start(status[TIME]), status["arming_state"] != _ULOG_ARMED, DISARMED)
    if land is not None and "landed" in land:
        found += _held(_from_the_start(land[TIME]), land["landed"] > 0, LANDED)
    return found


def _idle_of_dataflash(tables: Tables, vehicle: str) -> list[GroundedStretch]:
    """Return the stretches of a log that has events; before the first event the opposite held."""
    found: list[GroundedStretch] = []
    events = tables.get("EV")
    if events is None or "Id" not in events:
        return found
    for begins, ends, why in ((_EV_DISARMED, _EV_ARMED, DISARMED), (_EV_LANDED, _EV_NOT_LANDED, LANDED)):
        of_it = np.isin(events["Id"], (begins, ends))
        times, idle = events[TIME][of_it], events["Id"][of_it] == begins
        if len(times):
            found += _held(np.append(-np.inf, times), np.append(~idle[:1], idle), why)
    return found


_IDLE: Mapping[str, Callable[[Tables, str], list[GroundedStretch]]] = {
    TLOG: _idle_of_tlog,
    ULOG: _idle_of_ulog,
    DATAFLASH: _idle_of_dataflash,
}


def _with_take_off(idle: Sequence[GroundedStretch]) -> list[GroundedStretch]:
    """Return the stretches without the moments before a take-off, in which its altitude is commanded."""
    return [
        one if one.why != LANDED else one._replace(end=max(one.start, one.end - TAKE_OFF_S)) for one in idle
    ]


_TURN, _TAKE_OFF, _REPOSITION = (
    constant(f"MAV_CMD_{name}") for name in ("CONDITION_YAW", "NAV_TAKEOFF", "DO_REPOSITION")
)


def _sent(tables: Tables, quantity: LoggedQuantity, vehicle: str) -> list[float]:
    """Return the times at which a ground station commanded a quantity: one that is repeated counts once."""
    system = int(vehicle[len(VEHICLE) : -1] or 0)
    wanted = (_TURN,) if quantity.name == "yaw" else (_TAKE_OFF, _REPOSITION)
    times: list[float] = []
    for name in sorted(one for one in STATES[TLOG] if one.startswith(STATION)):
        rows = tables.get(name)
        if rows is None:
            continue
        to_it = np.isin(rows["target_system"], (0, system)) if system else np.ones(len(rows[TIME]), bool)
        if "command" in rows:
            fresh = np.isin(rows["command"], wanted)
        else:
            values = [rows[row] for row in rows if row not in (TIME, "time_boot_ms")]
            fresh = np.append(True, np.any(np.diff(np.array(values), axis=1) != 0.0, axis=0))
        times += rows[TIME][to_it & fresh].tolist()
    return sorted(times)


def chosen_signal(path: Path, measured: str, goal: str | None = None, unit: str = "") -> ControlledSignal:
    """Return the signal of two columns of a record.

    Args:
        path: the record.
        measured: ``TABLE.column``, such as ``ATT.Yaw`` or ``/mavros/imu/data.orientation.z``.
        goal: set-point, in the same form.
        unit: unit of both; ``deg`` and ``rad`` are angles.

    Raises:
        UsageError: the record has no such column.
    """
    if _is_bag(path):
        tables = _bag_tables(path)
        idle = _idle_of_bag(tables, measured)
    else:
        tables = read_flight_log(path)
        idle = _IDLE[log_format(path)](tables, "")
    aim = _records_of(tables, goal, path) if goal is not None else None
    signal = make_signal(measured, unit, _records_of(tables, measured, path), aim, period=TURN.get(unit))
    return replace(signal, engaged=False, idle=idle)


def _records_of(tables: Tables, name: str, path: Path) -> tuple[Array, Array]:
    wanted = name.replace("[0].", ".")  # the first of several has no number
    for table, columns in tables.items():
        column = wanted.removeprefix(f"{table}.")
        if column != wanted and column in columns:
            return columns[TIME], columns[column]
    known = list(columns_of(tables))
    more = f" and {len(known) - LISTED} more" if len(known) > LISTED else ""
    raise UsageError(f"{path} has no column {name!r}; it has {', '.join(known[:LISTED])}{more}")


def _signal(tables: Tables, one: LoggedQuantity, vehicle: str) -> ControlledSignal | None:
    measured = _values(tables, one.measured, vehicle)
    if measured is None:
        return None
    goals = (_values(tables, source, vehicle) for source in one.goals)
    goal = next((goal for goal in goals if goal is not None), None)
    name = f"{vehicle.rstrip('.')} {one.name}".lstrip()
    return make_signal(name, one.unit, measured, goal, period=DEGREES if one.angle else None)


def _values(tables: Tables, source: SignalSource, vehicle: str) -> tuple[Array, Array] | None:
    table = tables.get(f"{vehicle}{source.table}" if not source.table.startswith(STATION) else source.table)
    if table is None or any(name not in table for name in source.needs):
        return None
    return table[TIME], source.value(table)


# -- runs


def _is_run(path: Path) -> bool:
    return (path / TRACE_FILE).is_file() if path.is_dir() else path.name == TRACE_FILE


def _signals_of_run(path: Path) -> list[ControlledSignal]:
    """Return the loops that were recorded; without any, heading and position of each vehicle."""
    loops: dict[tuple[str, str, str, str, float], list[tuple[float, float, float]]] = {}
    states: dict[str, list[tuple[float, ...]]] = {}
    armed: dict[str, list[tuple[float, float]]] = {}
    with OpenTrace(path / TRACE_FILE if path.is_dir() else path) as reading:
        for event in reading.events({ControlSample, VehicleState}):
            if isinstance(event, ControlSample):
                key = event.vehicle, event.loop, event.unit, event.controller, event.period
                loops.setdefault(key, []).append((to_seconds(event.at), event.measurement, event.goal))
            elif isinstance(event, VehicleState):
                armed.setdefault(event.vehicle, []).append((to_seconds(event.at), float(event.armed)))
                attitude = event.qw, event.qx, event.qy, event.qz
                states.setdefault(event.vehicle, []).append((to_seconds(event.at), *event.where(), *attitude))
    several = len({vehicle for vehicle, *_ in loops} | set(states)) > 1
    idle = {one: _held(*_unarmed(np.array(rows)), DISARMED) for one, rows in armed.items()}
    found = []
    for (vehicle, loop, unit, controller, period), rows in loops.items():
        times, measured, goal = np.array(rows).T
        name = f"{vehicle} {loop}" if several else loop
        turn = period if period > 0.0 else None
        signal = make_signal(name, unit, (times, measured), (times, goal), period=turn, controller=controller)
        found.append(replace(signal, idle=idle.get(vehicle, ())))
    if found:
        return found
    for vehicle, state in states.items():
        times, east, north, up, w, x, y, z = np.array(state).T
        heading = 90.0 - euler_degrees(w, x, y, z)[2]
        prefix = f"{vehicle} " if several else ""
        whole = [make_signal(f"{prefix}yaw", "deg", (times, heading), period=DEGREES)]
        for name, values in (("north", north), ("east", east), (ALTITUDE, up)):
            whole.append(make_signal(f"{prefix}{name}", "m", (times, values)))
        found += [replace(one, idle=idle[vehicle]) for one in whole]
    if not found:
        raise UsageError(f"{path} records neither a control loop nor a vehicle")
    return found


def _unarmed(rows: Array) -> tuple[Array, NDArray[np.bool_]]:
    return _from_the_start(rows[:, 0]), rows[:, 1] == 0.0


# -- rosbags


def _is_bag(path: Path) -> bool:
    return path.suffix in {".bag", ".mcap", ".db3"} or (path.is_dir() and not _is_run(path))


def _bag_tables(path: Path) -> Tables:
    """Return the numbers of the messages of a rosbag by topic; arrays are left out."""
    require_extra("ros", "rosbags")
    from volery.ros.messages.bags import open_bag

    bag = open_bag(path)
    rows: dict[str, list[dict[str, float]]] = {}
    several = [name for name, count in Counter(topic.name for topic in bag.topics).items() if count > 1]
    for at, topic, message in bag.messages(bag.usual):
        numbers = {TIME: to_seconds(at - bag.start)}
        _numbers_of(message, "", numbers)
        name = f"{topic}[{message.__msgtype__}]" if topic in several else topic
        rows.setdefault(name, []).append(numbers)
    return {
        topic: {column: np.array([row[column] for row in found]) for column in found[0]}
        for topic, found in rows.items()
        if len(found[0]) > 1
    }


def _numbers_of(message: Any, prefix: str, numbers: dict[str, float]) -> None:
    for name in message.__match_args__:
        value = getattr(message, name)
        if isinstance(value, bool | int | float | np.number):
            numbers[f"{prefix}{name}"] = float(value)
        elif hasattr(value, "__match_args__") and name != "header":
            _numbers_of(value, f"{prefix}{name}.", numbers)


SET_POINT_WORDS = ("setpoint", "goal", "target", "cmd")
_POSES = ("pose.pose.", "pose.", "transform.", "")


def _signals_of_bag(path: Path, tables: Tables) -> list[ControlledSignal]:
    """Return yaw and position of each topic with a pose; a topic named as a set-point is the others' goal."""
    goals = {topic: rows for topic, rows in tables.items() if any(word in topic for word in SET_POINT_WORDS)}
    found = []
    for topic, rows in tables.items():
        if topic in goals:
            continue
        for name, unit, value in _pose_of(rows):
            aims = [
                (aim[TIME], one) for aim in goals.values() for also, _, one in _pose_of(aim) if also == name
            ]
            period = DEGREES if unit == "deg" else None
            goal = aims[0] if aims else None
            signal = make_signal(f"{topic} {name}", unit, (rows[TIME], value), goal, period=period)
            found.append(replace(signal, engaged=False, idle=_idle_of_bag(tables, topic)))
    if not found:
        raise UsageError(
            f"{path} has no topic with a pose or an attitude; name columns by --measured and --goal: "
            f"{', '.join(list(columns_of(tables))[:LISTED])}"
        )
    return found


def _idle_of_bag(tables: Tables, topic: str) -> list[GroundedStretch]:
    """Return the stretches of the vehicle whose namespace a topic is in, by MAVROS's names of its state."""
    found: list[GroundedStretch] = []
    for column, ending in (("armed", "/state"), ("landed_state", "/extended_state")):
        states = [table for table in tables if table.endswith(ending) and column in tables[table]]
        mine = [
            state
            for state in states
            if topic.startswith(state.removesuffix("state").removesuffix("extended_"))
        ]
        for one in mine[:1] or (states if len(states) == 1 else []):
            rows = tables[one]
            if column == "armed":
                found += _held(_from_the_start(rows[TIME]), rows[column] == 0.0, DISARMED)
            else:
                found += _held(rows[TIME], rows[column] == _ON_GROUND, LANDED)
    return found


def _pose_of(rows: Table) -> list[tuple[str, str, Array]]:
    """Return name, unit and values of yaw and position in a table of poses, Euler angles or quaternions."""
    found: list[tuple[str, str, Array]] = []
    for prefix in _POSES:
        quaternion = [f"{prefix}orientation.{part}" for part in "wxyz"]
        if all(part in rows for part in quaternion) and not found:
            found.append(("yaw", "deg", euler_degrees(*(rows[part] for part in quaternion))[2]))
        for axis in "xyz":
            column = f"{prefix}position.{axis}"
            if column in rows and all(name != axis for name, *_ in found):
                found.append((axis, "m", rows[column]))
    if not found and "yaw" in rows:
        found.append(("yaw", "deg", np.degrees(rows["yaw"])))
    return found
