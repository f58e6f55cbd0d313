"""What all parts of one embedded graph share: the kernel, the two functions from above, and who is there.

Parameters: one tree of values. A node's own are those below its name.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from volery.base.errors import UsageError, did_you_mean
from volery.base.time import MS, US, Ns, S
from volery.kernel.api import Action, Kernel
from volery.kernel.task import ExecutionContext
from volery.kernel.waiting import Signal
from volery.ros.graph.interface import NodeId, Price, Routing
from volery.ros.messages import Message, from_cdr, to_cdr
from volery.trace.events import Charge, Record, ignore

if TYPE_CHECKING:
    from volery.ros.graph.services import EmbeddedService
    from volery.ros.graph.topics import Topic


class Parameters:
    """Values by absolute name; a namespace reads as a ``dict`` of what is below it."""

    def __init__(self) -> None:
        self._tree: dict[str, Any] = {}

    @staticmethod
    def _steps(name: str) -> list[str]:
        return [step for step in name.split("/") if step]

    def has(self, name: str) -> bool:
        """Whether there is such a parameter or namespace."""
        try:
            self.get(name)
        except UsageError:
            return False
        return True

    def get(self, name: str) -> Any:
        """A copy of the value, or ``UsageError``."""
        value: Any = self._tree
        for step in self._steps(name):
            if not isinstance(value, dict) or step not in value:
                hint = did_you_mean(name, self.names())
                raise UsageError(f"no parameter {name!r}{hint}")
            value = value[step]
        return deepcopy(value)

    def set(self, name: str, value: Any) -> None:
        """Set a value; a ``dict`` replaces a whole namespace."""
        *path, last = self._steps(name) or [""]
        if not last:
            raise UsageError("the root of the parameters cannot be set; name a parameter")
        branch = self._tree
        for step in path:
            inner = branch.get(step)
            if not isinstance(inner, dict):
                inner = branch[step] = {}
            branch = inner
        branch[last] = deepcopy(value)

    def delete(self, name: str) -> None:
        """Remove a value or a namespace; ``UsageError`` if there is none."""
        self.get(name)
        *path, last = self._steps(name)
        branch = self._tree
        for step in path:
            branch = branch[step]
        del branch[last]

    def names(self) -> list[str]:
        """The absolute names of all parameters, sorted."""
        return sorted(_leaves("", self._tree))


def _leaves(prefix: str, branch: dict[str, Any]) -> Iterator[str]:
    for step, value in branch.items():
        if isinstance(value, dict):
            yield from _leaves(f"{prefix}/{step}", value)
        else:
            yield f"{prefix}/{step}"


Records = Callable[[str], bool]
"""Whether the content of a topic's messages is recorded, by the topic's name."""


@dataclass(eq=False)
class GraphContext:
    """One graph, seen by its members. ``changed`` is notified whenever somebody comes or goes.

    ``unrecorded``: nothing of it goes to the stream of events. ``as_bytes``: what is sent has made the trip
    through its bytes.
    """

    kernel: Kernel
    price: Price
    between: Routing
    records: Records
    epoch: Ns
    changed: Signal
    listen_to_clock: Callable[[], None] = lambda: None
    parameters: Parameters = field(default_factory=Parameters)
    topics: dict[str, Topic] = field(default_factory=dict)
    services: dict[str, EmbeddedService] = field(default_factory=dict)
    unrecorded: bool = False
    as_bytes: bool = False

    @property
    def record(self) -> Record:
        """The stream that events go to."""
        return ignore if self.unrecorded else self.kernel.record

    def sent(self, message: Message) -> Message:
        """A copy of *message*, as it is sent."""
        if not self.as_bytes:
            copied: Message = message.copy()
            return copied
        arriving: Message = from_cdr(message.__msgtype__, to_cdr(message))
        return arriving

    def bring(
        self, sender: NodeContext, receiver: NodeContext, size: int, deliver: Action, lost: Action
    ) -> None:
        """Bring a request or an answer from node to node, reliably."""
        way = self.between(sender.id, receiver.id)
        if way is None:
            deliver()
        else:
            way(size, True, deliver, lost)

    def stamp(self) -> Ns:
        """ROS time, without being an interaction point."""
        return self.epoch + self.kernel.now()


KEEP_UP: Ns = S
"""How often a node pays for the time that it neither sleeps nor calls."""

AWAKE: Ns = MS
"""For so long after it has sent or received something a node's threads, and its caches, are still warm."""

_CALLS = ("publish", "sleep", "spin_once")
_KINDS = {call: f"ros:{call}" for call in _CALLS}
"""What is charged often, so that its text is made once."""


class NodeContext:
    """A node as its publishers, subscriptions and so on see it: who they act for, and who pays."""

    __slots__ = ("_awake", "_free", "_since", "_slept", "_waited", "closed", "context", "id", "name", "place")

    def __init__(self, context: GraphContext, name: str, place: ExecutionContext) -> None:
        processor = place.processor.name if place.processor else ""
        self.context = context
        self.id = NodeId(name, place.component, processor)
        self.name = name
        self.place = place
        self._free = context.unrecorded and place.processor is None  # nobody executes it, nobody sees it
        self.closed = False
        self._since = context.kernel.now()
        self._awake: Ns = -AWAKE
        self._slept = self._waited = 0.0

    def pay(self, call: str, x: float = 0.0) -> None:
        """Price a call and have it executed: the caller's part before this returns, the rest beside it.

        House code cannot wait: there all of it goes to the background.
        """
        if self._free:
            return
        context = self.context
        kernel = context.kernel
        who = self.id
        cost = context.price(who, self._priced_as(call), x)
        caller, background = cost.caller, cost.background
        if call == "sleep":
            self._slept += x
        kind = _KINDS.get(call) or f"ros:{call}"
        if not context.unrecorded:
            kernel.record(Charge(kernel.now(), who.component, who.processor, kind, caller, background, 0.0))
        if kernel.current() is None:
            background += caller
        elif caller:
            kernel.consume(caller)
        if background and self.place.processor is not None:
            self.place.processor.load(self.place, background)

    def _priced_as(self, call: str) -> str:
        """Sending wakes the client library's threads, unless they are awake."""
        if call != "publish":
            return call
        now = self.context.kernel.now()
        awake = now - self._awake < AWAKE
        self._awake = now
        return "publish_next" if awake else call

    def bear(self, what: str, x: float = 0.0) -> None:
        """Have executed what happens to the node beside its calls; nothing where that has no price."""
        context, who = self.context, self.id
        if self.place.processor is None:
            return
        if what == "receive":
            self._awake = context.kernel.now()
        cost = context.price(who, what, x)
        background = cost.caller + cost.background
        if not background:
            return
        if not context.unrecorded:
            now = context.kernel.now()
            context.kernel.record(
                Charge(now, who.component, who.processor, f"ros:{what}", 0, background, 0.0)
            )
        self.place.processor.load(self.place, background)

    def keep_up(self) -> None:
        """Keep the client library's threads going where the node does not sleep: what a sleep costs
        contains that.
        """
        placed = self.place.processor is not None
        if placed and self.context.price(self.id, "wait", KEEP_UP / US).background:
            self.context.kernel.every(KEEP_UP, self._wait)

    def _wait(self) -> None:
        if self.closed:
            return
        lived = (self.context.kernel.now() - self._since) / US
        waited = lived - self._slept - self._waited
        if waited > 0.0:
            self._waited += waited
            self.bear("wait", waited)

    def check_open(self) -> None:
        """``UsageError`` if the node has left the graph."""
        if self.closed:
            raise UsageError(f"node {self.name} has left the graph")
