"""Flight logs as tables of numbers and texts: tlogs, ArduPilot's DataFlash logs and PX4's ULogs.

A table holds the numeric fields of one type of message, each as an array, and ``time`` in seconds since the
start of the log (DataFlash: since the boot of the autopilot). Formats are recognised by their first bytes and
not by their names. The libraries of the autopilots' projects decode DataFlash (pymavlink) and ULog (pyulog).
"""

from __future__ import annotations

import os
import struct
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pymavlink import DFReader

from volery.base.errors import UsageError
from volery.base.installed import require_extra
from volery.links.frame import Frame
from volery.links.mavlink_messages import StatusTextAssembler, constant
from volery.links.tlog import LINK_BITS, LoggedFrame, has_links, read_tlog

Table = Mapping[str, NDArray[np.float64]]
Tables = dict[str, Table]


class LoggedText(NamedTuple):
    """What an autopilot said: seconds as in a table, syslog's severity, prefix of the vehicle's tables."""

    time: float
    severity: int
    text: str
    vehicle: str = ""


OnText = Callable[[LoggedText], None]

TIME = "time"
STATION = "station."
"""Prefix of the messages that a ground station sent."""
VEHICLE = "vehicle"
"""Beginning of the prefix of the messages of a further vehicle; its system id follows."""
DATAFLASH, ULOG, TLOG = "DataFlash", "ULog", "tlog"
ULOG_MAGIC = b"ULog\x01\x12\x35"
DATAFLASH_HEAD = b"\xa3\x95"
_FORMAT, _FORMAT_SIZE, _HEAD_SIZE = 0x80, 89, 3
"""Type and length of the message that defines others in a DataFlash log; length of a message's head."""
_ULOG_START, _ULOG_HEAD = 16, struct.Struct("<HB")
"""Length of a ULog's header; length of a message's content and its type."""
_ULOG_DATA, _ULOG_DEFINITIONS = b"ACL", b"BFIMPQ"
"""Types of the messages that end the definitions of a ULog, and of those that make them up."""
_ULOG_LONGEST = 10_000
"""Length above which pyulog takes a message of unknown type for damage and reads on one byte later."""
_NO_AUTOPILOT = constant("MAV_AUTOPILOT_INVALID")
_AUTOPILOT1 = constant("MAV_COMP_ID_AUTOPILOT1")


def log_format(path: Path) -> str:
    """Return the format of a log.

    Raises:
        UsageError: the file cannot be read, is empty or is no flight log.
    """
    try:
        with path.open("rb") as file:
            head = file.read(4096)
    except OSError as error:
        raise UsageError(f"cannot read {path}: {error.strerror or error}") from error
    if not head:
        raise UsageError(f"{path} is empty: it has 0 bytes")
    if head.startswith(ULOG_MAGIC):
        return ULOG
    if head.startswith((DATAFLASH_HEAD, b"FMT, ")):
        return DATAFLASH
    if any(head[at] in (0xFD, 0xFE) for at in range(8, min(len(head), 2048))):
        return TLOG
    raise UsageError(
        f"{path} is no flight log: it begins as none of a tlog, a DataFlash log (.bin) or a ULog (.ulg)"
    )


def read_flight_log(
    path: Path, wanted: Collection[str] = (), also: Collection[str] = (), on_text: OnText | None = None
) -> Tables:
    """Return the tables of a log.

    A log that is cut or damaged is read as far as that is possible.

    Args:
        path: a tlog, a DataFlash log (binary or text) or a ULog.
        wanted: names of the messages to read; all if empty. Reading few is faster.
        also: names of messages to read besides, of which the log need not have any.
        on_text: called with each text of the autopilot, of a tlog if STATUSTEXT is read, of a DataFlash log
            if MSG is. ULogs always have their texts.

    Raises:
        UsageError: the file cannot be read, or holds no message that is wanted.
    """
    kind = log_format(path)
    read = {DATAFLASH: _dataflash, ULOG: _ulog, TLOG: _tlog}[kind]
    tables = read(path, {*wanted, *also} if wanted else set(), on_text or _drop)
    if not tables or (wanted and not any(_plain_name(name) in wanted for name in tables)):
        names = f" among {', '.join(sorted(wanted))}" if wanted else ""
        raise UsageError(f"{path} ({kind}) holds no message{names}; was it cut before its first one?")
    return tables


