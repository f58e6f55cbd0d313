"""Decoder of a DJI node's topics. One method for each topic.

No topic reports who has the control authority: it follows from the answers to our requests and from the
pilot's mode switch, which takes the authority whenever it is moved. Altitudes are by pressure, tens of metres
off, so only their differences count: to the altitude where the motors started. Without satellites the place
freezes while messages go on, so the place counts only while ``gps_health`` is good.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import degrees, isfinite, nan
from typing import Any

from volery.base.frames import attitude_enu_to_ned, enu_to_ned, quaternion_to_euler
from volery.base.position import AMSL, Position
from volery.base.time import MS, Ns, S
from volery.kernel.api import Kernel
from volery.ros.messages.dji_constants import (
    HEALTHY_GPS,
    M100,
    DisplayMode,
    FlightStatus,
    M100Status,
    display_name,
)
from volery.trace.events import WARNING, Text
from volery.vehicles.drivers.steps import DRONE_KIND
from volery.vehicles.telemetry import (
    PILOT_FLIES,
    PROGRAM_MAY_FLY,
    Attitude,
    Battery,
    StatusText,
    Telemetry,
    Velocity,
    pulse_of,
)

Handler = Callable[[Any], None]

SWITCH_AXIS = 4
"""Axis of the mode switch in ``rc``. Its values differ between aircraft, so only its movements count."""
MILLI = 1000.0
MOST_VOLTS = 100.0
"""A higher voltage is in millivolts."""
UNKNOWN = -1
CONNECTED = 1
"""Value of ``rc_connection_status`` with a transmitter."""
TAKEN_OVER_FOR: Ns = 5 * S
"""Time for which another program counts as in control after set-points were not obeyed."""

STALE: Ns = 300 * MS
"""An older place counts for nothing."""

SETTLED: Ns = 200 * MS
"""Time for which a mode after a landing must be reported before it counts.

On an unreliable link the report that the motors stand may arrive later than that of the mode.
"""

AMSL_REMEDY = (
    "a DJI aircraft reports its altitude by pressure, tens of metres off; state home's altitude, as in "
    "home_altitude=900 among the options of its address, or give AboveHome"
)

WAITS = frozenset({DisplayMode.P_GPS, DisplayMode.ATTITUDE})
"""Modes in which it hovers and accepts commands if the pilot's switch permits."""
_GO_HOME, _TAKE_OFF = DisplayMode.NAVI_GO_HOME.name, DisplayMode.AUTO_TAKEOFF.name
LANDS = frozenset({DisplayMode.AUTO_LANDING, DisplayMode.FORCE_AUTO_LANDING})
DESCENDING_MODES = LANDS | {DisplayMode.NAVI_GO_HOME}
TAKES_OFF = frozenset({DisplayMode.ENGINE_START, DisplayMode.ASSISTED_TAKEOFF, DisplayMode.AUTO_TAKEOFF})


