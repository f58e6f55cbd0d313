"""rclpy's callback groups: what may run while something else of the group runs."""

from __future__ import annotations

from volery.ros.graph import Group
from volery.ros.graph.group import Work


class CallbackGroup:
    """A node's callbacks that share a rule. Each node that uses it has a queue of its own in it."""

    exclusive = True

    def __init__(self) -> None:
        self._running = 0

    def can_run(self) -> bool:
        """Whether another of its callbacks may start now."""
        return not (self.exclusive and self._running)

    def begin(self) -> None:
        """One of its callbacks starts."""
        self._running += 1

    def end(self) -> None:
        """One of its callbacks has ended."""
        self._running -= 1


class MutuallyExclusiveCallbackGroup(CallbackGroup):
    """One callback at a time."""


class ReentrantCallbackGroup(CallbackGroup):
    """Callbacks may run beside each other, and beside themselves."""

    exclusive = False


class Queue:
    """What is ready of one group of one node."""

    def __init__(self, group: CallbackGroup, ready: Group) -> None:
        self.group, self.ready = group, ready

    def take(self) -> Work:
        """The next one, paid for; the group has begun it."""
        work = self.ready.take()
        self.group.begin()
        return work
