"""Backend for a DJI node: it processes messages, sends set-points, and calls services.

A set-point follows each position, which the node publishes at 50 Hz: so it is computed from the newest one,
and the task wakes once for both.

It runs in separate tasks in the execution context of the commanding node: their execution time is charged
there, they continue while the component computes, and a computer that is too slow delays them.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from enum import IntEnum
from functools import partial
from typing import Any, Final

from volery.base.errors import LinkError, LinkSilent
from volery.base.time import MS, Ns, S
from volery.kernel.api import Action, Kernel
from volery.kernel.task import ExecutionContext
from volery.kernel.waiting import Signal, sleep
from volery.ros.graph import AS_OFFERED, Node, ServiceError, Work
from volery.ros.messages.dji_constants import (
    M100,
    AuthorityAck,
    DisplayMode,
    M100MotorsAck,
    M100TaskAck,
    MissionAck,
    TaskAck,
    ack_name,
)
from volery.trace.events import LinkState
from volery.vehicles.drivers.dji.decoder import DjiDecoder
from volery.vehicles.drivers.dji.node_interfaces import SdkRequests, ServiceRequest
from volery.vehicles.drivers.dji.setpoints import SetpointStream
from volery.vehicles.telemetry import Answer, Telemetry

SETPOINT_PERIOD: Ns = 20 * MS
"""Period of the positions."""
SETPOINT_WITHIN: Ns = 30 * MS
"""Time after which a set-point is sent without a new position."""
ANSWERED_WITHIN: Ns = 60 * S
TASK_ANSWERED_WITHIN: Ns = 600 * S
"""The vehicle node of 4.1 answers a take-off or a landing only when it is finished."""
UPLOADED_WITHIN: Ns = 130 * S
"""The node takes 1 s for a mission and 1 s for each of its 99 waypoints."""
QUIET: Ns = 200 * MS
"""Time after the last set-point from which none is on its way; a later one would end a task."""
CHECK_PERIOD: Ns = S
SILENT_AFTER: Ns = 3 * S
POSITION = "gps_position"
STATE = replace(AS_OFFERED, spacing=100 * MS)
"""QoS of all topics but the position, from which each set-point is computed."""
KEPT = 1000
"""Messages that may wait to be processed; older ones are dropped."""


class SdkAck:
    """Keys of acknowledgements in ``Telemetry.answers``."""

    ACTIVATION: Final = "activation"
    AUTHORITY: Final = "authority"
    REFERENCE: Final = "local reference"
    MOTORS: Final = "motors"
    TASK: Final = "task"
    MISSION: Final = "mission"
    START: Final = "mission start"


def _time_for(key: str) -> Ns:
    """Return the time-out of a request under *key*."""
    return {SdkAck.TASK: TASK_ANSWERED_WITHIN, SdkAck.MISSION: UPLOADED_WITHIN}.get(key, ANSWERED_WITHIN)


def nothing() -> None:
    """Do nothing."""


class DjiBackend:
    """Client of one node. The constructor subscribes and starts its tasks.

    Args:
        kernel: clock, tasks and record.
        node: the node that commands the vehicle.
        name: name of the vehicle.
        interface: topics and services of the DJI node.
        record: whether texts are recorded.
        home_altitude: stated altitude of home, m AMSL; NaN if it is not stated.
    """

    def __init__(
        self,
        kernel: Kernel,
        node: Node,
        name: str,
        interface: SdkRequests,
        *,
        record: bool,
        home_altitude: float,
    ) -> None:
        self.telemetry = Telemetry(kernel, name)
        self.decoder = DjiDecoder(kernel, self.telemetry, record=record, home_altitude=home_altitude)
        self.stream = SetpointStream(kernel, self.telemetry, self.decoder)
        self.interface = interface
        self._kernel = kernel
        self._node = node
        self._wrong = ""
        self._pending: set[str] = set()
        self._arrived: deque[Work] = deque(maxlen=KEPT)
        self._due = Signal(kernel, f"messages of {interface.namespace}")
        self._next: Ns = 0  # when a set-point is sent at the latest
        self._positions = 0  # that set-points have followed
        self._sent_at: Ns = -QUIET
        self._silent = False
        self._closed = False
        self._context: ExecutionContext = replace(node.context, deadline=None, on_release=None, meter=None)
        self._scope = kernel.root.child(f"{name} (DJI)")
        self._spinner = node.group()
        self._inbox = inbox = node.group(self._take)
        self._gimbal_followed = False
        for topic, (kind, handler) in self.decoder.topics(interface.package).items():
            qos = AS_OFFERED if topic == POSITION else STATE
            node.subscribe(f"{interface.namespace}/{topic}", kind, handler, qos, inbox)
        self._spawn(self._run, "DJI node")
        self._spawn(self._identify, "greeting")
        self._watch = kernel.every(CHECK_PERIOD, self._detect_silence)

    def _spawn(self, body: Any, what: str) -> None:
        self._kernel.spawn(body, f"{self.telemetry.name} ({what})", self._context, self._scope)

    # -- receiving

    def _take(self, work: Work) -> None:
        """Queue a message. Framework callback."""
        self._arrived.append(work)
        if len(self._arrived) == 1:
            self._due.notify()

    def _run(self) -> None:
        """Process received messages and send due set-points."""
        while not self._closed and not self._node.closed:
            self._due.wait_for(self._wakes, self._time_left())
            if self._arrived:
                self._process()
            self._send_setpoint()

    def _wakes(self) -> bool:
        return bool(self._arrived) or self._closed or self._node.closed or self.stream.fresh

    def _time_left(self) -> Ns | None:
        return max(0, self._next - self._kernel.now()) if self.stream.wanted else None

    def _process(self) -> None:
        """Process received messages; all of them are charged as one ``spinOnce``."""
        self._spinner.spin_once(0)
        with self._kernel.guard:
            while self._arrived:
                self._arrived.popleft().run()
            self._update()

    def _update(self) -> None:
        if self._silent and self.telemetry.silence(self._kernel.now()) < 1.0:
            self._silent = False
            self._record_link("back", "the aircraft is received again")
        self.decoder.update()
        self.stream.update()
        self.telemetry.changed.notify()

    def _send_setpoint(self) -> None:
        now, positions = self._kernel.now(), self.decoder.positions
        follows = positions != self._positions and now >= self._next - SETPOINT_PERIOD
        if not self.stream.wanted or not (follows or self.stream.fresh or now >= self._next):
            return
        with self._kernel.guard:
            setpoint = self.stream.setpoint()
        self._positions, self._next = positions, now + SETPOINT_WITHIN
        if setpoint is None:
            return
        try:
            self.interface.setpoint(*setpoint)
        except ServiceError as error:
            self._wrong = str(error)
        self._sent_at = self._kernel.now()

    @property
    def quiet(self) -> bool:
        """Whether no set-point is sent or on its way."""
        return not self.stream.wanted and self._kernel.now() - self._sent_at >= QUIET

    def wake(self) -> None:
        """Send a changed set-point at once. Framework callback."""
        self._due.notify()

    def _detect_silence(self) -> None:
        last, now = self.telemetry.last_message_ns, self._kernel.now()
        if last >= 0 and now - last > SILENT_AFTER and not self._silent:
            self._silent = True
            self._record_link("silent", "the aircraft is not received")

    def _record_link(self, what: str, detail: str) -> None:
        self._kernel.record(LinkState(self._kernel.now(), self.telemetry.name, what, detail))

    # -- identification

    def _identify(self) -> None:
        """Request the type of aircraft, on which the meaning of its numbers depends."""
        if self.interface.activation() is None:
            self.decoder.activate()
        ask = self.interface.version()
        while not self._closed:
            if ask.client.wait(S):
                try:
                    response = ask.client.call(ask.request, within=S)
                except ServiceError as error:
                    self._wrong = str(error)
                else:
                    self._wrong = ""
                    self.decoder.aircraft = self.interface.aircraft(response)
                    break
                sleep(self._kernel, S)
        with self._kernel.guard:
            self._update()

    # -- requests

    def request(self, key: str, ask: ServiceRequest | None, accepted: Action = nothing) -> None:
        """Call a service without blocking; the answer arrives in the telemetry.

        Args:
            key: key of the answer in ``Telemetry.answers``.
            ask: the request; ``None`` sends nothing.
            accepted: called before the answer is stored, if it is positive.
        """
        if ask is None or key in self._pending:
            return
        self._pending.add(key)
        self._spawn(partial(self._request, key, ask, accepted), key)

    def _request(self, key: str, ask: ServiceRequest, accepted: Action) -> None:
        try:
            response = ask.client.call(ask.request, within=_time_for(key))
        except ServiceError as error:
            with self._kernel.guard:
                self._pending.discard(key)
                if error.by_server:  # the way in which the node of 4.1 refuses
                    self._answered(key, False, None)
                else:
                    self._wrong = str(error)
            return
        with self._kernel.guard:
            self._pending.discard(key)
            self._wrong = ""
            if response.result:
                accepted()
            self._answered(key, bool(response.result), getattr(response, "ack_data", None))

    def _answered(self, key: str, accepted: bool, code: int | None) -> None:
        result = "accepted" if accepted else "refused"
        if code is not None and not accepted:
            meaning = ack_name(self._codes(key), code)
            result = f"refused with {code}, {meaning}" if meaning else f"refused with {code}"
        self.telemetry.answers[key] = Answer(self._kernel.now(), accepted, result)
        self._update()

    def _codes(self, key: str) -> type[IntEnum]:
        """Return the meaning of ``ack_data`` in the answers under *key*."""
        if key == SdkAck.AUTHORITY:
            return AuthorityAck
        if key in (SdkAck.MISSION, SdkAck.START):
            return MissionAck
        if self.is_m100:
            return M100MotorsAck if key == SdkAck.MOTORS else M100TaskAck
        return TaskAck

    @property
    def is_busy(self) -> bool:
        """Whether the node of 4.1 is in a take-off or a landing, and answers nothing else until its end."""
        return self.interface.blocks and SdkAck.TASK in self._pending

    def activate(self) -> None:
        """Activate the SDK where the node does not by itself."""
        self.request(SdkAck.ACTIVATION, self.interface.activation(), self.decoder.activate)

    def authority(self) -> None:
        """Obtain the control authority."""
        self.request(SdkAck.AUTHORITY, self.interface.authority(True), self.decoder.granted)

    def motors(self, on: bool, *, force: bool = False) -> None:
        """Start or stop the motors; *force* stops them in the air, too."""
        ask = self.interface.kill() if force else self.interface.motors(on)
        self.request(SdkAck.MOTORS, ask, partial(self.decoder.motors, on))

    def task(self, task: int, mode: DisplayMode) -> None:
        """Start a task that enters *mode*; set-points, which would end it, are stopped."""
        self.stream.stop()
        self.decoder.commanded = mode.name
        self.request(SdkAck.TASK, self.interface.task(task))

    def follow_gimbal(self) -> None:
        """Subscribe to the angles of the gimbal, at its first use: few aircraft carry one."""
        if not self._gimbal_followed:
            self._gimbal_followed = True
            topic = f"{self.interface.namespace}/gimbal_angle"
            kind = "geometry_msgs/msg/Vector3Stamped"
            self._node.subscribe(topic, kind, self.decoder.take_gimbal, STATE, self._inbox)

    # -- the end

    def problem(self) -> LinkError | None:
        """Return what is wrong with the link, as an error to raise."""
        if self._wrong:
            return LinkSilent(self._wrong)
        if self.telemetry.last_message_ns >= 0:
            return None
        below = self.interface.namespace
        if self.decoder.node_seen:
            return LinkSilent(f"the node at {below} does not report which aircraft it serves")
        return LinkSilent(f"no DJI node publishes {below}/flight_status")

    @property
    def is_m100(self) -> bool:
        """Whether it is a Matrice 100, which has fewer topics and other numbers."""
        return self.decoder.aircraft == M100

    def close(self) -> None:
        """Stop commanding; the node belongs to its component."""
        self.stream.stop()
        self._closed = True
        self._watch.cancel()
        self._due.notify()
        self._kernel.cancel(self._scope, "the driver was closed")