class DjiDecoder:
    """Decodes messages into telemetry, once ``aircraft`` is known: the M100 has its own numbers.

    Stages of a commanded operation keep its name as their mode: the landing at the end of going home is still
    going home, and the start of the motors for a take-off is the take-off.

    Attributes:
        aircraft: type of aircraft; empty until it is known.
        activated: the SDK is activated.
        authority: this program has the control authority.
        commanded: mode commanded last.
        displayed: mode that the aircraft shows, or that its status shows of an M100.
        node_seen: a DJI node publishes.
        positions: number of messages with a position.
        located_at: time of the last position with a good ``gps_health``, ns; -1 before the first.
        home_altitude: stated altitude of home, m AMSL; NaN if it is not stated.

    Args:
        kernel: clock and record.
        telemetry: written by the decoder.
        record: whether texts are recorded.
        home_altitude: see above.
    """

    def __init__(
        self, kernel: Kernel, telemetry: Telemetry, *, record: bool, home_altitude: float = nan
    ) -> None:
        self.home_altitude = home_altitude
        telemetry.amsl_known = isfinite(home_altitude)
        telemetry.amsl_remedy = AMSL_REMEDY
        self.aircraft = ""
        self.activated = False
        self.authority = False
        self.commanded = ""
        self.node_seen = False
        self.positions = 0
        self.displayed = UNKNOWN
        self.located_at: Ns = -1
        self._placed_at: Ns = -1
        self._kernel = kernel
        self._telemetry = telemetry
        self._records = record
        self._display = UNKNOWN
        self._shown = UNKNOWN
        self._shown_since: Ns = 0
        self._status = UNKNOWN
        self._gps_health = 0
        self._place: tuple[float, float] | None = None  # the last with a good gps_health, degrees
        self._altitude = nan  # as reported, by pressure
        self._ground = nan  # the same where the motors started
        self._transmitter = CONNECTED
        self._switch: float | None = None
        self._granted_at: float | None = None  # where the switch was when we were given the authority
        self._taken = ""
        self._taken_at: Ns = 0
        self._motors = False  # of an M100, whose status does not report them
        self._anomalies = 0
        self.gimbal_pitch = nan  # degrees, up positive; once it was subscribed to

    def topics(self, package: str) -> Mapping[str, tuple[str, Handler]]:
        """Return type and handler of each topic."""
        return {
            "flight_status": ("std_msgs/msg/UInt8", self._flight_status),
            "display_mode": ("std_msgs/msg/UInt8", self._display_mode),
            "gps_health": ("std_msgs/msg/UInt8", self._health),
            "gps_position": ("sensor_msgs/msg/NavSatFix", self._position),
            "velocity": ("geometry_msgs/msg/Vector3Stamped", self._velocity),
            "attitude": ("geometry_msgs/msg/QuaternionStamped", self._attitude),
            "rc": ("sensor_msgs/msg/Joy", self._rc),
            "rc_connection_status": ("std_msgs/msg/UInt8", self._rc_connection),
            "battery_state": ("sensor_msgs/msg/BatteryState", self._battery),
            "flight_anomaly": (f"{package}/msg/FlightAnomaly", self._anomaly),
        }

    @property
    def located(self) -> bool:
        """Whether the place is known, to be trusted, and not old."""
        return self.located_at >= 0 and self._kernel.now() - self.located_at <= STALE

    # -- topics

    def take_gimbal(self, message: Any) -> None:
        """Decode ``gimbal_angle``: roll, pitch and yaw in degrees."""
        self.gimbal_pitch = message.vector.y

    def _flight_status(self, message: Any) -> None:
        self.node_seen = True
        landed = self._status == M100Status.FINISHED_LANDING != message.data
        if landed and self.aircraft == M100:
            self._motors = False  # they may turn for a while after the touch-down
        self._status = message.data
        if self.aircraft and (self._display != UNKNOWN or self.aircraft == M100):
            self._telemetry.note_message(self._kernel.now())

    def _display_mode(self, message: Any) -> None:
        now, shown = self._kernel.now(), message.data
        if shown != self._shown:
            self._shown, self._shown_since = shown, now
        comes_down = self._display in DESCENDING_MODES and shown not in DESCENDING_MODES
        if not comes_down or not self._telemetry.armed or now - self._shown_since >= SETTLED:
            self._display = shown

    def _health(self, message: Any) -> None:
        self._gps_health = message.data
        self._telemetry.fix = f"gps health {message.data}"

    def _position(self, message: Any) -> None:
        """Decode the place, if it is to be trusted, and the altitude, which is by pressure.

        The status is always a fix. A place of 0, 0 is none, whatever the altitude.
        """
        self.positions += 1
        latitude, longitude, altitude = message.latitude, message.longitude, message.altitude
        if not (isfinite(latitude) and isfinite(longitude) and isfinite(altitude)):
            return
        if abs(latitude) > 90.0 or abs(longitude) > 180.0:
            return
        if altitude or latitude or longitude:
            self._altitude = altitude
        if (latitude or longitude) and self._gps_health >= HEALTHY_GPS:
            self._place = (latitude, longitude)
            self.located_at = self._kernel.now()

    def _velocity(self, message: Any) -> None:
        vector = message.vector
        north, east, down = enu_to_ned((vector.x, vector.y, vector.z))
        self._telemetry.velocity = Velocity(north, east, -down)

    def _attitude(self, message: Any) -> None:
        q = message.quaternion
        roll, pitch, yaw = quaternion_to_euler(attitude_enu_to_ned((q.w, q.x, q.y, q.z)))
        self._telemetry.attitude = Attitude(degrees(roll), degrees(pitch), degrees(yaw) % 360.0)

    def _battery(self, message: Any) -> None:
        volts, amperes = message.voltage, -message.current
        if volts > MOST_VOLTS:
            volts, amperes = volts / MILLI, amperes / MILLI
        self._telemetry.battery = Battery(message.percentage / 100.0, volts, amperes)

    def _rc(self, message: Any) -> None:
        """Decode sticks and switches; any move of the mode switch takes the authority."""
        axes = [float(axis) for axis in message.axes]
        if len(axes) <= SWITCH_AXIS:
            return
        switch = self._switch = axes[SWITCH_AXIS]
        if self.authority and self._granted_at is None:
            self._granted_at = switch
        if self.authority and switch != self._granted_at:
            self._lose("RC", "the pilot moved the mode switch: the authority is lost")
        elif self._taken == "RC" and switch == self._granted_at:
            self._taken = ""
        at_program = self._granted_at is None or switch == self._granted_at
        shares = [axis / max(1.0, abs(axis)) for axis in axes]  # some switches are in ten-thousandths
        channels = [pulse_of(share) for share in shares]
        channels[SWITCH_AXIS] = PROGRAM_MAY_FLY if at_program else PILOT_FLIES
        if self._transmitter not in {UNKNOWN, CONNECTED}:  # the last values are repeated
            channels = [0] * len(channels)
        self._telemetry.rc, self._telemetry.rc_ns = tuple(channels), self._kernel.now()
        self._telemetry.changed.notify()

    def _rc_connection(self, message: Any) -> None:
        """Tell when the transmitter is lost and when it is back."""
        if message.data == self._transmitter:
            return
        self._transmitter = message.data
        if message.data == CONNECTED:
            self.add_text(WARNING, "the transmitter is received again")
        else:
            self.add_text(
                WARNING,
                "rc failsafe: the transmitter is lost; within 3 s it goes home, or hovers if set so in "
                "Assistant 2, and may no longer obey set-points",
            )

    def _anomaly(self, message: Any) -> None:
        """Add the bits that are newly set as texts."""
        new = message.data & ~self._anomalies
        self._anomalies = message.data
        if not new:
            return
        for name in dir(type(message)):
            value = getattr(type(message), name)
            if name.isupper() and isinstance(value, int) and value & new:
                self.add_text(WARNING, name.replace("_", " ").lower())

    # -- control authority

    def activate(self) -> None:
        """Note that the SDK was activated."""
        self.activated = True

    def granted(self) -> None:
        """Note that we have the authority, until the pilot moves the switch."""
        self.authority = True
        self._granted_at = self._switch
        self._taken = ""

    def not_obeyed(self) -> None:
        """Note that set-points have no effect, so another program must have the authority."""
        self._lose("another program", "set-points are not obeyed: the authority is lost")

    def _lose(self, to: str, text: str) -> None:
        self.authority = False
        self._taken, self._taken_at = to, self._kernel.now()
        self.add_text(WARNING, text)

    def motors(self, on: bool) -> None:
        """Note that an M100 has accepted to start or stop its motors."""
        self._motors = on

    # -- state derived from several topics

    def update(self) -> None:
        """Derive the state after all messages of one time."""
        telemetry = self._telemetry
        if telemetry.last_message_ns < 0:
            return
        if self._taken and self._taken != "RC" and self._kernel.now() - self._taken_at > TAKEN_OVER_FOR:
            self._taken = ""
        telemetry.kind, telemetry.autopilot = DRONE_KIND, f"DJI {self.aircraft}"
        mode = self._update_m100() if self.aircraft == M100 else self._update_others()
        self.displayed = mode
        self._update_home()
        telemetry.armable = self.activated
        healthy = self._gps_health >= HEALTHY_GPS
        telemetry.ready = self.activated and healthy and self.located
        name = self._named(mode)
        by_itself = mode in DESCENDING_MODES and name != self.commanded
        lost_place = telemetry.flying and mode == DisplayMode.ATTITUDE and not healthy
        telemetry.failsafe = bool(telemetry.armed and (by_itself or lost_place))
        telemetry.status = "critical" if telemetry.failsafe else "active" if telemetry.flying else "standby"
        telemetry.mode = f"{name} by {self._taken}" if self._taken and mode not in DESCENDING_MODES else name
        if not telemetry.armed:
            self.commanded = ""

    def _update_others(self) -> int:
        self._telemetry.armed = self._status >= FlightStatus.ON_GROUND
        self._telemetry.flying = self._status >= FlightStatus.IN_AIR
        return self._display

    def _update_m100(self) -> int:
        """Derive the mode, which an M100 does not report, from its status and the commanded mode."""
        telemetry, status = self._telemetry, self._status
        moving = (
            M100Status.TAKING_OFF,
            M100Status.IN_AIR,
            M100Status.LANDING,
            M100Status.FINISHED_LANDING,
        )
        telemetry.armed = self._motors or status in moving
        telemetry.flying = status in (M100Status.IN_AIR, M100Status.LANDING)
        if status == M100Status.TAKING_OFF:
            return DisplayMode.AUTO_TAKEOFF
        if status in (M100Status.LANDING, M100Status.FINISHED_LANDING):
            return DisplayMode.AUTO_LANDING
        commanded = self.commanded if telemetry.flying and self.commanded in DisplayMode.__members__ else ""
        if commanded and commanded != _TAKE_OFF:
            return DisplayMode[commanded]
        return DisplayMode.P_GPS

    def _named(self, mode: int) -> str:
        commanded = self.commanded
        if commanded == _GO_HOME and mode == DisplayMode.AUTO_LANDING:
            return commanded
        if commanded == _TAKE_OFF and mode in TAKES_OFF:
            return commanded
        return display_name(mode) if mode != UNKNOWN else ""

    def _update_home(self) -> None:
        """Update home, where the motors were started, and the height above it.

        Before the motors start home is the present place. In flight it is unknown to a program that has come
        too late, and so is the height.
        """
        telemetry = self._telemetry
        if not telemetry.armed or (not telemetry.flying and not isfinite(self._ground)):
            self._ground = self._altitude
        on_ground = not telemetry.armed and isfinite(self._altitude)
        telemetry.above_home = 0.0 if on_ground else self._altitude - self._ground
        if self._place is None or not isfinite(self._altitude):
            return
        if self.located_at > self._placed_at:
            self._placed_at = self.located_at
            telemetry.update_position(self._at(self._place, self._altitude))
        if not isfinite(self._ground):
            telemetry.home = None
        elif not telemetry.armed or (telemetry.home is None and not telemetry.flying):
            telemetry.home = self._at(self._place, self._ground)

    def _at(self, place: tuple[float, float], altitude: float) -> Position:
        """Return *place* with a reported *altitude*, AMSL as far as home's is stated."""
        known = isfinite(self.home_altitude) and isfinite(self._ground)
        amsl = self.home_altitude + altitude - self._ground if known else altitude
        return Position(*place, AMSL(amsl))

    def add_text(self, severity: int, text: str) -> None:
        """Add a text about the aircraft, which sends none itself."""
        now = self._kernel.now()
        self._telemetry.texts.append(StatusText(now, severity, text))
        if self._records:
            self._kernel.record(Text(now, self._telemetry.name, severity, text))
