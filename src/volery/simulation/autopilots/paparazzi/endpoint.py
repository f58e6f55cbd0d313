"""The pprzlink endpoint of a rotorcraft: periodic telemetry on every link, and messages from the ground."""

from __future__ import annotations

from functools import partial
from typing import Any

from volery.base.time import MS, Ns
from volery.kernel.api import Action, Handle
from volery.links.link import Frame, Link
from volery.simulation.autopilots.paparazzi.commands import HANDLERS
from volery.simulation.autopilots.paparazzi.rotorcraft_state import state_of
from volery.simulation.autopilots.paparazzi.telemetry import (
    PERIODIC_MESSAGES,
    PeriodicMessage,
    is_listed,
)
from volery.simulation.autopilots.vehicle_state import Vehicle
from volery.trace.events import Text

ANSWER_DELAY: Ns = 15 * MS
"""Time between the arrival of a message and its effect: recorded 5 to 40 ms."""
PHASE: Ns = 20 * MS
"""Offset between the first messages of two kinds."""
AUTOPILOT = 0
"""Component id of the sender."""


class PaparazziEndpoint:
    """Protocol endpoint of one vehicle."""

    banner = b""
    """Empty: the firmware sends frames only."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._kernel = vehicle.kernel
        self._links: list[Link] = []
        self._clocks: list[Handle] = []
        self._active = False

    # -- links

    def connect(self, link: Link, use: str = "") -> None:
        """Serve a link. All links are equal, whatever their use."""
        del use
        self._links.append(link)
        link.receive(partial(self._receive, link))

    def disconnect(self, link: Link) -> None:
        """Stop serving a link."""
        self._links = [other for other in self._links if other is not link]

    def close(self) -> None:
        """Stop serving all links."""
        self._links.clear()

    # -- periodic messages

    def start(self) -> None:
        """Start periodic telemetry when the firmware is ready, one kind of message after the other."""
        self.stop()
        vehicle = self._vehicle
        ready = max(0, vehicle.rules.startup.ready_after - vehicle.uptime())
        self._after(ready, self._activate)
        for place, periodic in enumerate(PERIODIC_MESSAGES):
            self._after(ready + place * PHASE, partial(self._begin, periodic))

    def _after(self, delay: Ns, action: Action) -> None:
        self._clocks.append(self._kernel.call_at(self._kernel.now() + delay, action))

    def _activate(self) -> None:
        self._active = True

    def _begin(self, periodic: PeriodicMessage) -> None:
        self._clocks.append(self._kernel.every(periodic.period, partial(self._send_periodic, periodic)))

    def _send_periodic(self, periodic: PeriodicMessage) -> None:
        if self._links and is_listed(self._vehicle, periodic.name):
            fields = periodic.build(self._vehicle)
            if fields is not None:
                self.send_event(periodic.name, fields)

    def stop(self) -> None:
        """Stop sending and receiving."""
        for clock in self._clocks:
            clock.cancel()
        self._clocks.clear()
        self._active = False

    # -- sending

    def send_text(self, severity: int, text: str) -> None:
        """Send INFO_MSG on all links and record it."""
        self._kernel.record(Text(self._kernel.now(), self._vehicle.name, severity, text))
        self.send_event("INFO_MSG", {"msg": text})

    def parameter_changed(self, name: str) -> None:
        """Send nothing: settings are sent periodically."""

    def mode_changed(self) -> None:
        """Send nothing: the next ROTORCRAFT_STATUS shows the mode, as recorded."""

    def home_changed(self) -> None:
        """Send nothing: INS_REF is sent periodically."""

    def send_message(self, message: str) -> None:
        """Send a periodic message now."""
        for periodic in PERIODIC_MESSAGES:
            if periodic.name == message:
                self._send_periodic(periodic)

    def send_event(self, message: str, fields: dict[str, Any]) -> None:
        """Send a message on all links."""
        state_of(self._vehicle).downlink_messages += 1
        for link in self._links:
            link.send(Frame(message, fields, self._vehicle.system, AUTOPILOT))

    def after_reply(self, action: Action) -> None:
        """Execute the action at once: the protocol has no acknowledgements."""
        action()

    # -- receiving

    def _receive(self, link: Link, frame: Frame) -> None:
        self._kernel.call_at(self._kernel.now() + ANSWER_DELAY, partial(self._handle, link, frame))

    def _handle(self, link: Link, frame: Frame) -> None:
        if not self._active or link not in self._links:
            return
        state, vehicle = state_of(self._vehicle), self._vehicle
        state.last_uplink_ns = self._kernel.now()
        state.uplink_messages += 1
        handler = HANDLERS.get(frame.name)
        if handler is not None and frame.fields.get("ac_id", vehicle.system) == vehicle.system:
            handler(vehicle, frame.fields)