def _drop(text: LoggedText) -> None:
    """Do nothing."""


def vehicles_in(tables: Tables) -> list[str]:
    """Return the prefix of each vehicle's tables: ``""`` for the first, in a tlog ``vehicle2.`` ..."""
    further = {name.partition(".")[0] + "." for name in tables if name.startswith(VEHICLE) and "." in name}
    return ["", *sorted(further)]


def _plain_name(name: str) -> str:
    """Return the name of a table without the vehicle and the instance that it is about."""
    return name.rpartition(".")[2].partition("[")[0] if not name.startswith(STATION) else name


class _Rows:
    """Rows of the numeric fields of messages, collected message by message."""

    def __init__(self, start: float = 0.0) -> None:
        self._start = start
        self._rows: dict[str, tuple[tuple[str, ...], list[tuple[float, ...]]]] = {}

    def add(self, name: str, time: float, fields: Mapping[str, Any]) -> None:
        """Add the numbers of one message; elements of an array are ``field[0]``, ``field[1]`` ..."""
        numbers: dict[str, float] = {TIME: time}
        for key, value in fields.items():
            if isinstance(value, int | float):
                numbers[key] = float(value)
            elif isinstance(value, list | tuple) and len(value) <= _LONGEST_ARRAY:
                for index, one in enumerate(value):
                    if isinstance(one, int | float):
                        numbers[f"{key}[{index}]"] = float(one)
        columns, rows = self._rows.setdefault(name, (tuple(numbers), []))
        if columns == tuple(numbers):
            rows.append(tuple(numbers.values()))

    def tables(self) -> Tables:
        """Return what was collected."""
        made: Tables = {}
        for name, (columns, rows) in self._rows.items():
            values = np.array(rows, dtype=float)
            values[:, 0] -= self._start
            made[name] = {column: values[:, index] for index, column in enumerate(columns)}
        return made


_LONGEST_ARRAY = 8


class _Senders:
    """Names of the senders of a telemetry log; the first autopilot has none.

    None is mixed with another: ``component154.`` is of the same system (a gimbal), ``vehicle2.`` another
    system with an autopilot, ``station.`` a system without one. Before that stands ``link1.`` for a link of
    MAVProxy on which fewer messages of the first autopilot came.
    """

    def __init__(self, entries: Sequence[LoggedFrame]) -> None:
        self._autopilots: dict[int, int] = {}  # component of each system's, in the order of the log
        for _, frame, _ in entries:
            if frame.name == "HEARTBEAT" and frame.fields["autopilot"] != _NO_AUTOPILOT:
                if frame.component == _AUTOPILOT1:
                    self._autopilots[frame.system] = _AUTOPILOT1
                else:  # a gimbal may state an autopilot, too
                    self._autopilots.setdefault(frame.system, frame.component)
        self._first = next(iter(self._autopilots), 0)
        links: Counter[int] = Counter()
        if has_links(entries):
            links.update(at_us & LINK_BITS for at_us, frame, _ in entries if frame.system == self._first)
        self._main = max(links, key=lambda link: links[link]) if links else None

    def prefix(self, at_us: int, frame: Frame) -> str:
        """Return the sender's name with a full stop behind it."""
        if frame.system not in self._autopilots:
            return STATION
        link = at_us & LINK_BITS
        prefix = "" if self._main in (None, link) else f"link{link}."
        if frame.system != self._first:
            prefix += f"{VEHICLE}{frame.system}."
        if frame.component != self._autopilots[frame.system]:
            prefix += f"component{frame.component}."
        return prefix


