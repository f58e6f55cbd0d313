"""The pprzlink endpoint of a rotorcraft: periodic telemetry on every link, and messages from the ground.

Nothing is acknowledged: a setting is answered by its value, a moved waypoint by its position; everything else
shows in the telemetry only. EMERGENCY_CMD has no effect and RC_4CH no longer exists in the observed version.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from volery.base.frames import ned_to_enu
from volery.base.time import MS, Ns
from volery.kernel.api import Action, Handle
from volery.links.frame import Frame
from volery.links.link import Link
from volery.simulation.autopilots.paparazzi import modes, parameters, rotorcraft_state
from volery.simulation.autopilots.paparazzi.flight_modes import GuidedMode
from volery.simulation.autopilots.paparazzi.parameters import AUTO1_SWITCH, AUTO2_SWITCH, MANUAL_SWITCH
from volery.simulation.autopilots.paparazzi.rotorcraft_state import (
    FULL,
    PER_COUNT,
    StickFrame,
    bounded,
    state_of,
)
from volery.simulation.autopilots.paparazzi.telemetry import (
    PERIODIC_MESSAGES,
    PeriodicMessage,
    is_listed,
    waypoint,
)
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle
from volery.trace.events import Text

Fields = dict[str, Any]

MANUAL_BELOW, AUTO2_ABOVE = -FULL // 2, FULL // 2
"""Limits of the mode switch."""


def on_ping(vehicle: AutopilotVehicle, _fields: Fields) -> None:
    """Handle PING."""
    vehicle.output.send_event("PONG", {})


def on_setting(vehicle: AutopilotVehicle, fields: Fields) -> None:
    """Handle SETTING: write, and send the new value."""
    value = parameters.write_setting(vehicle, fields["index"], fields["value"])
    vehicle.output.send_event("DL_VALUE", {"index": fields["index"], "value": value})


def on_get_setting(vehicle: AutopilotVehicle, fields: Fields) -> None:
    """Handle GET_SETTING."""
    value = parameters.read_setting(vehicle, fields["index"])
    vehicle.output.send_event("DL_VALUE", {"index": fields["index"], "value": value})


def on_block(vehicle: AutopilotVehicle, fields: Fields) -> None:
    """Handle BLOCK, which changes the block in any mode; only NAV flies it.

    A number beyond the plan means its last block.
    """
    navigation = state_of(vehicle).navigation
    navigation.jump(min(fields["block_id"], len(navigation.plan.blocks) - 1))


def on_move_waypoint(vehicle: AutopilotVehicle, fields: Fields) -> None:
    """Handle MOVE_WP (1e-7 deg, mm AMSL), which is ignored without a local frame."""
    if not vehicle.estimate.position_ok:
        return
    ned = vehicle.flight.to_ned(fields["lat"] / 1e7, fields["lon"] / 1e7, fields["alt"] / 1000.0)
    if state_of(vehicle).navigation.move(fields["wp_id"], ned_to_enu(ned)):
        vehicle.output.send_event("WP_MOVED_ENU", waypoint(vehicle, fields["wp_id"]))


def on_guided(vehicle: AutopilotVehicle, fields: Fields) -> None:
    """Handle GUIDED_SETPOINT_NED: ignored in every mode but GUIDED, and obeyed there whatever it says."""
    manoeuvre = vehicle.manoeuvre
    if isinstance(manoeuvre, GuidedMode):
        manoeuvre.follow(fields["flags"], (fields["x"], fields["y"], fields["z"]), fields["yaw"])


# -- sticks


def on_channels(vehicle: AutopilotVehicle, fields: Fields) -> None:
    """Handle RC_UP: channels roll, pitch, yaw, throttle, mode; a shorter frame is ignored."""
    channels = fields["channels"]
    if len(channels) >= len(StickFrame._fields):
        roll, pitch, yaw, throttle, mode = (PER_COUNT * channel for channel in channels[:5])
        frame = StickFrame(bounded(roll), bounded(pitch), bounded(yaw), bounded(throttle, 0), bounded(mode))
        _receive(vehicle, frame)


def on_joystick(vehicle: AutopilotVehicle, fields: Fields) -> None:
    """Handle JOYSTICK_RAW, with the mode switch at AUTO2."""
    roll, pitch, yaw = (bounded(fields[name]) for name in ("roll", "pitch", "yaw"))
    _receive(vehicle, StickFrame(roll, pitch, yaw, bounded(fields["throttle"], 0), FULL))


def _receive(vehicle: AutopilotVehicle, frame: StickFrame) -> None:
    """Apply a frame of radio control: first the mode switch, then the sticks."""
    state_of(vehicle).radio.receive(vehicle, frame)
    _switch(vehicle, frame.mode)
    if vehicle.armed and vehicle.mode.pilot:
        vehicle.run_manoeuvre()


def _switch(vehicle: AutopilotVehicle, position: int) -> None:
    """Apply the mode switch.

    MANUAL always counts, the other positions not in HOME or FAILSAFE, and NAV not without a GPS fix.
    """
    manual = position < MANUAL_BELOW
    name = MANUAL_SWITCH if manual else AUTO2_SWITCH if position > AUTO2_ABOVE else AUTO1_SWITCH
    wanted = round(vehicle.parameters[name])
    if wanted == modes.NAV and rotorcraft_state.gps_lost(vehicle):
        return
    if manual or vehicle.mode.number not in (modes.HOME, modes.FAILSAFE):
        modes.set_mode(vehicle, wanted)


HANDLERS: Mapping[str, Callable[[AutopilotVehicle, Fields], None]] = {
    "BLOCK": on_block,
    "GET_SETTING": on_get_setting,
    "GUIDED_SETPOINT_NED": on_guided,
    "JOYSTICK_RAW": on_joystick,
    "MOVE_WP": on_move_waypoint,
    "PING": on_ping,
    "RC_UP": on_channels,
    "SETTING": on_setting,
}
"""Handlers by name of the message."""


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

    def __init__(self, vehicle: AutopilotVehicle) -> None:
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
