"""Controlled quantities in records: run folders, rosbags, tlogs, DataFlash logs and ULogs.

Each kind of record has a table of which columns are a measurement and which its set-point. ``read_signals``
returns all that a record has; ``chosen_signal`` any two columns that the caller names.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from volery.base.errors import UsageError
from volery.base.installed import require_extra
from volery.base.time import to_seconds
from volery.control.laws import DEGREES
from volery.control.step_response import Array, Signal, make_signal
from volery.links.flight_logs import (
    DATAFLASH,
    STATION,
    TIME,
    TLOG,
    ULOG,
    Table,
    Tables,
    columns_of,
    log_format,
    read_flight_log,
)
from volery.trace.events import ControlSample, VehicleState
from volery.trace.mcap_writer import TRACE_FILE
from volery.trace.reader import Reading

Values = Callable[[Table], Array]
TURN = {"deg": DEGREES, "rad": 2.0 * np.pi}
LISTED = 40
"""Columns that an error lists."""


class Source(NamedTuple):
    """Where a value stands: a table and how its columns give the value."""

    table: str
    value: Values
    needs: tuple[str, ...]


class Quantity(NamedTuple):
    """A controlled quantity of a format: its measurement, and set-points of which the first found counts."""

    name: str
    unit: str
    measured: Source
    goals: tuple[Source, ...] = ()
    angle: bool = False


def _column(table: str, column: str, factor: float = 1.0) -> Source:
    return Source(table, lambda rows: rows[column] * factor, (column,))


def _euler(table: str, axis: int, *columns: str) -> Source:
    """Return roll, pitch or yaw (*axis* 0 to 2) in degrees of a quaternion given as w, x, y, z."""

    def value(rows: Table) -> Array:
        return euler_degrees(*(rows[one] for one in columns))[axis]

    return Source(table, value, columns)


def euler_degrees(w: Array, x: Array, y: Array, z: Array) -> tuple[Array, Array, Array]:
    """Return roll, pitch and yaw of quaternions, degrees; at a pitch of 90 degrees the roll is taken as 0."""
    sine = np.clip(2.0 * (w * y - z * x), -1.0, 1.0)
    pole = np.abs(sine) > 0.999999
    roll = np.where(pole, 0.0, np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)))
    straight = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    yaw = np.where(pole, -np.sign(sine) * 2.0 * np.arctan2(x, w), straight)
    return np.degrees(roll), np.degrees(np.arcsin(sine)), np.degrees(yaw)


def _quaternion(table: str, axis: int, field: str) -> Source:
    return _euler(table, axis, *(f"{field}[{index}]" for index in range(4)))


AXES = ("roll", "pitch", "yaw")

_OF_DATAFLASH = (
    *(
        Quantity(
            name, "deg", _column("ATT", name.capitalize()), (_column("ATT", f"Des{name.capitalize()}"),), True
        )
        for name in AXES
    ),
    *(
        Quantity(f"{name} rate", "deg/s", _column("RATE", letter), (_column("RATE", f"{letter}Des"),))
        for name, letter in zip(AXES, "RPY", strict=True)
    ),
    Quantity("altitude", "m", _column("CTUN", "Alt"), (_column("CTUN", "DAlt"),)),
    *(
        Quantity(name, "m", _column(f"PSC{letter}", f"P{letter}"), (_column(f"PSC{letter}", f"TP{letter}"),))
        for name, letter in (("north", "N"), ("east", "E"))
    ),
)
_OF_ULOG = (
    *(
        Quantity(
            name,
            "deg",
            _quaternion("vehicle_attitude", axis, "q"),
            (_quaternion("vehicle_attitude_setpoint", axis, "q_d"),),
            True,
        )
        for axis, name in enumerate(AXES)
    ),
    *(
        Quantity(
            f"{name} rate",
            "deg/s",
            _column("vehicle_angular_velocity", f"xyz[{axis}]", np.degrees(1.0)),
            (_column("vehicle_rates_setpoint", name, np.degrees(1.0)),),
        )
        for axis, name in enumerate(AXES)
    ),
    *(
        Quantity(
            name,
            "m",
            _column("vehicle_local_position", axis, sign),
            (_column("vehicle_local_position_setpoint", axis, sign),),
        )
        for name, axis, sign in (("north", "x", 1.0), ("east", "y", 1.0), ("altitude", "z", -1.0))
    ),
)
_OF_TLOG = (
    *(
        Quantity(
            name,
            "deg",
            _column("ATTITUDE", name, np.degrees(1.0)),
            (_quaternion("ATTITUDE_TARGET", axis, "q"), _column("NAV_CONTROLLER_OUTPUT", nav)),
            True,
        )
        for axis, (name, nav) in enumerate(zip(AXES, ("nav_roll", "nav_pitch", "nav_bearing"), strict=True))
    ),
    *(
        Quantity(
            name,
            "m",
            _column("LOCAL_POSITION_NED", axis, sign),
            (
                _column("POSITION_TARGET_LOCAL_NED", axis, sign),
                _column(f"{STATION}SET_POSITION_TARGET_LOCAL_NED", axis, sign),
            ),
        )
        for name, axis, sign in (("north", "x", 1.0), ("east", "y", 1.0), ("altitude", "z", -1.0))
    ),
)
QUANTITIES: Mapping[str, tuple[Quantity, ...]] = {DATAFLASH: _OF_DATAFLASH, ULOG: _OF_ULOG, TLOG: _OF_TLOG}


def read_signals(path: Path) -> list[Signal]:
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
    wanted = {source.table for one in quantities for source in (one.measured, *one.goals)}
    tables = read_flight_log(path, wanted)
    found = [signal for one in quantities if (signal := _signal(tables, one)) is not None]
    if not found:
        have = ", ".join(sorted({one.measured.table for one in quantities}))
        raise UsageError(f"{path} ({kind}) has neither attitude nor position: none of {have}")
    return found


def chosen_signal(path: Path, measured: str, goal: str | None = None, unit: str = "") -> Signal:
    """Return the signal of two columns of a record.

    Args:
        path: the record.
        measured: ``TABLE.column``, such as ``ATT.Yaw`` or ``/mavros/imu/data.orientation.z``.
        goal: set-point, in the same form.
        unit: unit of both; ``deg`` and ``rad`` are angles.

    Raises:
        UsageError: the record has no such column.
    """
    tables = _bag_tables(path) if _is_bag(path) else read_flight_log(path)
    aim = _records_of(tables, goal, path) if goal is not None else None
    return make_signal(measured, unit, _records_of(tables, measured, path), aim, period=TURN.get(unit))


def _records_of(tables: Tables, name: str, path: Path) -> tuple[Array, Array]:
    for table, columns in tables.items():
        column = name.removeprefix(f"{table}.")
        if column != name and column in columns:
            return columns[TIME], columns[column]
    known = list(columns_of(tables))
    more = f" and {len(known) - LISTED} more" if len(known) > LISTED else ""
    raise UsageError(f"{path} has no column {name!r}; it has {', '.join(known[:LISTED])}{more}")


def _signal(tables: Tables, one: Quantity) -> Signal | None:
    measured = _values(tables, one.measured)
    if measured is None:
        return None
    goals = (_values(tables, source) for source in one.goals)
    goal = next((found for found in goals if found is not None), None)
    return make_signal(one.name, one.unit, measured, goal, period=DEGREES if one.angle else None)


def _values(tables: Tables, source: Source) -> tuple[Array, Array] | None:
    table = tables.get(source.table)
    if table is None or any(name not in table for name in source.needs):
        return None
    return table[TIME], source.value(table)


# -- runs


def _is_run(path: Path) -> bool:
    return (path / TRACE_FILE).is_file() if path.is_dir() else path.name == TRACE_FILE


def _signals_of_run(path: Path) -> list[Signal]:
    """Return the loops that were recorded; without any, heading and position of each vehicle."""
    loops: dict[tuple[str, str, str, str, float], list[tuple[float, float, float]]] = {}
    states: dict[str, list[tuple[float, ...]]] = {}
    with Reading(path / TRACE_FILE if path.is_dir() else path) as reading:
        for event in reading.events({ControlSample, VehicleState}):
            if isinstance(event, ControlSample):
                key = event.vehicle, event.loop, event.unit, event.controller, event.period
                loops.setdefault(key, []).append((to_seconds(event.at), event.measurement, event.goal))
            elif isinstance(event, VehicleState):
                attitude = event.qw, event.qx, event.qy, event.qz
                states.setdefault(event.vehicle, []).append((to_seconds(event.at), *event.where(), *attitude))
    several = len({vehicle for vehicle, *_ in loops} | set(states)) > 1
    found = []
    for (vehicle, loop, unit, controller, period), rows in loops.items():
        times, measured, goal = np.array(rows).T
        name = f"{vehicle} {loop}" if several else loop
        turn = period if period > 0.0 else None
        found.append(
            make_signal(name, unit, (times, measured), (times, goal), period=turn, controller=controller)
        )
    if found:
        return found
    for vehicle, state in states.items():
        times, east, north, up, w, x, y, z = np.array(state).T
        heading = 90.0 - euler_degrees(w, x, y, z)[2]
        prefix = f"{vehicle} " if several else ""
        found.append(make_signal(f"{prefix}yaw", "deg", (times, heading), period=DEGREES))
        for name, values in (("north", north), ("east", east), ("altitude", up)):
            found.append(make_signal(f"{prefix}{name}", "m", (times, values)))
    if not found:
        raise UsageError(f"{path} records neither a control loop nor a vehicle")
    return found


# -- rosbags


def _is_bag(path: Path) -> bool:
    return path.suffix in {".bag", ".mcap", ".db3"} or (path.is_dir() and not _is_run(path))


def _bag_tables(path: Path) -> Tables:
    """Return the numbers of the messages of a rosbag by topic; arrays are left out."""
    require_extra("ros", "rosbags")
    from volery.ros.messages.bags import open_bag

    bag = open_bag(path)
    rows: dict[str, list[dict[str, float]]] = {}
    for at, topic, message in bag.messages(bag.usual):
        numbers = {TIME: to_seconds(at - bag.start)}
        _numbers_of(message, "", numbers)
        rows.setdefault(topic, []).append(numbers)
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


def _signals_of_bag(path: Path, tables: Tables) -> list[Signal]:
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
            found.append(make_signal(f"{topic} {name}", unit, (rows[TIME], value), goal, period=period))
    if not found:
        raise UsageError(
            f"{path} has no topic with a pose or an attitude; name columns by --measured and --goal: "
            f"{', '.join(list(columns_of(tables))[:LISTED])}"
        )
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