def _tlog(path: Path, wanted: set[str], on_text: OnText) -> Tables:
    """Read a telemetry log; its tables are named after sender and message."""
    entries = list(read_tlog(path))
    senders = _Senders(entries)
    start = entries[0].at_us / 1e6 if entries else 0.0
    rows = _Rows(start)
    texts: dict[str, _Texts] = {}
    for at_us, frame, _ in entries:
        name = frame.name
        if wanted and name not in wanted and f"{STATION}{name}" not in wanted:
            continue
        prefix = senders.prefix(at_us, frame)
        other = prefix == f"{VEHICLE}{frame.system}."  # its autopilot's, wanted like the first one's
        if not wanted or f"{prefix}{name}" in wanted or (other and name in wanted):
            rows.add(f"{prefix}{name}", at_us / 1e6, frame.fields)
            if name == "STATUSTEXT":
                texts.setdefault(prefix, _Texts(prefix, on_text)).add(at_us / 1e6 - start, frame.fields)
    return rows.tables()


class _Texts:
    """Joins the status texts of one sender of a telemetry log."""

    def __init__(self, vehicle: str, on_text: OnText) -> None:
        self._vehicle, self._on_text, self._time = vehicle, on_text, 0.0
        self._assembler = StatusTextAssembler(self._report)

    def add(self, time: float, fields: Mapping[str, Any]) -> None:
        """Add a STATUSTEXT that came *time* seconds after the start of the log."""
        self._time = time
        self._assembler.add(fields)

    def _report(self, severity: int, text: str) -> None:
        self._on_text(LoggedText(self._time, severity, text, self._vehicle))


_DAMAGE = (
    struct.error,
    ArithmeticError,
    AttributeError,
    EOFError,
    LookupError,
    MemoryError,
    TypeError,
    ValueError,
)
"""Errors that pymavlink and pyulog let through where the bytes of a log are wrong."""


def _check_formats(path: Path) -> None:
    """Refuse a binary log that defines a message shorter than its head: pymavlink would read it for ever."""
    with path.open("rb") as file, mmap(file.fileno(), 0, access=ACCESS_READ) as data:
        lengths, at, size = {_FORMAT: _FORMAT_SIZE}, 0, len(data)
        while 0 <= at <= size - 5:
            if data[at : at + 2] != DATAFLASH_HEAD:
                at = data.find(DATAFLASH_HEAD, at + 1)
                continue
            kind = data[at + 2]
            if kind == _FORMAT:
                lengths[data[at + 3]] = data[at + 4]
                if data[at + 4] < _HEAD_SIZE:
                    what = f"it defines a message of {data[at + 4]} bytes"
                    raise UsageError(f"{path} is a damaged DataFlash log: at byte {at} {what}")
            at += lengths.get(kind, 1)


_UNREADABLE = object()


class _Resilient:
    """What pymavlink's readers of DataFlash need to read on after any damage."""

    offset: int
    _reading = False

    def _parse_next(self) -> Any:
        """Read one message. At one that it cannot read pymavlink calls this method again, at any depth.

        Raises:
            ValueError: The message is as short as none can be: the reader would return it for ever.
        """
        if self._reading:
            return _UNREADABLE
        begin, self._reading = self.offset, True
        try:
            while (message := super()._parse_next()) is _UNREADABLE:  # type: ignore[misc]  # of a reader
                pass
        finally:
            self._reading = False
        if message is not None and self.offset <= begin:
            raise ValueError(f"a message of {message.fmt.len} bytes at byte {begin}")
        return message


class _BinaryReader(_Resilient, DFReader.DFReader_binary):  # type: ignore[misc]  # pymavlink states no types
    """pymavlink's reader of binary logs, which takes definitions of messages anywhere in a damaged log."""

    def init_arrays_fast(self, progress_callback: Any = None) -> None:
        """Index the log. The index is made in C, which prints a line for each damaged byte."""
        with _without_stderr():
            super().init_arrays_fast(progress_callback)


@contextmanager
def _without_stderr() -> Iterator[None]:
    """Drop what is written to the descriptor of standard error, also by C."""
    try:
        kept = os.dup(2)
    except OSError:  # it is closed
        yield
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


class _TextReader(_Resilient, DFReader.DFReader_text):  # type: ignore[misc]
    """pymavlink's reader of text logs."""


_SEVERITY = 6
"""Of the texts of a DataFlash log, which states none: information."""


