"""The other end of a pprzlink: which aircraft it is, what it is told, whether its settings are those meant.

pprzlink has no acknowledgements. A setting is answered by its value, everything else shows on the telemetry
or does not.

What has to be repeated to a Paparazzi: sticks, since it misses its transmitter; velocities, since one may
be lost on the way, and the last would stand for ever.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import radians
from typing import Any, NamedTuple

from volery.base.errors import CapabilityError, LinkError, LinkGarbled, LinkSilent
from volery.base.time import MS, Ns, S
from volery.kernel.api import Kernel
from volery.links.link import Frame, Link, ReceiveStatistics
from volery.links.paparazzi_aircraft import PaparazziAircraft, Setting
from volery.links.pprzlink_codec import TO_GROUND
from volery.links.pprzlink_messages import TELEMETRY, entry_value, message_type
from volery.trace.events import LinkState
from volery.vehicles.address import records_texts, system_option
from volery.vehicles.driver import ManualControl
from volery.vehicles.drivers import setpoint_repeater
from volery.vehicles.drivers.paparazzi.decoder import PaparazziDecoder
from volery.vehicles.drivers.paparazzi.modes import AUTO2, GUIDED, KILL_THROTTLE, MODE, NUMBERS, STATUS
from volery.vehicles.telemetry import Telemetry, Velocity

PING_PERIOD: Ns = S
"""A plan may have its aircraft come home when the ground falls silent."""
SILENT_AFTER: Ns = 3 * S
WRONG_ANSWERS = 5
"""So often a setting may have another value than the telemetry shows: that is 0.25 to 2 s late."""

RELATIVE, BODY, RELATIVE_Z, RELATIVE_YAW = 0x01, 0x02, 0x04, 0x08
VELOCITY, VELOCITY_Z, YAW_RATE = 0x20, 0x40, 0x80
"""Flags of GUIDED_SETPOINT_NED; none: a place and a heading."""
BY_VELOCITY = VELOCITY | VELOCITY_Z | YAW_RATE

STICK, THROTTLE = 127, 127
AUTO2_SWITCH = entry_value("RC_4CH", "mode", "AUTO2")
STOP = entry_value("EMERGENCY_CMD", "cmd", "KILL")
COME_DOWN = entry_value("EMERGENCY_CMD", "cmd", "LAND")


class Setpoint(NamedTuple):
    """North, east, down in metres about the local origin and a heading in radians; with the flags
    ``BY_VELOCITY`` metres per second and radians per second, clockwise.
    """

    north: float
    east: float
    down: float
    yaw: float
    flags: int = 0


class PaparazziBackend:
    """Talks to one rotorcraft: the first that speaks, or the one that option ``system_option`` or its XML names."""

    def __init__(
        self, kernel: Kernel, link: Link, name: str, aircraft: PaparazziAircraft, options: Mapping[str, str]
    ) -> None:
        self.telemetry = Telemetry(kernel, name)
        self.hearing = PaparazziDecoder(kernel, self.telemetry, aircraft, record=records_texts(options))
        self.aircraft = aircraft
        self._kernel = kernel
        self._link = link
        self._wanted = system_option(options) or aircraft.system
        self._system = 0
        self._stranger = 0  # another aircraft that is heard
        self._silent = False
        self._mistaken = ""
        self._wrong_answers = 0
        self._checked = {one.name: one for one in (self._find(MODE), self._find(KILL_THROTTLE)) if one}
        self._unchecked = set(self._checked)
        link.receive(self._receive)
        self._ping = kernel.every(PING_PERIOD, self._tick)

    def _find(self, name: str) -> Setting | None:
        return next((one for one in self.aircraft.settings if one.name == name), None)

    # -- hearing

    def _receive(self, frame: Frame) -> None:
        if message_type(frame.name).kind != TELEMETRY or not self._is_ours(frame):
            return
        now = self._kernel.now()
        if self._silent:
            self._silent = False
            self._kernel.record(LinkState(now, self.telemetry.name, "back", "the aircraft is heard again"))
        known = self.hearing.hear(frame.name, frame.fields)
        if frame.name in ("DL_VALUE", STATUS):
            self._check_settings()
        if known:
            self.telemetry.changed.notify()

    def _is_ours(self, frame: Frame) -> bool:
        if self._system:
            return frame.system == self._system
        if self._wanted is not None and frame.system != self._wanted:
            self._stranger = frame.system
            return False
        self._system = frame.system
        return True

    def _tick(self) -> None:
        """Each second: say that we are there, ask for settings not checked yet, notice silence."""
        self._send("PING")
        heard, now = self.telemetry.last_message_ns, self._kernel.now()
        if heard < 0:
            return
        for name in sorted(self._unchecked):
            self._send("GET_SETTING", index=self._checked[name].number, ac_id=self._system)
        if now - heard > SILENT_AFTER and not self._silent:
            self._silent = True
            detail = self._link.problem() or "the aircraft is not heard"
            self._kernel.record(LinkState(now, self.telemetry.name, "silent", detail))

    # -- whether the settings are the ones that are meant

    def _check_settings(self) -> None:
        """Writing a setting under a wrong number could change anything; so what is read must fit first."""
        seen = self.telemetry
        shown = {MODE: NUMBERS.get(seen.mode), KILL_THROTTLE: int(not seen.armed)}
        for name in sorted(self._unchecked):
            number = self._checked[name].number
            answer = self.hearing.values.pop(number, None)
            if answer is None or not seen.mode:
                continue
            if answer[1] == shown[name]:
                self._unchecked.discard(name)
            else:
                self._wrong_answers += 1
                self._suspect(name, number, answer[1])
        if not self._unchecked and not self.hearing.settled:
            self.hearing.settled, self._mistaken = True, ""
            self.hearing.judge_readiness()

    def _suspect(self, name: str, number: int, value: float) -> None:
        if self._wrong_answers >= WRONG_ANSWERS:
            seen = self.telemetry
            shows = f"in {seen.mode}, {'armed' if seen.armed else 'disarmed'}"
            self._mistaken = (
                f"setting {number} of this aircraft is not {name!r} as in {self.aircraft.source}: it is "
                f"{value:g} while it is {shows}; give its own XML: aircraft=var/aircrafts/NAME"
            )

    # -- speaking

    def _send(self, name: str, **fields: Any) -> None:
        self._link.send(Frame(name, fields, TO_GROUND, 0))

    def setting(self, name: str, value: float) -> None:
        """Write it, unless nobody knows yet whether its number is right, or the aircraft has none."""
        found = self._find(name)
        if found is not None and self.hearing.settled:
            self._send("SETTING", index=found.number, ac_id=self._system, value=value)

    def mode(self, mode: str) -> None:
        """Change the mode: directly, and by what the third position of a mode switch means."""
        self.hearing.ask_mode(mode)
        self.setting(AUTO2, NUMBERS[mode])
        self.setting(MODE, NUMBERS[mode])

    def motors(self, on: bool) -> None:
        """Start or stop them."""
        self.hearing.starting = self._kernel.now() if on and self.hearing.settled else None
        self.setting(KILL_THROTTLE, 0.0 if on else 1.0)

    def emergency(self, command: int) -> None:
        """``STOP`` or ``COME_DOWN``."""
        self._send("EMERGENCY_CMD", ac_id=self._system, cmd=command)

    def block(self, name: str) -> None:
        """Go on in another block of the flight plan."""
        self._send("BLOCK", block_id=self.aircraft.block(name).number, ac_id=self._system)

    def setpoint(self, setpoint: Setpoint) -> None:
        """Obeyed in GUIDED only."""
        self._send(
            "GUIDED_SETPOINT_NED",
            ac_id=self._system,
            flags=setpoint.flags,
            x=setpoint.north,
            y=setpoint.east,
            z=setpoint.down,
            yaw=setpoint.yaw,
        )

    def manual_control(self, sticks: ManualControl) -> None:
        """As a transmitter whose mode switch is in the third position; pitch is nose up."""
        self._send(
            "RC_4CH",
            ac_id=self._system,
            mode=AUTO2_SWITCH,
            throttle=round(THROTTLE * sticks.throttle),
            roll=round(STICK * sticks.roll),
            pitch=round(-STICK * sticks.pitch),
            yaw=round(STICK * sticks.yaw),
        )

    # -- the way there

    def problem(self) -> LinkError | CapabilityError | None:
        """Nothing while it is heard and is what it should be; else what is there instead."""
        if self._mistaken:
            return CapabilityError(self._mistaken)
        wrong = self._link.problem()
        if wrong:
            heard = getattr(self._link, "statistics", None)
            garbled = isinstance(heard, ReceiveStatistics) and heard.octets > 0 and not heard.frames
            return LinkGarbled(wrong) if garbled else LinkSilent(wrong)
        if self.telemetry.last_message_ns >= 0:
            return None
        if self._stranger:
            return LinkSilent(f"aircraft {self._stranger} speaks here, not {self._wanted}")
        return LinkSilent("no Paparazzi aircraft was heard")

    def close(self) -> None:
        """No more pings; the link is closed."""
        self._ping.cancel()
        self._link.close()


STICKS_PERIOD: Ns = 100 * MS
VELOCITY_PERIOD: Ns = 250 * MS

STILL = Setpoint(0.0, 0.0, 0.0, 0.0, BY_VELOCITY)


class PaparazziSetpoints(setpoint_repeater.SetpointRepeater):
    """In GUIDED, and in the modes that were asked for."""

    def __init__(self, kernel: Kernel, uplink: PaparazziBackend) -> None:
        super().__init__(
            kernel, uplink.telemetry, GUIDED, velocity_period=VELOCITY_PERIOD, sticks_period=STICKS_PERIOD
        )
        self._uplink = uplink

    def stand_still(self) -> None:
        """A velocity of zero, once."""
        self._uplink.setpoint(STILL)

    def move(self, velocity: Velocity, yaw_rate: float) -> None:
        """A velocity and a turn rate, once."""
        north, east, up = velocity
        self._uplink.setpoint(Setpoint(north, east, -up, radians(yaw_rate), BY_VELOCITY))

    def asked_for(self, mode: str) -> bool:
        """One of ours."""
        return mode in self._uplink.hearing.ours

    def send(self, sticks: ManualControl) -> None:
        """As a transmitter's."""
        self._uplink.manual_control(sticks)
