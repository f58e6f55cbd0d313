"""The pprzros bridge as a link to a Paparazzi rotorcraft."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import Any

from volery.base.errors import UsageError
from volery.kernel.api import Kernel
from volery.kernel.waiting import Signal
from volery.links.frame import Frame
from volery.links.link import Receiver
from volery.links.pprzlink_codec import quantised
from volery.links.pprzros_messages import FROM_ROS, PPRZROS_TYPE, TO_ROS, to_frame, to_message
from volery.ros.graph import Node, Work

KEPT = 1000
"""Messages that may wait for the task in each direction; older ones are dropped."""


class PprzrosLink:
    """The pprzros bridge as a link: frames over ``NAMESPACE/pprzros/to_ros`` and ``from_ros``.

    A separate task in the execution context of the commanding node processes received messages and publishes.
    Its execution time is therefore charged there, and set-points and manual control continue while the
    component computes; a velocity that is never ended would last for ever. A computer that is too slow delays
    them. The constructor joins the graph, which takes execution time of the calling task.
    """

    def __init__(self, kernel: Kernel, node: Node, namespace: str) -> None:
        stem = namespace.rstrip("/")
        self.name = f"{stem}/pprzros"
        self._kernel = kernel
        self._node = node
        self._receiver: Receiver | None = None
        self._outgoing: deque[Frame] = deque(maxlen=KEPT)
        self._arrived: deque[Work] = deque(maxlen=KEPT)
        self._due = Signal(kernel, f"messages of {self.name}")
        self._received = False
        self._wrong = ""
        self._closed = False
        self._publisher = node.advertise(f"{stem}/{FROM_ROS}", PPRZROS_TYPE)
        self._spinner = node.group()
        node.subscribe(f"{stem}/{TO_ROS}", PPRZROS_TYPE, self._handle, group=node.group(self._take))
        place = replace(node.context, deadline=None, on_release=None, meter=None)
        kernel.spawn(self._run, f"pprzros link of {node.name}", place, kernel.root.child(self.name))

    # -- as a link

    def send(self, frame: Frame) -> None:
        """Send *frame* as soon as the task runs. Raises ``UsageError`` for an invalid message."""
        if not self._closed:
            self._outgoing.append(quantised(frame))
            self._due.notify()

    def receive(self, receiver: Receiver) -> None:
        """Pass each received frame to *receiver* from now on."""
        self._receiver = receiver

    def problem(self) -> str:
        """Return what is wrong with the link in words; empty if nothing is."""
        if self._closed:
            return "the link was closed"
        if self._received:
            return ""
        return self._wrong or f"no node publishes {self.name}/to_ros; start pprzros, or state its NAMESPACE"

    def close(self) -> None:
        """Stop sending and receiving; the node belongs to its component."""
        self._closed = True
        self._due.notify()

    # -- the task

    def _take(self, work: Work) -> None:
        """Queue a message. Framework callback."""
        self._arrived.append(work)
        self._due.notify()

    def _run(self) -> None:
        while not self._closed and not self._node.closed:
            self._due.wait_for(self._wakes, None)
            if self._arrived:
                self._process()
            while self._outgoing and not self._closed and not self._node.closed:
                self._publisher.publish(to_message(self._outgoing.popleft(), self._node.now()))

    def _wakes(self) -> bool:
        return bool(self._arrived or self._outgoing) or self._closed or self._node.closed

    def _process(self) -> None:
        """Process received messages; all of them are charged as one ``spinOnce``."""
        self._spinner.spin_once(0)
        with self._kernel.guard:
            while self._arrived:
                self._arrived.popleft().run()

    def _handle(self, message: Any) -> None:
        if self._closed or self._receiver is None:
            return
        try:
            frame = to_frame(message)
        except UsageError as error:
            self._wrong = f"messages on {self.name}/to_ros cannot be decoded: {error}"
            return
        self._received = True
        self._receiver(frame)