def _dataflash(path: Path, wanted: set[str], on_text: OnText) -> Tables:
    with path.open("rb") as file:
        binary = file.read(2) == DATAFLASH_HEAD
    if binary:
        _check_formats(path)
    rows = _Rows()  # times are those since boot
    with redirect_stdout(StringIO()), redirect_stderr(StringIO()):  # it prints what is damaged
        try:
            reader = (_BinaryReader if binary else _TextReader)(str(path))
            names = list(wanted) or None
            while (message := reader.recv_match(type=names)) is not None:
                fields = {key: getattr(message, key) for key in message._fieldnames}
                name, instance, time = message.get_type(), _instance(message), _dataflash_time(fields)
                if time is not None:
                    rows.add(f"{name}[{instance}]" if instance else name, time, fields)
                    if name == "MSG" and isinstance(fields.get("Message"), str):
                        on_text(LoggedText(time, _SEVERITY, fields["Message"]))
        except Exception as error:
            if type(error) is not Exception and not isinstance(error, _DAMAGE):
                raise  # pymavlink raises bare ones at damage, too; what it read until then counts
    return rows.tables()


_STAMPS = {"TimeUS": 1e-6, "T": 1e-3, "TimeMS": 1e-3}
"""Columns with the time since boot and their units, s: ``TimeMS`` until 2014, but ``T`` in GPS."""


def _dataflash_time(fields: dict[str, Any]) -> float | None:
    """Remove the time from the fields of a message and return it in s; None if it has none."""
    for column, unit in _STAMPS.items():
        if isinstance(fields.get(column), int):
            return float(fields.pop(column)) * unit
    return None


def _instance(message: Any) -> int:
    """Return the sensor, estimator or motor of several that a message is about; 0 if it names none.

    The log marks the column by the unit ``#`` in FMTU. Where it states no units (until 2018) the column
    is ``I``; in MODE and EV it is something else.
    """
    definition = message.fmt
    column = definition.instance_field
    if column is None and definition.units is None and definition.name not in {"MODE", "EV"}:
        column = "I"
    value = getattr(message, column) if column in definition.columns else 0
    return value if isinstance(value, int) else 0


def _check_definitions(path: Path) -> None:
    """Refuse a ULog that ends inside damaged definitions: pyulog would read it for ever."""
    with path.open("rb") as file, mmap(file.fileno(), 0, access=ACCESS_READ) as data:
        at = _ULOG_START
        while at + _ULOG_HEAD.size <= len(data):
            length, kind = _ULOG_HEAD.unpack_from(data, at)
            after = at + _ULOG_HEAD.size + length
            if kind in _ULOG_DATA:
                return
            if kind in _ULOG_DEFINITIONS or (kind and 0 < length <= _ULOG_LONGEST):
                at = after
            elif after > len(data):
                what = f"of {length} bytes, {after - len(data)} more than the file has"
                raise UsageError(f"{path} is a damaged ULog: at byte {at} it defines a message {what}")
            else:
                at += 1


def _ulog(path: Path, wanted: set[str], on_text: OnText) -> Tables:
    require_extra("control", "logs of PX4")
    from pyulog import ULog
    from pyulog.core import ULogException

    _check_definitions(path)
    with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
        try:
            log = ULog(str(path), sorted(wanted) or None, disable_str_exceptions=True)
        except (ULogException, OSError, *_DAMAGE) as error:  # it seeks to before the file
            raise UsageError(f"{path} is a damaged ULog: {error}") from error
    tables: Tables = {}
    for data in sorted(log.data_list, key=lambda one: (one.name, one.multi_id)):
        name = data.name if data.multi_id == 0 else f"{data.name}[{data.multi_id}]"
        columns = {
            key: np.asarray(values, dtype=float)
            for key, values in data.data.items()
            if np.issubdtype(np.asarray(values).dtype, np.number)
        }
        stamps = columns.pop("timestamp", None)
        if stamps is not None and len(stamps):
            tables[name] = {TIME: (stamps - log.start_timestamp) / 1e6, **columns}
    for said in log.logged_messages:
        severity = said.log_level - ord("0")
        on_text(LoggedText((said.timestamp - log.start_timestamp) / 1e6, severity, said.message))
    return tables


def columns_of(tables: Mapping[str, Table]) -> Iterable[str]:
    """Yield the names ``TABLE.column`` of every column but the times."""
    for name in sorted(tables):
        for column in tables[name]:
            if column != TIME:
                yield f"{name}.{column}"
