"""What can be sent to a Paparazzi rotorcraft on a pprzlink, and the check of its setting numbers.

pprzlink has no acknowledgements. A setting is answered by its value; the effect of everything else shows in
the telemetry or not at all.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import radians
from typing import Any, NamedTuple

from volery.base.errors import CapabilityError, LinkError, LinkSilent
from volery.base.time import MS, Ns, S
from volery.kernel.api import Kernel
from volery.links.link import Frame, Link
from volery.links.paparazzi_aircraft import PaparazziAircraft, Setting
from volery.links.pprzlink_codec import TO_GROUND
from volery.links.pprzlink_messages import TELEMETRY, entry_value, message_type
from volery.trace.events import LinkState
from volery.vehicles.address import records_texts, system_option
from volery.vehicles.driver import ManualControl, link_error
from volery.vehicles.drivers.paparazzi.decoder import PaparazziDecoder
from volery.vehicles.drivers.paparazzi.modes import AUTO2, GUIDED, KILL_THROTTLE, MODE, NUMBERS, STATUS
from volery.vehicles.drivers.setpoint_repeater import SetpointRepeater
from volery.vehicles.telemetry import Telemetry, Velocity

PING_PERIOD: Ns = S
"""A flight plan may make the aircraft return when the ground station falls silent."""
SILENT_AFTER: Ns = 3 * S
WRONG_ANSWERS = 5
"""Number of times that a setting may differ from the telemetry, which is 0.25 to 2 s late."""
CONTROL_PERIOD: Ns = 100 * MS
VELOCITY_PERIOD: Ns = 250 * MS

RELATIVE, BODY, RELATIVE_Z, RELATIVE_YAW = 0x01, 0x02, 0x04, 0x08
VELOCITY, VELOCITY_Z, YAW_RATE = 0x20, 0x40, 0x80
"""Flags of GUIDED_SETPOINT_NED; without flags a position and a heading."""
BY_VELOCITY = VELOCITY | VELOCITY_Z | YAW_RATE

STICK, THROTTLE = 127, 127
"""Full deflection in RC_4CH."""
AUTO2_SWITCH = entry_value("RC_4CH", "mode", "AUTO2")
STOP = entry_value("EMERGENCY_CMD", "cmd", "KILL")
COME_DOWN = entry_value("EMERGENCY_CMD", "cmd", "LAND")


class Setpoint(NamedTuple):
    """A set-point in GUIDED.

    North, east and down in metres about the local origin and a heading in radians; with the flags
    ``BY_VELOCITY`` metres per second and radians per second, clockwise.
    """

    north: float
    east: float
    down: float
    yaw: float
    flags: int = 0


STILL = Setpoint(0.0, 0.0, 0.0, 0.0, BY_VELOCITY)


class PaparazziBackend:
    """Client of one rotorcraft: the first that is received, or the one in option ``system`` or in its XML.

    Args:
        kernel: clock and record.
        link: link to the aircraft.
        name: name of the vehicle.
        aircraft: definition of the aircraft from its XML.
        options: options of the address.
    """

    def __init__(
        self,
        kernel: Kernel,
        link: Link,
        name: str,
        aircraft: PaparazziAircraft,
        options: Mapping[str, str],
    ) -> None:
        self.telemetry = Telemetry(kernel, name)
        self.decoder = PaparazziDecoder(kernel, self.telemetry, aircraft, record=records_texts(options))
        self.aircraft = aircraft
        self._kernel = kernel
        self._link = link
        self._expected_system = system_option(options) or aircraft.system
        self._system = 0
        self._other_system = 0  # another aircraft that is received
        self._silent = False
        self._wrong_setting = ""
        self._wrong_answers = 0
        self._checked = {one.name: one for one in (self._find(MODE), self._find(KILL_THROTTLE)) if one}
        self._unchecked = set(self._checked)
        link.receive(self._receive)
        self._ping = kernel.every(PING_PERIOD, self._tick)

    def _find(self, name: str) -> Setting | None:
        return next((one for one in self.aircraft.settings if one.name == name), None)

    # -- receiving

    def _receive(self, frame: Frame) -> None:
        if message_type(frame.name).kind != TELEMETRY or not self._is_from_aircraft(frame):
            return
        now = self._kernel.now()
        if self._silent:
            self._silent = False
            self._kernel.record(LinkState(now, self.telemetry.name, "back", "the aircraft is received again"))
        used = self.decoder.handle_message(frame.name, frame.fields)
        if frame.name in ("DL_VALUE", STATUS):
            self._check_settings()
        if used:
            self.telemetry.changed.notify()

    def _is_from_aircraft(self, frame: Frame) -> bool:
        if self._system:
            return frame.system == self._system
        if self._expected_system is not None and frame.system != self._expected_system:
            self._other_system = frame.system
            return False
        self._system = frame.system
        return True

    def _tick(self) -> None:
        """Send a ping, request unchecked settings, and detect silence."""
        self._send("PING")
        last, now = self.telemetry.last_message_ns, self._kernel.now()
        if last < 0:
            return
        for name in sorted(self._unchecked):
            self._send("GET_SETTING", index=self._checked[name].number, ac_id=self._system)
        if now - last > SILENT_AFTER and not self._silent:
            self._silent = True
            detail = self._link.problem() or "the aircraft is not received"
            self._kernel.record(LinkState(now, self.telemetry.name, "silent", detail))

    # -- check of the setting numbers

    def _check_settings(self) -> None:
        """Compare settings with the telemetry: writing under a wrong number could change anything."""
        telemetry = self.telemetry
        shown = {MODE: NUMBERS.get(telemetry.mode), KILL_THROTTLE: int(not telemetry.armed)}
        for name in sorted(self._unchecked):
            number = self._checked[name].number
            answer = self.decoder.values.pop(number, None)
            if answer is None or not telemetry.mode:
                continue
            if answer[1] == shown[name]:
                self._unchecked.discard(name)
                continue
            self._wrong_answers += 1
            if self._wrong_answers >= WRONG_ANSWERS:
                state = f"in {telemetry.mode}, {'armed' if telemetry.armed else 'disarmed'}"
                self._wrong_setting = (
                    f"setting {number} of this aircraft is not {name!r} as in {self.aircraft.source}: it is "
                    f"{answer[1]:g} while it is {state}; give its own XML: aircraft=var/aircrafts/NAME"
                )
        if not self._unchecked and not self.decoder.settings_checked:
            self.decoder.settings_checked, self._wrong_setting = True, ""
            self.decoder.update_ready()

    # -- sending

    def _send(self, name: str, **fields: Any) -> None:
        self._link.send(Frame(name, fields, TO_GROUND, 0))

    def set_setting(self, name: str, value: float) -> None:
        """Write a setting, if the aircraft has it and its number has been checked."""
        found = self._find(name)
        if found is not None and self.decoder.settings_checked:
            self._send("SETTING", index=found.number, ac_id=self._system, value=value)

    def set_mode(self, mode: str) -> None:
        """Change the mode: directly, and as the meaning of the third position of a mode switch."""
        self.decoder.note_commanded(mode)
        self.set_setting(AUTO2, NUMBERS[mode])
        self.set_setting(MODE, NUMBERS[mode])

    def set_motors(self, on: bool) -> None:
        """Start or stop the motors."""
        self.decoder.starting = self._kernel.now() if on and self.decoder.settings_checked else None
        self.set_setting(KILL_THROTTLE, 0.0 if on else 1.0)

    def send_emergency(self, command: int) -> None:
        """Send an emergency command: ``STOP`` or ``COME_DOWN``."""
        self._send("EMERGENCY_CMD", ac_id=self._system, cmd=command)

    def enter_block(self, name: str) -> None:
        """Continue in another block of the flight plan."""
        self._send("BLOCK", block_id=self.aircraft.block(name).number, ac_id=self._system)

    def send_setpoint(self, setpoint: Setpoint) -> None:
        """Send a set-point, which is obeyed in GUIDED only."""
        self._send(
            "GUIDED_SETPOINT_NED",
            ac_id=self._system,
            flags=setpoint.flags,
            x=setpoint.north,
            y=setpoint.east,
            z=setpoint.down,
            yaw=setpoint.yaw,
        )

    def send_manual_control(self, control: ManualControl) -> None:
        """Send RC_4CH, like a transmitter with its mode switch in the third position; pitch is nose up."""
        self._send(
            "RC_4CH",
            ac_id=self._system,
            mode=AUTO2_SWITCH,
            throttle=round(THROTTLE * control.throttle),
            roll=round(STICK * control.roll),
            pitch=round(-STICK * control.pitch),
            yaw=round(STICK * control.yaw),
        )

    # -- link

    def problem(self) -> LinkError | CapabilityError | None:
        """Return what is wrong with the link, or why the aircraft is not supported, as an error to raise."""
        if self._wrong_setting:
            return CapabilityError(self._wrong_setting)
        wrong = self._link.problem()
        if wrong:
            return link_error(self._link, wrong)
        if self.telemetry.last_message_ns >= 0:
            return None
        if self._other_system:
            return LinkSilent(f"aircraft {self._other_system} answers here, not {self._expected_system}")
        return LinkSilent("no message of a Paparazzi aircraft was received")

    def close(self) -> None:
        """Stop the pings and close the link."""
        self._ping.cancel()
        self._link.close()


class PaparazziSetpoints(SetpointRepeater):
    """Repeats velocities in GUIDED, and manual control in the modes that this program commanded."""

    def __init__(self, kernel: Kernel, backend: PaparazziBackend) -> None:
        super().__init__(
            kernel,
            backend.telemetry,
            GUIDED,
            velocity_period=VELOCITY_PERIOD,
            control_period=CONTROL_PERIOD,
        )
        self._backend = backend

    def send_stop(self) -> None:
        """Send a velocity of zero once."""
        self._backend.send_setpoint(STILL)

    def send_velocity(self, velocity: Velocity, yaw_rate: float) -> None:
        """Send a velocity and a turn rate once."""
        north, east, up = velocity
        self._backend.send_setpoint(Setpoint(north, east, -up, radians(yaw_rate), BY_VELOCITY))

    def is_commanded(self, mode: str) -> bool:
        """Return whether *mode* is one of ours."""
        return mode in self._backend.decoder.ours

    def send_control(self, control: ManualControl) -> None:
        """Send manual control like a transmitter."""
        self._backend.send_manual_control(control)
