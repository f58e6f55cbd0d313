"""``message_filters`` over the faces: messages of several topics that belong together, by their stamps.

Made of what the faces offer, as the real one is of rospy and rclpy: without a node it is rospy's, with one
rclpy's. There are ``Subscriber``, ``Cache``, ``TimeSynchronizer`` and ``ApproximateTimeSynchronizer``.

Where messages come from: ``SimpleFilter``, ``Subscriber``, and a ``Cache`` of the last ones.

Messages of several topics that belong together: of the same stamp, or of nearly the same.

The module ``message_filters`` of one run.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Callable, Sequence
from itertools import product
from operator import itemgetter
from types import ModuleType
from typing import Any, ClassVar

from volery.base.time import Ns, from_seconds
from volery.ros.client_libraries.library_base import library_module

Callback = Callable[..., Any]


class SimpleFilter:
    """Hands messages on to whoever has registered. ``node`` is rclpy's, ``None`` for rospy."""

    rospy: ClassVar[Any]
    rclpy_time: ClassVar[Any]
    node: Any = None

    def __init__(self) -> None:
        self.callbacks: dict[int, tuple[Callback, tuple[Any, ...]]] = {}

    def registerCallback(self, cb: Callback, *args: Any) -> int:
        """Call *cb* with each message and *args*; returns the connection's number."""
        number = len(self.callbacks)
        self.callbacks[number] = cb, args
        return number

    def signalMessage(self, *msg: Any) -> None:
        """Hand it on."""
        for callback, args in list(self.callbacks.values()):
            callback(*msg, *args)

    def stamp_of(self, message: Any, allow_headerless: bool) -> Ns | None:
        """When it is of, in ns: by its header, or now; ``None``, with a warning, if neither may be had."""
        header = getattr(message, "header", None)
        if header is not None:
            return nanoseconds(header.stamp)
        if allow_headerless:
            return self._now()
        say = self.rospy.logwarn if self.node is None else self.node.get_logger().warning
        say("Cannot use message filters with messages without a 'header'; 'allow_headerless' would let them")
        return None

    def _now(self) -> Ns:
        if self.node is None:
            return nanoseconds(self.rospy.Time.now())
        return nanoseconds(self.node.get_clock().now())

    def as_time(self, stamp: Ns) -> Any:
        """A time of the client library."""
        if self.node is None:
            return self.rospy.Time(stamp // 1_000_000_000, stamp % 1_000_000_000)
        return self.rclpy_time(nanoseconds=stamp)


def nanoseconds(time: Any) -> Ns:
    """Of a stamp, or of a time of rospy or rclpy."""
    whole = getattr(time, "nanoseconds", None)
    return int(time.to_nsec() if whole is None else whole)


class Subscriber(SimpleFilter):
    """A topic: what ``rospy.Subscriber`` takes or, with a node first, (node, type, topic, ...) of rclpy."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__()
        if args and hasattr(args[0], "create_subscription"):
            self.node, kind, self.topic, *rest = args
            qos = kwargs.pop("qos_profile", rest.pop(0) if rest else 10)
            self.sub = self.node.create_subscription(kind, self.topic, self.callback, qos, *rest, **kwargs)
        else:
            self.topic = args[0] if args else kwargs["name"]
            self.sub = self.rospy.Subscriber(*args, **kwargs, callback=self.callback)

    def callback(self, msg: Any) -> None:
        """A message is there."""
        self.signalMessage(msg)

    def getTopic(self) -> str:
        """Its name, as it was given."""
        return str(self.topic)


class Cache(SimpleFilter):
    """Keeps the last messages by their stamps, and hands them on. Times are the client library's."""

    def __init__(
        self, f: SimpleFilter | None = None, cache_size: int = 1, allow_headerless: bool = False
    ) -> None:
        super().__init__()
        self.cache_size = cache_size
        self.allow_headerless = allow_headerless
        self._kept: list[tuple[Ns, Any]] = []
        if f is not None:
            self.connectInput(f)

    def connectInput(self, f: SimpleFilter) -> None:
        """Keep what comes from there."""
        self.node = f.node
        self.incoming_connection = f.registerCallback(self.add)

    def add(self, msg: Any) -> None:
        """Keep it; the oldest goes if there are too many."""
        stamp = self.stamp_of(msg, self.allow_headerless)
        if stamp is None:
            return
        insort(self._kept, (stamp, msg), key=itemgetter(0))
        del self._kept[: -self.cache_size]
        self.signalMessage(msg)

    def getInterval(self, from_stamp: Any, to_stamp: Any) -> list[Any]:
        """What is kept between two times, both of them included."""
        first, last = nanoseconds(from_stamp), nanoseconds(to_stamp)
        return [message for stamp, message in self._kept if first <= stamp <= last]

    def getElemAfterTime(self, stamp: Any) -> Any:
        """The first one at or after that time; ``None`` if there is none."""
        wanted = nanoseconds(stamp)
        return next((message for at, message in self._kept if at >= wanted), None)

    def getElemBeforeTime(self, stamp: Any) -> Any:
        """The last one at or before that time; ``None`` if there is none."""
        wanted = nanoseconds(stamp)
        return next((message for at, message in reversed(self._kept) if at <= wanted), None)

    def getLastestTime(self) -> Any:
        """When the last one is of (the name is theirs); ``None`` if there is none."""
        return self.as_time(self._kept[-1][0]) if self._kept else None

    getLatestTime = getLastestTime

    def getOldestTime(self) -> Any:
        """When the first one is of; ``None`` if there is none."""
        return self.as_time(self._kept[0][0]) if self._kept else None

    def getLast(self) -> Any:
        """The last one; ``None`` if there is none."""
        return self._kept[-1][1] if self._kept else None


Queue = dict[Ns, Any]
"""Messages that wait, by their stamps."""


class TimeSynchronizer(SimpleFilter):
    """Hands on one message of each input once all of the same stamp are there."""

    def __init__(self, fs: Sequence[SimpleFilter], queue_size: int) -> None:
        super().__init__()
        self.queue_size = queue_size
        self.allow_headerless = False
        self.connectInput(fs)

    def connectInput(self, fs: Sequence[SimpleFilter]) -> None:
        """Synchronise these."""
        self.node = next((one.node for one in fs if one.node is not None), None)
        self.queues: list[Queue] = [{} for _ in fs]
        self.input_connections = [
            one.registerCallback(self.add, queue, index)
            for index, (one, queue) in enumerate(zip(fs, self.queues, strict=True))
        ]

    def add(self, msg: Any, my_queue: Queue, my_queue_index: int | None = None) -> None:
        """A message of one input is there."""
        stamp = self.stamp_of(msg, self.allow_headerless)
        if stamp is None:
            return
        my_queue[stamp] = msg
        while len(my_queue) > self.queue_size:
            del my_queue[min(my_queue)]
        self._match(stamp, my_queue)

    def _match(self, stamp: Ns, new: Queue) -> None:
        if all(stamp in queue for queue in self.queues):
            self._hand_on([stamp] * len(self.queues))

    def _hand_on(self, stamps: Sequence[Ns]) -> None:
        """The messages of these stamps, one of each input, which wait no longer."""
        self.signalMessage(*[queue.pop(stamp) for queue, stamp in zip(self.queues, stamps, strict=True)])


class ApproximateTimeSynchronizer(TimeSynchronizer):
    """Hands on one message of each input whose stamps are less than *slop* seconds apart.

    With a new message it looks at those of the other inputs that are at most *slop* from it, the nearest
    first; the first set that is near enough as a whole it is.
    """

    def __init__(
        self,
        fs: Sequence[SimpleFilter],
        queue_size: int,
        slop: float,
        allow_headerless: bool = False,
    ) -> None:
        super().__init__(fs, queue_size)
        self.slop: Ns = from_seconds(slop)
        self.allow_headerless = allow_headerless

    def _match(self, stamp: Ns, new: Queue) -> None:
        near = [
            [stamp] if queue is new else sorted(self._near(queue, stamp), key=lambda at: abs(at - stamp))
            for queue in self.queues
        ]
        for stamps in product(*near):
            if max(stamps) - min(stamps) < self.slop or len(set(stamps)) == 1:
                self._hand_on(stamps)
                return

    def _near(self, queue: Queue, stamp: Ns) -> list[Ns]:
        return [at for at in queue if abs(at - stamp) <= self.slop]


_FILTERS = (SimpleFilter, Subscriber, Cache, TimeSynchronizer, ApproximateTimeSynchronizer)


def modules(rospy: ModuleType, times: ModuleType) -> dict[str, ModuleType]:
    """By name. They talk through *rospy* where no node is given; *times* is ``rclpy.time``."""
    members = {"rospy": rospy, "rclpy_time": times.Time}
    names = {kind.__name__: type(kind.__name__, (kind,), members) for kind in _FILTERS}
    return {"message_filters": library_module("message_filters", names)}


__all__ = ["modules"]
