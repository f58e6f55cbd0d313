"""Readers and writers of recordings: rosbag 1, rosbag 2 and MCAP.

Times are ns as in the recording: since the Unix epoch, or since the start of a simulated run. Messages belong
to a connection: a topic may carry several types, and types have the recording's own definitions.
"""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field, replace
from heapq import merge
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, NamedTuple, Protocol, Self

from rosbags.interfaces import (
    Connection,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag1 import WriterError as Writer1Error
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.rosbag2 import WriterError as Writer2Error

from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.ros.messages.containers import (
    DAMAGE,
    NO_OFFER,
    Offer,
    RawMessage,
    RecordedTopic,
    Rosbag2Reader,
    recover_mcap,
    recover_rosbag1,
    source_of,
)
from volery.ros.messages.encodings import ros1_name, ros1_type, to_cdr, to_ros1
from volery.ros.messages.message import RosMessage
from volery.ros.messages.recorded_types import RecordedType, Written
from volery.ros.messages.store import message_class, message_name, store

MAX_SALVAGED = 2 << 30
"""Bytes of messages, decompressed, that are salvaged of a damaged recording: they are sorted in memory."""

OF_THE_RUN = "/volery/"
"""Prefix of the topics of a run's trace that carry no ROS messages."""
OMITTED = f"{OF_THE_RUN}omitted"
"""Prefix of those that stand for long messages without their content; the topic of the messages follows."""

ROSBAG1, ROSBAG2, MCAP = "rosbag 1", "rosbag 2", "MCAP"
_SUFFIXES = {".bag": ROSBAG1, ".mcap": MCAP, ".db3": ROSBAG2}


class BagTopic(NamedTuple):
    """A recorded topic, one of its types (``package/msg/Name``) and its number of messages of that type."""

    name: str
    type: str
    messages: int


class BagMessage(NamedTuple):
    """A recorded message."""

    at: Ns
    topic: str
    message: RosMessage


class BagConnection:
    """A connection of a recording.

    Attributes:
        source: What the recording states of it.
        messages: Number of its messages.
        recorded: Its type; None if its messages cannot be decoded.
        problem: Why they cannot be decoded; empty if they can.
    """

    def __init__(self, source: RecordedTopic, messages: int, distribution: str) -> None:
        self.source, self.messages = source, messages
        self.recorded: RecordedType | None = None
        self.problem = ""
        try:
            self.recorded = RecordedType(source, distribution)
        except UsageError as error:
            self.problem = str(error)


@dataclass(frozen=True)
class Bag:
    """A recording.

    Attributes:
        path: The file or folder.
        format: ``ROSBAG1``, ``ROSBAG2`` or ``MCAP``.
        connections: All connections, by topic and type.
        start: Time of the first message, ns.
        end: Time of the last message, ns.
        complete: False if the recording was cut short or is damaged; its complete messages are read.
        indexed: Whether it can be read in order of time without being read as a whole.
        damage: What was found to be damaged while messages were read; their reader appends to it.
        remark: How it was read if not as usual; empty otherwise.
        parts: The files of a folder whose metadata cannot be read, as ``ros2 bag reindex`` finds them.
    """

    path: Path
    format: str
    connections: tuple[BagConnection, ...]
    start: Ns
    end: Ns
    complete: bool
    indexed: bool = True
    damage: list[str] = field(default_factory=list, compare=False)
    remark: str = ""
    parts: tuple[Bag, ...] = ()

    @property
    def topics(self) -> tuple[BagTopic, ...]:
        """Topics with their types, by name."""
        counts: Counter[tuple[str, str]] = Counter()
        for connection in self.connections:
            counts[connection.source.topic, connection.source.type] += connection.messages
        return tuple(BagTopic(*key, counts[key]) for key in sorted(counts))

    @property
    def unreadable(self) -> dict[str, str]:
        """Reasons why messages of a topic cannot be decoded, by topic."""
        return {
            connection.source.topic: connection.problem
            for connection in self.connections
            if connection.problem
        }

    @property
    def usual(self) -> list[str]:
        """Topics that are read by default: all that can be decoded, without those of a run's trace."""
        names = {connection.source.topic for connection in self.connections if not connection.problem}
        return sorted(name for name in names if not name.startswith(OF_THE_RUN))

    @property
    def omitted(self) -> dict[str, int]:
        """Topics of a run's trace, and how many long messages without their content they have."""
        counts = (
            (connection.source.topic.removeprefix(OMITTED), connection) for connection in self.connections
        )
        return {topic: one.messages for topic, one in counts if topic != one.source.topic}

    def omission(self, topics: Collection[str]) -> str:
        """Return how to get the content of long messages of *topics*, which are some of ``omitted``."""
        found = ", ".join(f"{topic} ({self.omitted[topic]})" for topic in topics)
        what = f"{self.path} has long messages without their content: {found}"
        return f"{what}; volery simulate --record {','.join(topics)} records it"

    @property
    def differences(self) -> list[str]:
        """How definitions of messages read so far differ from ours, in sentences."""
        found = (
            connection.recorded.differences()
            for connection in self.connections
            if connection.recorded is not None
        )
        return sorted({one for one in found if one})

    @property
    def left_out(self) -> dict[str, str]:
        """Fields of messages read so far that another definition lacks, by topic."""
        return {
            connection.source.topic: (
                f"{connection.source.type} has no {', '.join(connection.recorded.left_out)} there"
            )
            for connection in self.connections
            if connection.recorded is not None and connection.recorded.left_out
        }

    def messages(self, topics: Collection[str] | None = None) -> Iterator[BagMessage]:
        """Yield the messages of `topics` (by default of all that can be decoded), in order of time."""
        for connection, raw in self.raw(topics):
            if connection.recorded is None:
                continue
            try:
                message = connection.recorded.message(raw.data)
            except (UsageError, RecursionError, *DAMAGE):
                self.note(f"messages of {raw.source.topic} that do not fit their type are left out")
                continue
            yield BagMessage(raw.at, raw.source.topic, message)

    def raw(self, topics: Collection[str] | None = None) -> Iterator[tuple[BagConnection, RawMessage]]:
        """Yield the messages of `topics` and their connections, also those that cannot be decoded."""
        known = {connection.source: connection for connection in self.connections}
        for raw in self._raw():
            connection = known.get(raw.source)
            if connection is None:  # only its undamaged part is known
                connection = known[raw.source] = BagConnection(raw.source, 0, "")
            if topics is None or raw.source.topic in topics:
                yield connection, raw

    def note(self, what: str) -> None:
        """Add to ``damage`` once."""
        if what not in self.damage:
            self.damage.append(what)

    def _raw(self) -> Iterator[RawMessage]:
        if self.parts:
            for _, raw in merge(*(part.raw() for part in self.parts), key=lambda pair: pair[1].at):
                yield raw
            return
        if not self.indexed:
            yield from self._salvaged()
            return
        last, given = -1, Counter[tuple[str, bytes]]()  # of the messages at time `last`
        try:
            with _reader(self.path, self.format) as reader:
                sources = _sources(reader)
                for connection, at, data in reader.messages():
                    raw = RawMessage(at, sources[connection.id], bytes(data))
                    if at != last:
                        last, given = at, Counter()
                    given[raw.source.topic, raw.data] += 1
                    yield raw
        except DAMAGE as error:
            self.note(f"a part of {self.path} is damaged and left out: {error}")
            for raw in self._salvaged():
                if raw.at == last and given[raw.source.topic, raw.data]:
                    given[raw.source.topic, raw.data] -= 1
                elif raw.at >= last:
                    yield raw

    def _salvaged(self) -> list[RawMessage]:
        """Return the complete messages of the undamaged chunks, in order of time."""
        if self.format == ROSBAG2 and self.path.is_dir():
            files = sorted(self.path.glob("*.mcap"))
        else:
            files = [self.path]
        found, size = [], 0
        for raw in (raw for file in files for raw in _recover(file, self.format, [])):
            size += len(raw.data)
            if size > MAX_SALVAGED:
                self.note(f"{self.path} is damaged; only its first {MAX_SALVAGED >> 20} MB are salvaged")
                break
            found.append(raw)
        return sorted(found, key=lambda raw: raw.at)


def _recover(path: Path, kind: str, damage: list[str]) -> Iterator[RawMessage]:
    if kind == ROSBAG1:
        damage.append("it has no index")
        return recover_rosbag1(path)
    return recover_mcap(path, damage)


def open_bag(path: Path) -> Bag:
    """Open a recording.

    Args:
        path: A ``.bag`` or ``.mcap`` file, or the folder of a rosbag 2.

    Raises:
        UsageError: there is none, or nothing of it can be read.
    """
    if not path.exists():
        raise UsageError(f"no recording {path}")
    kind = ROSBAG2 if path.is_dir() else _SUFFIXES.get(path.suffix)
    if kind is None:
        raise UsageError(f"{path}: a recording is a .bag or .mcap file, or the folder of a rosbag 2")
    try:
        return _indexed(path, kind)
    except DAMAGE as error:
        if kind != ROSBAG2:
            return _salvaged(path, kind, str(error))
        if path.is_dir():
            return _of_files(path, str(error))
        raise UsageError(f"{path} is no rosbag 2 that can be read: {error}") from error


def _of_files(path: Path, problem: str) -> Bag:
    """Open a folder whose ``metadata.yaml`` is missing or wrong by all of its files."""
    parts: list[Bag] = []
    damage: list[str] = []
    for file in sorted(one for one in path.iterdir() if one.suffix in (".mcap", ".db3") and one.is_file()):
        try:
            parts.append(replace(open_bag(file), damage=damage))
        except UsageError as error:
            damage.append(str(error))
    if not parts:
        raise UsageError(f"{path} is no rosbag 2 that can be read: {'; '.join([problem, *damage])}")
    counts: Counter[RecordedTopic] = Counter()
    for one in (connection for part in parts for connection in part.connections):
        counts[one.source] += one.messages
    filled = [part for part in parts if any(connection.messages for connection in part.connections)]
    return Bag(
        path,
        ROSBAG2,
        _connections(counts),
        min((part.start for part in filled), default=0),
        max((part.end for part in filled), default=0),
        complete=not (damage or (path / METADATA).exists()) and all(part.complete for part in parts),
        damage=damage,
        remark=f"{path} is read from all of its files, as its {METADATA} cannot be followed: {problem}",
        parts=tuple(parts),
    )


def _reader(path: Path, kind: str) -> Any:
    return Reader1(path) if kind == ROSBAG1 else Rosbag2Reader(path)


def _sources(reader: Any) -> dict[int, RecordedTopic]:
    """Return the connections of a reader by their numbers; ROS 1's senders are in a folder's own data."""
    senders = {}
    if isinstance(reader, Rosbag2Reader):
        senders = reader.storage.metadata.custom or {}
    found = {}
    for connection in reader.connections:
        source = source_of(connection)
        sender = senders.get(f"{SENDER}{source.topic}", source.offer.sender)
        found[connection.id] = source._replace(offer=source.offer._replace(sender=sender))
    return found


def _indexed(path: Path, kind: str) -> Bag:
    counts: Counter[RecordedTopic] = Counter()
    with _reader(path, kind) as reader:
        sources = _sources(reader)
        for connection in reader.connections:
            counts[sources[connection.id]] += connection.msgcount or 0
        start, end = (reader.start_time, reader.end_time - 1) if reader.message_count else (0, 0)
        distribution = "" if kind == ROSBAG1 else reader.ros_distro or ""
    return Bag(path, kind, _connections(counts, distribution), start, end, True)


def _connections(counts: Counter[RecordedTopic], distribution: str = "") -> tuple[BagConnection, ...]:
    ordered = sorted(counts, key=lambda one: (one.topic, one.type, one.offer.sender))
    return tuple(BagConnection(one, counts[one], distribution) for one in ordered)


def _salvaged(path: Path, kind: str, problem: str) -> Bag:
    counts: Counter[RecordedTopic] = Counter()
    times: list[Ns] = []
    damage: list[str] = []
    for raw in _recover(path, kind, damage):
        counts[raw.source] += 1
        times.append(raw.at)
    if not times:
        raise UsageError(f"{path}: nothing of it can be read: {problem}")
    return Bag(path, kind, _connections(counts), min(times), max(times), not damage, indexed=False)


METADATA = "metadata.yaml"
_METADATA_VERSION: Literal[9] = 9
"""Version of rosbag2's metadata.yaml; Jazzy and later write it, Iron and later read it."""


SENDER = "sender of "
"""Key, before a topic's name, of the custom data of a rosbag 2 that hold the node which ROS 1 recorded."""
_NO_HASH = f"RIHS01_{'0' * 64}"
_FOREVER = QosTime(2147483647, 4294967295)


def qos_profile(reliable: bool, latched: bool, depth: int = 0) -> Qos:
    """Return a profile as rosbag 2 records it; a depth of 0 stands for one that is not known."""
    return Qos(
        QosHistory.KEEP_LAST if depth else QosHistory.UNKNOWN,
        depth,
        QosReliability.RELIABLE if reliable else QosReliability.BEST_EFFORT,
        QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
        _FOREVER,
        _FOREVER,
        QosLiveliness.AUTOMATIC,
        _FOREVER,
        avoid_ros_namespace_conventions=False,
    )


class BagWriter(Protocol):
    """A recording in progress; a context manager. It must be closed to be complete."""

    def write(self, topic: str, at: Ns, message: RosMessage, offer: Offer = NO_OFFER) -> None:
        """Add a message at time `at`, ns, of a connection with this offer.

        Raises ``UsageError`` if this format does not support its type.
        """

    def copy(self, connection: BagConnection, at: Ns, data: bytes) -> None:
        """Add an undecoded message of another recording; its type keeps its definition within one ROS.

        Raises ``UsageError`` if this format does not support its type, or the bytes are none of it.
        """

    def close(self) -> None:
        """Complete the recording."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None: ...


class _Writer:
    def __init__(self, path: Path, writer: Any) -> None:
        self._path = path
        self._writer = writer
        self._types: dict[str, str] = {}
        self._own: dict[tuple[str, str, Offer], Connection] = {}
        self._copied: dict[RecordedTopic, tuple[Connection, Callable[[bytes], bytes]]] = {}
        try:
            writer.open()
        except (Writer1Error, Writer2Error, OSError) as error:
            raise UsageError(f"{path} cannot be written: {error}") from error

    def write(self, topic: str, at: Ns, message: RosMessage, offer: Offer = NO_OFFER) -> None:
        """Add a message."""
        name = message.__msgtype__
        if self._types.setdefault(topic, name) != name:
            raise UsageError(f"{self._path}: topic {topic} carries {self._types[topic]}, not {name}")
        key = topic, name, offer
        if key not in self._own:
            self._own[key] = self._connect(topic, name, self._written(name), offer)
        self._writer.write(self._own[key], at, self._encoded(message))

    def copy(self, connection: BagConnection, at: Ns, data: bytes) -> None:
        """Add an undecoded message of another recording."""
        try:
            made, convert = self._copied.get(connection.source) or self._begin_copy(connection, data)
            encoded = convert(data)
        except (RecursionError, *DAMAGE) as error:
            raise UsageError(f"they do not fit their type {connection.source.type}: {error}") from error
        self._writer.write(made, at, encoded)

    def _begin_copy(
        self, connection: BagConnection, data: bytes
    ) -> tuple[Connection, Callable[[bytes], bytes]]:
        source, recorded = connection.source, connection.recorded
        if recorded is None:
            written = self._verbatim(connection)
        else:
            recorded.resolve(data)
            written = self._copy_of(recorded)
        made = self._connect(source.topic, source.type, written, source.offer), written.convert
        self._copied[source] = made
        return made

    def _written(self, name: str) -> Written:
        """Return definition and checksum of one of our types."""
        raise NotImplementedError

    def _copy_of(self, recorded: RecordedType) -> Written:
        """Return how a recorded type is written."""
        raise NotImplementedError

    def _verbatim(self, connection: BagConnection) -> Written:
        """Return how messages that cannot be decoded are written; raise ``UsageError`` if they cannot be."""
        raise UsageError(connection.problem)

    def _encoded(self, message: RosMessage) -> bytes:
        raise NotImplementedError

    def _connect(self, topic: str, name: str, written: Written, offer: Offer) -> Connection:
        raise NotImplementedError

    def close(self) -> None:
        """Complete the recording."""
        self._writer.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()


class Rosbag1Writer(_Writer):
    """Writer of a ``.bag`` file, which ROS 1 and Debian's ``rosbag`` read."""

    def __init__(self, path: Path) -> None:
        path.unlink(missing_ok=True)
        super().__init__(path, Writer1(path))

    def _written(self, name: str) -> Written:
        kind = ros1_type(name)
        return Written(kind.text, kind.md5, bytes)

    def _copy_of(self, recorded: RecordedType) -> Written:
        return recorded.for_ros1()

    def _encoded(self, message: RosMessage) -> bytes:
        return to_ros1(message)

    def _connect(self, topic: str, name: str, written: Written, offer: Offer) -> Connection:
        made: Connection = self._writer.add_connection(
            topic,
            ros1_name(name).replace("/", "/msg/"),
            msgdef=written.definition,
            md5sum=written.digest,
            callerid=offer.sender or None,
            latching=int(offer.latched),
        )
        return made


class Rosbag2Writer(_Writer):
    """Writer of a folder with an MCAP file, which ``ros2 bag``, Foxglove and PlotJuggler read."""

    def __init__(self, path: Path) -> None:
        if path.is_dir() and (path / METADATA).exists():
            shutil.rmtree(path)
        self._defined: dict[str, RecordedType] = {}
        self._connected: dict[tuple[str, str, tuple[Qos, ...]], Connection] = {}
        super().__init__(path, Writer2(path, version=_METADATA_VERSION, storage_plugin=StoragePlugin.MCAP))

    def _written(self, name: str) -> Written:
        message_class(name)
        types, full = store(), message_name(name)
        return Written(types.generate_msgdef(full, ros_version=2)[0], types.hash_rihs01(full), bytes)

    def _copy_of(self, recorded: RecordedType) -> Written:
        """Return how a type is written: of one name by one definition, as readers take the first."""
        first = self._defined.setdefault(recorded.name, recorded)
        if first is recorded or "ros1" in (first.encoding, recorded.encoding):
            return recorded.for_ros2()
        return recorded.as_other(first)

    def _verbatim(self, connection: BagConnection) -> Written:
        source = connection.source
        if source.encoding != "cdr" or source.type.count("/") != 2:
            raise UsageError(connection.problem)
        text = source.definition if source.schema == "msg" else ""
        return Written(text, source.digest or _NO_HASH, bytes)

    def _encoded(self, message: RosMessage) -> bytes:
        return to_cdr(message)

    def _connect(self, topic: str, name: str, written: Written, offer: Offer) -> Connection:
        profiles = offer.qos
        if offer.latched and not profiles:
            profiles = (qos_profile(reliable=True, latched=True, depth=1),)
        key = topic, name, profiles
        if key not in self._connected:
            self._connected[key] = self._writer.add_connection(
                topic, name, msgdef=written.definition, rihs01=written.digest, offered_qos_profiles=profiles
            )
        if offer.sender:
            self._writer.set_custom_data(f"{SENDER}{topic}", offer.sender)
        return self._connected[key]


def create_bag(path: Path) -> BagWriter:
    """Begin a recording; an older one of the same kind is replaced.

    Args:
        path: ``NAME.bag`` for a rosbag 1, any other name for the folder of a rosbag 2 in MCAP.

    Raises:
        UsageError: it cannot be written there.
    """
    return Rosbag1Writer(path) if path.suffix == ".bag" else Rosbag2Writer(path)
