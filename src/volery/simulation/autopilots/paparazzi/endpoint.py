"""pprzlink as a vehicle's face: regular telemetry to every link, and an ear for the ground."""

from __future__ import annotations

from functools import partial
from typing import Any

from volery.base.time import MS, Ns
from volery.kernel.api import Action, Handle
from volery.links.link import Frame, Link
from volery.simulation.autopilots.paparazzi.commands import HANDLERS
from volery.simulation.autopilots.paparazzi.rotorcraft_state import state_of
from volery.simulation.autopilots.paparazzi.telemetry import REGULAR, Regular, rotorcraft_status
from volery.simulation.autopilots.vehicle_state import Vehicle
from volery.trace.events import Text

ANSWER_DELAY: Ns = 5 * MS
"""Between a message's arrival and what it does."""
PHASE: Ns = 20 * MS
"""Between the first messages of two kinds."""
AUTOPILOT = 0
"""Component of the sender."""


class PaparazziEndpoint:
    """One vehicle's ``Outlet``, and its ear."""

    banner = b""
    """It says nothing but frames."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._kernel = vehicle.kernel
        self._links: list[Link] = []
        self._clocks: list[Handle] = []
        self._listens = False

    # -- links

    def connect(self, link: Link, use: str = "") -> None:
        """Listen to and speak on this link, too. All links are alike, whatever their *use*."""
        del use
        self._links.append(link)
        link.receive(partial(self._hear, link))

    def disconnect(self, link: Link) -> None:
        """Nobody is there any more."""
        self._links = [other for other in self._links if other is not link]

    def close(self) -> None:
        """Serve nobody any more."""
        self._links.clear()

    # -- the clock

    def start(self) -> None:
        """Regular telemetry begins when the firmware is up, one kind after the other."""
        self.stop()
        vehicle = self._vehicle
        ready = max(0, vehicle.rules.startup.ready_after - vehicle.uptime())
        self._after(ready, self._listen)
        for place, regular in enumerate(REGULAR):
            self._after(ready + place * PHASE, partial(self._begin, regular))

    def _after(self, delay: Ns, action: Action) -> None:
        self._clocks.append(self._kernel.call_at(self._kernel.now() + delay, action))

    def _listen(self) -> None:
        self._listens = True

    def _begin(self, regular: Regular) -> None:
        send = partial(self._send_regular, regular)
        send()
        self._clocks.append(self._kernel.every(regular.period, send))

    def _send_regular(self, regular: Regular) -> None:
        if self._links:
            fields = regular.build(self._vehicle)
            if fields is not None:
                self.send_event(regular.name, fields)

    def stop(self) -> None:
        """Fall silent and deaf."""
        for clock in self._clocks:
            clock.cancel()
        self._clocks.clear()
        self._listens = False

    # -- speaking

    def send_text(self, severity: int, text: str) -> None:
        """INFO_MSG to everyone, and to the trace."""
        self._kernel.record(Text(self._kernel.now(), self._vehicle.name, severity, text))
        self.send_event("INFO_MSG", {"msg": text})

    def parameter_changed(self, name: str) -> None:
        """A setting answers for itself."""

    def mode_changed(self) -> None:
        """ROTORCRAFT_STATUS at once."""
        if self._listens:
            self.send_event("ROTORCRAFT_STATUS", rotorcraft_status(self._vehicle))

    def home_changed(self) -> None:
        """INS_REF comes in its turn."""

    def send_message(self, message: str) -> None:
        """Send that regular message now."""
        for regular in REGULAR:
            if regular.name == message:
                self._send_regular(regular)

    def send_event(self, message: str, fields: dict[str, Any]) -> None:
        """That message to everyone."""
        state_of(self._vehicle).downlink_messages += 1
        for link in self._links:
            link.send(Frame(message, fields, self._vehicle.system, AUTOPILOT))

    def after_reply(self, action: Action) -> None:
        """Nothing is answered: at once."""
        action()

    # -- hearing

    def _hear(self, link: Link, frame: Frame) -> None:
        self._kernel.call_at(self._kernel.now() + ANSWER_DELAY, partial(self._handle, link, frame))

    def _handle(self, link: Link, frame: Frame) -> None:
        if not self._listens or link not in self._links:
            return
        kept, vehicle = state_of(self._vehicle), self._vehicle
        kept.uplink_at = self._kernel.now()
        kept.uplink_messages += 1
        handler = HANDLERS.get(frame.name)
        if handler is not None and frame.fields.get("ac_id", vehicle.system) == vehicle.system:
            handler(vehicle, frame.fields)
