"""What a node does by itself, whatever graph it is on: its names, its groups, its timers, its time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol, TypeVar

from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.kernel.task import Place
from volery.ros.graph import names
from volery.ros.graph.context import Context, Member
from volery.ros.graph.group import CallbackGroup, Work
from volery.ros.graph.node import Group
from volery.ros.graph.timing import NodeRate, NodeTimer, sleep


class Closes(Protocol):
    """Whatever a node has made and takes with it."""

    def close(self) -> None:
        """It is gone."""


Made = TypeVar("Made", bound=Closes)


class LocalNode:
    """See ``volery.ros.graph.node.Node``; what talks to others is added by each kind of graph."""

    def __init__(
        self, context: Context, name: str, namespace: str, remaps: Mapping[str, str], member: Member
    ) -> None:
        self.name = names.node_name(name, namespace)
        self.namespace = namespace
        self._context = context
        self._member = member
        self._remaps = names.remapping(remaps, namespace, self.name)
        self._groups: list[CallbackGroup] = []
        self._own = self._new_group("callbacks")
        self._made: list[Closes] = []
        self.on_close: Callable[[], None] | None = None

    @property
    def place(self) -> Place:
        """Where its computing is spent."""
        return self._member.place

    @property
    def closed(self) -> bool:
        """Whether it has left the graph."""
        return self._member.closed

    def resolve(self, name: str) -> str:
        """The absolute name, remappings applied."""
        absolute = names.absolute(name, self.namespace, self.name)
        return self._remaps.get(absolute, absolute)

    def _new_group(self, label: str, start: Callable[[Work], None] | None = None) -> CallbackGroup:
        made = CallbackGroup(self._member, label, start)
        self._groups.append(made)
        return made

    def group(self, start: Callable[[Work], None] | None = None) -> CallbackGroup:
        """A new group. With *start* its work waits for no spin: *start* is given it, as house code."""
        return self._new_group(f"callbacks of group {len(self._groups)}", start)

    def _group_of(self, group: Group | None) -> CallbackGroup:
        if group is None:
            return self._own
        if not isinstance(group, CallbackGroup) or group not in self._groups:
            raise UsageError(f"node {self.name}: this group is of another node; make one with group()")
        return group

    def _keep(self, made: Made) -> Made:
        self._made.append(made)
        self._context.changed.notify()
        return made

    def timer(self, period: Ns, callback: Callable[[], None], group: Group | None = None) -> NodeTimer:
        """Call back each *period*."""
        with self._context.kernel:
            self._member.check_open()
            return NodeTimer(self._member, period, callback, self._group_of(group))

    def rate(self, period: Ns) -> NodeRate:
        """Keep the loop of the current task at *period*."""
        return NodeRate(self._member, period)

    def sleep(self, duration: Ns) -> None:
        """Block the current task for *duration*."""
        sleep(self._member, duration)

    def now(self) -> Ns:
        """ROS time."""
        with self._context.kernel:
            return self._context.stamp()

    def spin_once(self, within: Ns | None = None) -> bool:
        """``spin_once`` of the node's own group."""
        return self._own.spin_once(within)

    def spin_available(self) -> None:
        """``spin_available`` of the node's own group."""
        self._own.spin_available()

    def spin(self) -> None:
        """``spin`` of the node's own group."""
        self._own.spin()

    def close(self) -> None:
        """Leave the graph."""
        with self._context.kernel.guard:
            if self._member.closed:
                return
            self._member.closed = True
            for made in self._made:
                made.close()
            for group in self._groups:
                group.wake()
            if self.on_close is not None:
                self.on_close()
            self._context.changed.notify()
