"""Publishers and subscriptions of a transport."""

from __future__ import annotations

import threading
from collections import deque
from typing import Any

from volery.base.errors import UsageError
from volery.ros.graph.context import Member
from volery.ros.graph.group import CallbackGroup, Work
from volery.ros.graph.node import Callback, QoS
from volery.ros.messages import message_class
from volery.ros.messages.cdr import copied_to_cdr
from volery.ros.transports.wire import Inlet, Outlet, Parcel
from volery.trace.events import Message, Published, Text

WARNING = 4
"""Severity, as in syslog."""


class TransportPublisher:
    """See ``volery.ros.graph.node.Publisher``."""

    def __init__(self, member: Member, topic: str, message_type: str, outlet: Outlet) -> None:
        self.member = member
        self._class = message_class(message_type)
        self.topic, self.type = topic, self._class.__msgtype__
        self._outlet = outlet
        self._recorded = member.context.records(topic)
        self._open = True

    def publish(self, message: Any) -> None:
        """Send a copy of *message* as it is now."""
        context = self.member.context
        with context.kernel as kernel:
            if not self._open:
                self.member.check_open()
                raise UsageError(f"node {self.member.name}: its publisher of {self.topic} is closed")
            if not isinstance(message, self._class):
                kind = getattr(message, "__msgtype__", "") or f"a {type(message).__name__}"
                raise UsageError(f"topic {self.topic} carries {self.type}, not {kind}")
            data = copied_to_cdr(message.copy())
            if self._recorded:
                context.record(Published(kernel.now(), self.topic, self.type, self.member.name, data))
            self._outlet.send(data)

    def subscribers(self) -> int:
        """How many subscriptions it is connected to."""
        with self.member.context.kernel:
            return self._outlet.connected() if self._open else 0

    def close(self) -> None:
        """Advertise no longer."""
        if self._open:
            self._open = False
            self._outlet.close()


class TransportSubscription:
    """See ``volery.ros.graph.node.Subscription``.

    What arrives waits as bytes, at most as many as the depth of the QoS, and is decoded when its callback
    runs. ``dropped`` counts messages that the full queue gave up, ``garbled`` those that were none.
    """

    inlet: Inlet

    def __init__(
        self, member: Member, topic: str, message_type: str, callback: Callback, group: CallbackGroup
    ) -> None:
        self.member = member
        self.topic, self.type = topic, message_class(message_type).__msgtype__
        self.dropped = self.garbled = 0
        self._callback, self._group = callback, group
        self._queue: deque[Parcel] = deque()
        self._depth: int | None = None
        self._guard = threading.Lock()
        self._announced = False  # the house will look into the queue
        self._works = 0  # pieces of work in the group, one for each parcel that the house has seen
        self._open = True

    def connect(self, inlet: Inlet, qos: QoS) -> None:
        """It hears *inlet* from now on."""
        self.inlet, self._depth = inlet, qos.depth

    def arrive(self, parcel: Parcel) -> None:
        """A message is there. Called by a thread of the client library."""
        with self._guard:
            if not self._open:
                return
            if self._depth is not None and len(self._queue) >= self._depth:
                self._queue.popleft()
                self.dropped += 1
            self._queue.append(parcel)
            if self._announced:
                return
            self._announced = True
        self.member.context.kernel.post(self._admit)

    def _admit(self) -> None:
        context = self.member.context
        now = context.kernel.now()
        with self._guard:
            self._announced = False
            fresh = list(self._queue)[self._works :]
            self._works += len(fresh)
        for parcel in fresh:
            size = len(parcel.data)
            context.record(Message(now, now, self.topic, parcel.publisher, self.member.name, size))
            self._group.add(Work(now, self.run))

    def run(self) -> None:
        """Call back with the oldest message."""
        with self._guard:
            self._works = max(0, self._works - 1)
            if not self._queue:
                return
            parcel = self._queue.popleft()
        try:
            message = parcel.read(parcel.data)
        except UsageError as error:
            self.garbled += 1
            self._warn(f"{self.topic}: a message of {parcel.publisher or 'an unknown node'} dropped: {error}")
            return
        self._callback(message)

    def _warn(self, text: str) -> None:
        with self.member.context.kernel as kernel:
            kernel.record(Text(kernel.now(), self.member.name, WARNING, text))

    def publishers(self) -> int:
        """How many publishers it is connected to."""
        with self.member.context.kernel:
            return self.inlet.connected() if self._open else 0

    def close(self) -> None:
        """Receive no longer; what still waits is forgotten."""
        with self._guard:
            if not self._open:
                return
            self._open = False
            self._queue.clear()
        self.inlet.close()
