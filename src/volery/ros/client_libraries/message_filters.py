"""``message_filters``: messages of several topics that belong together by their stamps.

Built on the client libraries, as the real one is: without a node on rospy, with a node on rclpy. There are
``Subscriber``, ``Cache``, ``TimeSynchronizer`` and ``ApproximateTimeSynchronizer``.
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
    """Passes messages on to registered callbacks. ``node`` is a node of rclpy, or None with rospy."""

    rospy: ClassVar[Any]
    rclpy_time: ClassVar[Any]
    node: Any = None

    def __init__(self) -> None:
        self.callbacks: dict[int, tuple[Callback, tuple[Any, ...]]] = {}

    def registerCallback(self, cb: Callback, *args: Any) -> int:
        """Call *cb* with each message and *args*; return the number of the connection."""
        number = len(self.callbacks)
        self.callbacks[number] = cb, args
        return number

    def signalMessage(self, *msg: Any) -> None:
        """Pass a message to all callbacks."""
        for callback, args in list(self.callbacks.values()):
            callback(*msg, *args)

    def stamp_of(self, message: Any, allow_headerless: bool) -> Ns | None:
        """Return the stamp of a message in ns, or None and log a warning if the message has no header.

        Args:
            message: A message.
            allow_headerless: Whether a message without a header has the current time as its stamp.
        """
        header = getattr(message, "header", None)
        if header is not None:
            return nanoseconds(header.stamp)
        if allow_headerless:
            clock = self.rospy.Time if self.node is None else self.node.get_clock()
            return nanoseconds(clock.now())
        warn = self.rospy.logwarn if self.node is None else self.node.get_logger().warning
        warn("Cannot use message filters with messages without a 'header'; 'allow_headerless' would let them")
        return None

    def as_time(self, stamp: Ns) -> Any:
        """Return *stamp* as a time of the client library."""
        if self.node is None:
            return self.rospy.Time(stamp // 1_000_000_000, stamp % 1_000_000_000)
        return self.rclpy_time(nanoseconds=stamp)


def nanoseconds(time: Any) -> Ns:
    """Return a stamp, or a time of rospy or rclpy, in ns."""
    whole = getattr(time, "nanoseconds", None)
    return int(time.to_nsec() if whole is None else whole)


class Subscriber(SimpleFilter):
    """Messages of a topic. Arguments as of ``rospy.Subscriber``, or (node, type, topic, ...) with rclpy."""

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
        """Pass a received message on."""
        self.signalMessage(msg)

    def getTopic(self) -> str:
        """Return the topic name as it was given."""
        return str(self.topic)


class Cache(SimpleFilter):
    """Keeps the last messages by their stamps and passes them on. Times are those of the client library."""

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
        """Keep the messages of another filter."""
        self.node = f.node
        self.incoming_connection = f.registerCallback(self.add)

    def add(self, msg: Any) -> None:
        """Keep a message and drop the oldest ones beyond the size of the cache."""
        stamp = self.stamp_of(msg, self.allow_headerless)
        if stamp is None:
            return
        insort(self._kept, (stamp, msg), key=itemgetter(0))
        del self._kept[: -self.cache_size]
        self.signalMessage(msg)

    def getInterval(self, from_stamp: Any, to_stamp: Any) -> list[Any]:
        """Return the messages between two times, both included."""
        first, last = nanoseconds(from_stamp), nanoseconds(to_stamp)
        return [message for stamp, message in self._kept if first <= stamp <= last]

    def getElemAfterTime(self, stamp: Any) -> Any:
        """Return the first message at or after a time, or None."""
        wanted = nanoseconds(stamp)
        return next((message for at, message in self._kept if at >= wanted), None)

    def getElemBeforeTime(self, stamp: Any) -> Any:
        """Return the last message at or before a time, or None."""
        wanted = nanoseconds(stamp)
        return next((message for at, message in reversed(self._kept) if at <= wanted), None)

    def getLastestTime(self) -> Any:
        """Return the stamp of the last message, or None. The misspelt name is message_filters' own."""
        return self.as_time(self._kept[-1][0]) if self._kept else None

    getLatestTime = getLastestTime

    def getOldestTime(self) -> Any:
        """Return the stamp of the first message, or None."""
        return self.as_time(self._kept[0][0]) if self._kept else None

    def getLast(self) -> Any:
        """Return the last message, or None."""
        return self._kept[-1][1] if self._kept else None


Queue = dict[Ns, Any]
"""Waiting messages by their stamps."""


class TimeSynchronizer(SimpleFilter):
    """Passes on one message of each input when messages with equal stamps have arrived at all inputs."""

    def __init__(self, fs: Sequence[SimpleFilter], queue_size: int) -> None:
        super().__init__()
        self.queue_size = queue_size
        self.allow_headerless = False
        self.connectInput(fs)

    def connectInput(self, fs: Sequence[SimpleFilter]) -> None:
        """Synchronise the messages of *fs*."""
        self.node = next((one.node for one in fs if one.node is not None), None)
        self.queues: list[Queue] = [{} for _ in fs]
        self.input_connections = [
            one.registerCallback(self.add, queue, index)
            for index, (one, queue) in enumerate(zip(fs, self.queues, strict=True))
        ]

    def add(self, msg: Any, my_queue: Queue, my_queue_index: int | None = None) -> None:
        """Queue a message of one input and pass on what has become complete."""
        stamp = self.stamp_of(msg, self.allow_headerless)
        if stamp is None:
            return
        my_queue[stamp] = msg
        while len(my_queue) > self.queue_size:
            del my_queue[min(my_queue)]
        self._match(stamp, my_queue)

    def _match(self, stamp: Ns, new: Queue) -> None:
        if all(stamp in queue for queue in self.queues):
            self._pass_on([stamp] * len(self.queues))

    def _pass_on(self, stamps: Sequence[Ns]) -> None:
        """Pass on and remove the messages with these stamps, one of each input."""
        self.signalMessage(*[queue.pop(stamp) for queue, stamp in zip(self.queues, stamps, strict=True)])


class ApproximateTimeSynchronizer(TimeSynchronizer):
    """Passes on one message of each input whose stamps differ by less than *slop* seconds.

    A new message is combined with the messages of the other inputs that differ from it by at most *slop*, the
    nearest first. The first combination that is close enough as a whole is passed on.
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
        def near(queue: Queue) -> list[Ns]:
            candidates = [at for at in queue if abs(at - stamp) <= self.slop]
            return sorted(candidates, key=lambda at: abs(at - stamp))

        for stamps in product(*([stamp] if queue is new else near(queue) for queue in self.queues)):
            if max(stamps) - min(stamps) < self.slop or len(set(stamps)) == 1:
                self._pass_on(stamps)
                return


_FILTERS = (SimpleFilter, Subscriber, Cache, TimeSynchronizer, ApproximateTimeSynchronizer)


def modules(rospy: ModuleType, times: ModuleType) -> dict[str, ModuleType]:
    """Return the module ``message_filters`` of one run by its name.

    Args:
        rospy: Module that filters without a node use.
        times: The module ``rclpy.time``.
    """
    members = {"rospy": rospy, "rclpy_time": times.Time}
    names = {kind.__name__: type(kind.__name__, (kind,), members) for kind in _FILTERS}
    return {"message_filters": library_module("message_filters", names)}
