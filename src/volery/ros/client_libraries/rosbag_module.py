"""``rosbag`` of ROS 1 over the recordings that volery reads and writes: ``Bag`` inside a component.

A recording is read in order of time, whatever its format is; what is written is a rosbag 1. Appending to one
and raw messages are not offered.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from types import ModuleType, TracebackType
from typing import Any, ClassVar, NamedTuple, Self

from volery.base.errors import UsageError
from volery.base.time import Ns, to_seconds
from volery.ros.client_libraries.library_base import library_module
from volery.ros.client_libraries.rospy.session import as_ns
from volery.ros.messages import ros1_type
from volery.ros.messages.bags import BagWriter, create_bag, open_bag
from volery.ros.messages.client_classes import ROSPY, adopt
from volery.ros.messages.encodings import ros1_name


class ROSBagException(Exception):  # noqa: N818 - rosbag's name
    """A recording cannot be used so."""


class ROSBagFormatException(ROSBagException):
    """A file is no recording."""


class BagMessage(NamedTuple):
    """A recorded message: topic, message and time."""

    topic: str
    message: Any
    timestamp: Any


class TopicTuple(NamedTuple):
    """What a recording has of a topic. Frequencies are not computed."""

    msg_type: str
    message_count: int
    connections: int
    frequency: float | None


class TypesAndTopicsTuple(NamedTuple):
    """Checksums by type, and topics by name."""

    msg_types: dict[str, str]
    topics: dict[str, TopicTuple]


class Bag:
    """A recording, opened to be read (``r``) or written (``w``)."""

    rospy: ClassVar[Any]

    def __init__(self, f: Any, mode: str = "r", **options: Any) -> None:
        self.filename = str(f)
        self._writer: BagWriter | None = None
        self._written: dict[str, int] = {}
        self._times: list[Ns] = []
        try:
            if mode == "w":
                self._writer = create_bag(Path(f).with_suffix(".bag") if not Path(f).suffix else Path(f))
            elif mode == "r":
                self._read = open_bag(Path(f))
            else:
                raise ValueError(f"rosbag.Bag: mode {mode!r} is not there on the embedded graph; give r or w")
        except UsageError as error:
            raise ROSBagFormatException(str(error)) from error

    def write(self, topic: str, msg: Any, t: Any = None, raw: bool = False, **options: Any) -> None:
        """Add a message, by default at the current ROS time."""
        if raw:
            raise NotImplementedError("rosbag.Bag.write(raw=True) is not there on the embedded graph")
        if self._writer is None:
            raise ValueError(f"{self.filename} is opened to be read")
        at = as_ns(self.rospy.Time.now() if t is None else t)
        self._writer.write(topic, at, msg.copy())
        self._written[topic] = self._written.get(topic, 0) + 1
        self._times.append(at)

    def read_messages(
        self,
        topics: Any = None,
        start_time: Any = None,
        end_time: Any = None,
        raw: bool = False,
        **options: Any,
    ) -> Iterator[BagMessage]:
        """Yield the messages of some topics between two times, both included, as (topic, message, time)."""
        if raw or options:
            given = ", ".join(options) or "raw"
            raise NotImplementedError(
                f"rosbag.Bag.read_messages({given}=) is not there on the embedded graph"
            )
        wanted = _listed(topics)
        first, last = (None if one is None else as_ns(one) for one in (start_time, end_time))
        for one in self._opened().messages(wanted):
            if (first is None or one.at >= first) and (last is None or one.at <= last):
                stamp = self.rospy.Time(*divmod(one.at, 1_000_000_000))
                yield BagMessage(one.topic, adopt(one.message, ROSPY), stamp)

    def __iter__(self) -> Iterator[BagMessage]:
        return self.read_messages()

    def get_message_count(self, topic_filters: Any = None) -> int:
        """Return the number of messages of some topics, by default of all."""
        wanted = _listed(topic_filters)
        counts = self._counts()
        return sum(count for topic, count in counts if wanted is None or topic in wanted)

    def get_start_time(self) -> float:
        """Return the time of the first message, s."""
        return to_seconds(min(self._times) if self._writer is not None else self._opened().start)

    def get_end_time(self) -> float:
        """Return the time of the last message, s."""
        return to_seconds(max(self._times) if self._writer is not None else self._opened().end)

    def get_type_and_topic_info(self, topic_filters: Any = None) -> TypesAndTopicsTuple:
        """Return the types with their checksums, and the topics."""
        wanted = _listed(topic_filters)
        found = [topic for topic in self._opened().topics if wanted is None or topic.name in wanted]
        types = {ros1_name(one.type): ros1_type(one.type).md5 for one in found}
        topics = {one.name: TopicTuple(ros1_name(one.type), one.messages, 1, None) for one in found}
        return TypesAndTopicsTuple(types, topics)

    def flush(self) -> None:
        """Do nothing: a recording is complete when it is closed."""

    def close(self) -> None:
        """Complete the recording."""
        if self._writer is not None:
            self._writer.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def _counts(self) -> list[tuple[str, int]]:
        if self._writer is not None:
            return list(self._written.items())
        return [(topic.name, topic.messages) for topic in self._read.topics]

    def _opened(self) -> Any:
        if self._writer is not None:
            raise ValueError(f"{self.filename} is opened to be written")
        return self._read


def _listed(topics: Any) -> Collection[str] | None:
    if topics is None:
        return None
    return [topics] if isinstance(topics, str) else list(topics)


def modules(rospy: ModuleType) -> dict[str, ModuleType]:
    """Return the modules of ``rosbag`` of one run by name.

    Args:
        rospy: Module whose times are used.
    """
    names = {
        "Bag": type("Bag", (Bag,), {"rospy": rospy}),
        "ROSBagException": ROSBagException,
        "ROSBagFormatException": ROSBagFormatException,
    }
    bag = library_module("rosbag.bag", {**names, "BagMessage": BagMessage})
    return {"rosbag": library_module("rosbag", {**names, "bag": bag}), "rosbag.bag": bag}
