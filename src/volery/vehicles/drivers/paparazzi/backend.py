"""What can be sent to a Paparazzi rotorcraft over pprzlink, or over the pprzros bridge as a link.

pprzlink has no acknowledgements. A setting is answered by its value; the effect of everything else shows in
the telemetry or not at all.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from volery.base.errors import CapabilityError, LinkError, LinkSilent
from volery.base.time import Ns, S
from volery.kernel.api import Kernel
from volery.links.frame import Frame
from volery.links.link import Link
from volery.links.paparazzi_aircraft import AircraftSetting, PaparazziAircraft
from volery.links.pprzlink_codec import (
    TO_GROUND,
)
from volery.links.pprzlink_messages import TELEMETRY, entry_value, message_type
from volery.trace.events import LinkState
from volery.vehicles.address import records_texts, system_option
from volery.vehicles.driver import ManualControl, link_error
from volery.vehicles.drivers.paparazzi.decoder import (
    AUTO2,
    CHANGE,
    KILL_THROTTLE,
    MODE,
    NUMBERS,
    STATUS,
    PaparazziDecoder,
)
from volery.vehicles.telemetry import Answer, Telemetry

PING_PERIOD: Ns = S
"""A flight plan may make the aircraft return when the ground station falls silent."""
SILENT_AFTER: Ns = 3 * S
WRONG_ANSWERS = 5
"""Number of times that a setting may differ from the telemetry, which is 0.25 to 2 s late."""

RELATIVE, BODY, RELATIVE_Z, RELATIVE_YAW = 0x01, 0x02, 0x04, 0x08
VELOCITY, VELOCITY_Z, YAW_RATE = 0x20, 0x40, 0x80
"""Flags of GUIDED_SETPOINT_NED; without flags a position and a heading."""
BY_VELOCITY = VELOCITY | VELOCITY_Z | YAW_RATE

FULL = 127
"""Full deflection in RC_UP."""
SWITCHES = (FULL, FULL, 0, 0, 0, 0, 0)
"""Channels of RC_UP behind the sticks: mode switch in its third position, kill switch off, others centred."""
REFUSALS = 2
"""Answers with another mode that are a refusal: one may have been sent before the command arrived."""
STOP = entry_value("EMERGENCY_CMD", "cmd", "KILL")
COME_DOWN = entry_value("EMERGENCY_CMD", "cmd", "LAND")


class PprzSetpoint(NamedTuple):
    """A set-point in GUIDED.

    North, east and down in metres about the local origin and a heading in radians; with the flags
    ``BY_VELOCITY`` metres per second and radians per second, clockwise.
    """

    north: float
    east: float
    down: float
    yaw: float
    flags: int = 0


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
        self._settings: Mapping[str, AircraftSetting] = {
            name: aircraft.setting(name) for name in (AUTO2, KILL_THROTTLE, MODE)
        }
        self._unchecked = {KILL_THROTTLE, MODE}
        self._identified = not aircraft.fingerprint
        self._commanded_mode = ""  # until it is confirmed or refused
        self._refusals = 0
        link.receive(self._receive)
        self._ping = kernel.every(PING_PERIOD, self._tick)

    # -- receiving

    def _receive(self, frame: Frame) -> None:
        if message_type(frame.name).kind != TELEMETRY or not self._is_from_aircraft(frame):
            return
        now = self._kernel.now()
        if self._silent:
            self._silent = False
            self._kernel.record(LinkState(now, self.telemetry.name, "back", "the aircraft is received again"))
        used = self.decoder.handle_message(frame.name, frame.fields)
        if frame.name == "ALIVE":
            self._identify(tuple(frame.fields["md5sum"]))
        if frame.name == "DL_VALUE":
            self._answer_change(frame.fields["index"], frame.fields["value"])
        if frame.name in ("DL_VALUE", "ALIVE", STATUS):
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
            self.request_setting(self._settings[name])
        if now - last > SILENT_AFTER and not self._silent:
            self._silent = True
            detail = self._link.problem() or "the aircraft is not received"
            self._kernel.record(LinkState(now, self.telemetry.name, "silent", detail))

    # -- check of the setting numbers

    def _identify(self, fingerprint: tuple[int, ...]) -> None:
        """Compare the checksum in ALIVE with that of the description, where this has one."""
        if not self.aircraft.fingerprint:
            return
        self._identified = fingerprint == self.aircraft.fingerprint
        if not self._identified:
            self.decoder.settings_checked = False
            self._wrong_setting = (
                f"this aircraft is not {self.aircraft.source}: the numbers of its settings and blocks are "
                f"not known; give its own XML: aircraft=var/aircrafts/NAME"
            )

    def _check_settings(self) -> None:
        """Compare settings with the telemetry: writing under a wrong number could change anything."""
        telemetry = self.telemetry
        shown = {MODE: NUMBERS.get(telemetry.mode), KILL_THROTTLE: int(not telemetry.armed)}
        for name in sorted(self._unchecked):
            number = self._settings[name].number
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
        if not self._unchecked and self._identified and not self.decoder.settings_checked:
            self.decoder.settings_checked, self._wrong_setting = True, ""
            self.decoder.update_ready()

    # -- sending

    def _send(self, name: str, **fields: Any) -> None:
        self._link.send(Frame(name, fields, TO_GROUND, 0))

    def wrong_setting(self) -> str:
        """Return why nothing may be written to this aircraft; empty if nothing is known against it."""
        return self._wrong_setting

    def set_setting(self, name: str, value: float) -> None:
        """Write a setting, if its number has been checked."""
        if self.decoder.settings_checked:
            self.write_setting(self._settings[name], value)

    def write_setting(self, setting: AircraftSetting, value: float) -> None:
        """Write any setting; it is answered by its value."""
        self._send("SETTING", index=setting.number, ac_id=self._system, value=value)

    def request_setting(self, setting: AircraftSetting) -> None:
        """Request the value of a setting."""
        self._send("GET_SETTING", index=setting.number, ac_id=self._system)

    def set_mode(self, mode: str) -> None:
        """Change the mode: directly, and as the meaning of the third position of a mode switch."""
        self.decoder.note_commanded(mode)
        self._commanded_mode, self._refusals = mode, 0
        self.set_setting(AUTO2, NUMBERS[mode])
        self.set_setting(MODE, NUMBERS[mode])

    def _answer_change(self, index: int, value: float) -> None:
        """Take the value of 'mode' as the answer to a change; a transmitter's switch may still follow."""
        if not self._commanded_mode or index != self._settings[MODE].number:
            return
        now = self._kernel.now()
        if value == NUMBERS[self._commanded_mode]:
            self.telemetry.answers[CHANGE] = Answer(now, True, self._commanded_mode)
            self._commanded_mode = ""
            return
        if self.decoder.transmitter:
            return
        self._refusals += 1
        if self._refusals < REFUSALS:
            self.set_setting(MODE, NUMBERS[self._commanded_mode])
            return
        kept = next((name for name, number in NUMBERS.items() if number == value), f"{value:g}")
        self.telemetry.answers[CHANGE] = Answer(now, False, f"it stays in {kept}")
        self._commanded_mode = ""

    def set_motors(self, on: bool) -> None:
        """Start or stop the motors."""
        self.decoder.starting = self._kernel.now() if on and self.decoder.settings_checked else None
        self.set_setting(KILL_THROTTLE, 0.0 if on else 1.0)

    def send_emergency(self, command: int) -> None:
        """Send an emergency command: ``STOP`` or ``COME_DOWN``."""
        self._send("EMERGENCY_CMD", ac_id=self._system, cmd=command)

    def enter_block(self, name: str) -> None:
        """Continue in another block of the flight plan, if its number is known to be right."""
        if self.decoder.settings_checked:
            self._send("BLOCK", block_id=self.aircraft.block(name).number, ac_id=self._system)

    def send_setpoint(self, setpoint: PprzSetpoint) -> None:
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
        """Send RC_UP, like a transmitter with its mode switch in the third position; pitch is nose up."""
        sticks = (control.roll, -control.pitch, control.yaw, control.throttle)
        channels = (*(round(FULL * stick) for stick in sticks), *SWITCHES)
        self._send("RC_UP", ac_id=self._system, channels=channels)

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
