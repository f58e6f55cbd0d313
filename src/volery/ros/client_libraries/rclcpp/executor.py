"""The executors of rclcpp: they run the callbacks of nodes, those first that became ready first."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from volery.base.time import Ns
from volery.kernel.waiting import current_task, end_activation
from volery.ros.client_libraries.rclcpp.session import CallbackQueue, RosNode, Session


class ExecutorError(Exception):
    """A use of an executor that rclcpp refuses, too."""


class Executor:
    """Runs callbacks of its nodes in the tasks that spin it."""

    def __init__(self, session: Session) -> None:
        self._session, self._kernel = session, session.kernel
        self._nodes: list[RosNode] = []
        self._queues: list[CallbackQueue] = []
        self._known: list[CallbackQueue] | None = None  # all groups, until one comes or goes
        self._helpers = 0
        self._cancelled = False
        self.spinning = False

    def changed(self) -> None:
        """Look for the groups of all nodes again."""
        self._known = None
        self._session.ready.notify()

    def add(self, node: RosNode) -> None:
        """Spin *node* as well; raise ``ExecutorError`` if an executor has it already."""
        if node.executor is not None:
            raise ExecutorError(f"Node '{node.node.name}' has already been added to an executor.")
        node.executor = self
        self._nodes.append(node)
        self.changed()

    def remove(self, node: RosNode) -> None:
        """Stop spinning *node*."""
        if node not in self._nodes:
            raise ExecutorError("Node needs to be associated with this executor.")
        self._nodes.remove(node)
        node.executor = None
        self.changed()

    def add_queue(self, queue: CallbackQueue) -> None:
        """Run the callbacks of a group as well."""
        self._queues.append(queue)
        self.changed()

    def remove_queue(self, queue: CallbackQueue) -> None:
        """Stop running the callbacks of a group."""
        self._queues.remove(queue)
        self.changed()

    def cancel(self) -> None:
        """Let the tasks that spin return."""
        self._cancelled = True
        self._session.ready.notify()

    def close(self) -> None:
        """Release all nodes."""
        self.cancel()
        for node in list(self._nodes):
            self.remove(node)

    # -- spinning

    def spin(self) -> None:
        """Run callbacks until the component shuts down or the executor is cancelled."""
        self._begin("spin")
        try:
            self.help()
        finally:
            self.spinning = False

    def help(self) -> None:
        """Run callbacks beside the task that spins, as long as it does."""
        self._helpers += 1
        try:
            while self.spinning and self._session.running and not self._cancelled:
                self._run_next(None)
        finally:
            self._helpers -= 1

    def spin_once(self, within: Ns | None) -> None:
        """Wait for a callback and run it."""
        self._begin("spin_once")
        try:
            self._run_next(within)
        finally:
            self.spinning = False

    def spin_ready(self, longest: Ns, *, until_none: bool) -> None:
        """Run the callbacks that are ready now, or *until_none* is, for *longest* ns at most; 0: all."""
        self._begin("spin_all" if until_none else "spin_some")
        end = self._kernel.now() + longest if longest else None
        left = None if until_none else {one: count for one in self._all() if (count := len(one.ready))}
        try:
            while left != {} and self._session.running and not self._cancelled:
                if end is not None and self._kernel.now() >= end:
                    return
                queue = self._next(left)
                if queue is None:
                    return
                if left is not None:
                    left[queue] -= 1
                    if not left[queue]:
                        del left[queue]
                with self._kernel.interact():
                    work = queue.ready.take()
                self._run(queue, work.run)
        finally:
            self.spinning = False

    def _begin(self, how: str) -> None:
        if self.spinning:
            raise ExecutorError(f"{how}() called while already spinning")
        self.spinning, self._cancelled = True, False

    def _all(self) -> list[CallbackQueue]:
        if self._known is None:
            own = [queue for node in self._nodes for queue in node.queues if queue.automatic]
            self._known = [*own, *self._queues]
        return self._known

    def _next(self, left: Mapping[CallbackQueue, int] | None = None) -> CallbackQueue | None:
        """Return the group whose next callback has been ready longest, of those that have some *left*."""
        best, since = None, 0
        for queue in self._all() if left is None else left:
            oldest = queue.ready.oldest
            if oldest is not None and queue.may_run() and (best is None or oldest < since):
                best, since = queue, oldest
        return best

    def _run_next(self, within: Ns | None) -> None:
        """Wait for a callback that may run, and run it."""
        found: CallbackQueue | None = None

        def ready() -> bool:
            nonlocal found
            found = self._next()
            return found is not None or self._cancelled or not self._session.running or not self.spinning

        kernel = self._kernel
        with kernel.interact():
            if within == 0:
                found = self._next()
            else:
                end_activation(kernel)
                self._session.ready.wait_for(ready, within)
            work = None if found is None else found.ready.take()
            if within != 0:
                current_task(kernel).release(kernel.now() if work is None else work.arrived)
        if found is not None and work is not None:
            self._run(found, work.run)

    def _run(self, queue: CallbackQueue, run: Callable[[], None]) -> None:
        queue.running = True
        try:
            run()
        finally:
            queue.running = False
            if self._helpers > 1:  # another task may run what this one has kept from running
                self._session.ready.notify()
