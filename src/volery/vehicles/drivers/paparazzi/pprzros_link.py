"""The pprzros bridge as a link: what it publishes arrives here, what it subscribes to is what is sent.

A task of its own, at the place of the node that commands, takes in what has come and publishes what is to go
out. So what that takes is charged there, and set-points and sticks go on while the component computes: a
velocity that nobody ends would stand for ever. A computer that is too slow for it makes it late.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import Any

from volery.base.errors import UsageError
from volery.kernel.api import Kernel
from volery.kernel.waiting import Signal
from volery.links.link import Frame, Receiver
from volery.links.pprzlink_codec import quantised
from volery.links.pprzros_messages import FROM_ROS, TO_ROS, TYPE, to_frame, to_message
from volery.ros.graph import Node, Work

KEPT = 1000
"""Messages that wait for the task, either way; older ones are dropped."""


class PprzrosLink:
    """Frames over ``NAMESPACE/pprzros/to_ros`` and ``from_ros``. Making it joins the graph: it computes."""

    def __init__(self, kernel: Kernel, node: Node, namespace: str) -> None:
        stem = namespace.rstrip("/")
        self.name = f"{stem}/pprzros"
        self._kernel = kernel
        self._node = node
        self._receiver: Receiver | None = None
        self._outgoing: deque[Frame] = deque(maxlen=KEPT)
        self._arrived: deque[Work] = deque(maxlen=KEPT)
        self._due = Signal(kernel, f"messages of {self.name}")
        self._heard = False
        self._wrong = ""
        self._closed = False
        self._publisher = node.advertise(f"{stem}/{FROM_ROS}", TYPE)
        self._spinner = node.group()
        node.subscribe(f"{stem}/{TO_ROS}", TYPE, self._hear, group=node.group(self._take))
        place = replace(node.context, deadline=None, on_release=None, meter=None)
        kernel.spawn(self._run, f"pprzros link of {node.name}", place, kernel.root.child(self.name))

    # -- as a link

    def send(self, frame: Frame) -> None:
        """Goes out as soon as the task has its turn. Raises ``UsageError`` for what is no message."""
        if not self._closed:
            self._outgoing.append(quantised(frame))
            self._due.notify()

    def receive(self, receiver: Receiver) -> None:
        """From now on hand every frame that arrives to *receiver*."""
        self._receiver = receiver

    def problem(self) -> str:
        """What is wrong with the way there, in words."""
        if self._closed:
            return "the link was closed"
        if self._heard:
            return ""
        return self._wrong or f"nobody publishes {self.name}/to_ros; start pprzros, or say where: NAMESPACE"

    def close(self) -> None:
        """Nothing goes out or comes in any more; the node is its owner's."""
        self._closed = True
        self._due.notify()

    # -- the task

    def _take(self, work: Work) -> None:
        """House code."""
        self._arrived.append(work)
        self._due.notify()

    def _run(self) -> None:
        while not self._closed and not self._node.closed:
            self._due.wait_for(self._wakes, None)
            if self._arrived:
                self._take_in()
            while self._outgoing and not self._closed and not self._node.closed:
                self._publisher.publish(to_message(self._outgoing.popleft(), self._node.now()))

    def _wakes(self) -> bool:
        return bool(self._arrived or self._outgoing) or self._closed or self._node.closed

    def _take_in(self) -> None:
        """It is paid as one ``spinOnce``, whatever the number of messages."""
        self._spinner.spin_once(0)
        with self._kernel.guard:
            while self._arrived:
                self._arrived.popleft().run()

    def _hear(self, message: Any) -> None:
        if self._closed or self._receiver is None:
            return
        try:
            frame = to_frame(message)
        except UsageError as error:
            self._wrong = f"what comes on {self.name}/to_ros is not understood: {error}"
            return
        self._heard = True
        self._receiver(frame)
