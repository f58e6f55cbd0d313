"""Playing a recording into a graph, at its own speed or another."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

from volery.base.errors import UsageError, choices, did_you_mean
from volery.base.time import MS, Ns, S, from_seconds
from volery.ros.graph.clock import CLOCK
from volery.ros.graph.node import LATCHED, Node, Publisher, QoS
from volery.ros.messages import new
from volery.ros.messages.bags import Bag

_DEPTH = 100
_CLOCK_PERIOD: Ns = 10 * MS
_LATCHED = frozenset({"/tf_static", "/robot_description", "/map"})
"""Topics that late subscribers get, too, by ROS's own conventions."""


def nothing(played: int, at: Ns) -> None:
    """Tell nobody how far it is."""


@dataclass(frozen=True)
class Playing:
    """How a recording is played.

    ``rate``: recorded seconds per second. ``topics``: only these; ``None``: all that can be read, but for
    what a run says of itself (``/volery/...``). ``after``: begin so many recorded seconds from the start.
    ``clock``: publish the recorded time on ``/clock``. ``delay``: wait so many seconds between advertising
    and the first message, and after the last one, since connecting takes time on a real graph. ``told`` is
    told, for each message, how many have been played and its recorded time.
    """

    rate: float = 1.0
    topics: Collection[str] | None = None
    after: float = 0.0
    clock: bool = False
    delay: float = 0.0
    told: Callable[[int, Ns], None] = nothing

    def __post_init__(self) -> None:
        if not 0.0 < self.rate < float("inf"):
            raise UsageError(f"a rate of {self.rate:g}: give recorded seconds per second, above 0")
        if not 0.0 <= self.delay < float("inf"):
            raise UsageError(f"a delay of {self.delay:g}: give seconds, 0 or more")


def play(node: Node, bag: Bag, how: Playing = Playing()) -> int:
    """Publish what was recorded, in time; blocks until the end. Returns how many messages were published.

    Raises ``UsageError`` for a topic that was not recorded or cannot be read.
    """
    publishers = _advertise(node, bag, how)
    clock = node.advertise(CLOCK, "rosgraph_msgs/msg/Clock", QoS(1)) if how.clock else None
    begin = bag.start + from_seconds(how.after)
    node.sleep(from_seconds(how.delay))
    started = node.now()
    ticked: Ns = begin - _CLOCK_PERIOD
    played = 0
    for recorded in bag.messages(list(publishers)):
        if recorded.at < begin:
            continue
        while clock is not None and ticked + _CLOCK_PERIOD <= recorded.at:
            ticked += _CLOCK_PERIOD
            _wait(node, started, ticked - begin, how.rate)
            clock.publish(_clock(ticked))
        _wait(node, started, recorded.at - begin, how.rate)
        publishers[recorded.topic].publish(recorded.message)
        played += 1
        how.told(played, recorded.at)
    node.sleep(from_seconds(how.delay))
    return played


def _advertise(node: Node, bag: Bag, how: Playing) -> dict[str, Publisher]:
    there = {topic.name: topic.type for topic in bag.topics}
    for name in how.topics or ():
        if name not in there:
            hint = did_you_mean(name, there)
            raise UsageError(f"{bag.path} has no topic {name!r}{hint}; it has {choices(there)}")
        if name in bag.unreadable:
            raise UsageError(f"{bag.path}: {name} cannot be played: {bag.unreadable[name]}")
    wanted = set(bag.usual if how.topics is None else how.topics)
    if how.clock:
        wanted -= {CLOCK}
    return {
        name: node.advertise(name, there[name], LATCHED if name in _LATCHED else QoS(_DEPTH))
        for name in sorted(wanted)
    }


def _wait(node: Node, started: Ns, elapsed: Ns, rate: float) -> None:
    left = started + round(elapsed / rate) - node.now()
    if left > 0:
        node.sleep(left)


def _clock(at: Ns) -> object:
    seconds, rest = divmod(at, S)
    return new("rosgraph_msgs/msg/Clock", clock=new("builtin_interfaces/msg/Time", sec=seconds, nanosec=rest))
