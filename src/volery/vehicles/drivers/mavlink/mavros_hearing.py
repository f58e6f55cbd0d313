"""What MAVROS's topics say, as ``Telemetry``. One method for each topic that is listened to."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import nan
from typing import Any

from volery.base.frames import enu_to_ned
from volery.base.geoid import Geoid
from volery.base.position import AMSL, Position
from volery.base.time import Ns
from volery.kernel.api import Kernel
from volery.links.mavlink import entry_name
from volery.vehicles.drivers.mavlink.vocabulary import ACTIVE, FAILSAFE, ON_GROUND, UNDEFINED
from volery.vehicles.telemetry import Battery, Said, Telemetry, Velocity

NO_FIX = -1

Handler = Callable[[Any], None]


class MavrosHearing:
    """Turns messages into telemetry. ``node_seen``: somebody publishes the state, be it of no autopilot.

    *autopilot* is what flies behind the vehicle node, *resting* the mode in which its armed rovers stand;
    ``beat`` is when the last state came.
    """

    def __init__(
        self, kernel: Kernel, telemetry: Telemetry, geoid: Geoid, autopilot: str, resting: str
    ) -> None:
        self.node_seen = False
        self.beat: Ns = -1
        self._autopilot = autopilot
        self._resting = resting
        self._kernel = kernel
        self._seen = telemetry
        self._geoid = geoid
        self._landed_state = UNDEFINED
        self._active = False
        self._has_fix = False
        self._has_local_position = False

    def topics(self) -> Mapping[str, tuple[str, Handler]]:
        """Type and handler of each topic."""
        return {
            "state": ("mavros_msgs/msg/State", self._state),
            "extended_state": ("mavros_msgs/msg/ExtendedState", self._extended_state),
            "global_position/global": ("sensor_msgs/msg/NavSatFix", self._global),
            "global_position/rel_alt": ("std_msgs/msg/Float64", self._relative_altitude),
            "global_position/compass_hdg": ("std_msgs/msg/Float64", self._heading),
            "local_position/velocity_local": ("geometry_msgs/msg/TwistStamped", self._velocity),
            "home_position/home": ("mavros_msgs/msg/HomePosition", self._home),
            "battery": ("sensor_msgs/msg/BatteryState", self._battery),
            "statustext/recv": ("mavros_msgs/msg/StatusText", self._text),
            "mission/reached": ("mavros_msgs/msg/WaypointReached", self._reached),
        }

    def _heard(self) -> None:
        self._seen.heard = self._kernel.now()
        self._seen.changed.notify()

    def _state(self, message: Any) -> None:
        self.node_seen = True
        if not message.connected:
            return
        seen = self._seen
        self.beat = self._kernel.now()
        seen.autopilot = self._autopilot
        seen.mode = message.mode
        seen.armed = bool(message.armed)
        seen.status = entry_name("MAV_STATE", message.system_status).lower()
        seen.failsafe = message.system_status in FAILSAFE
        self._active = message.system_status == ACTIVE
        self._heard()

    def _extended_state(self, message: Any) -> None:
        self._landed_state = message.landed_state
        self._heard()

    def judge_flying(self) -> None:
        """By what was heard, and by its kind, which is told by others and maybe later than that."""
        seen = self._seen
        if seen.kind == "rover":
            seen.flying = seen.armed and seen.mode != self._resting
        elif self._landed_state == UNDEFINED:
            seen.flying = seen.armed and self._active
        else:
            seen.flying = self._landed_state != ON_GROUND

    def _global(self, message: Any) -> None:
        self._has_fix = message.status.status > NO_FIX
        if message.latitude != 0.0 or message.longitude != 0.0:
            self._seen.position = self._position(message)
        self._judge_ready()
        self._heard()

    def _position(self, place: Any) -> Position:
        latitude, longitude = place.latitude, place.longitude
        return Position(latitude, longitude, AMSL(self._geoid.to_amsl(latitude, longitude, place.altitude)))

    def _relative_altitude(self, message: Any) -> None:
        self._seen.above_home = message.data

    def _heading(self, message: Any) -> None:
        self._seen.attitude = self._seen.attitude._replace(heading=message.data)

    def _velocity(self, message: Any) -> None:
        linear = message.twist.linear
        north, east, down = enu_to_ned((linear.x, linear.y, linear.z))
        self._seen.velocity = Velocity(north, east, -down)
        self._has_local_position = True
        self._judge_ready()

    def _home(self, message: Any) -> None:
        self._seen.home = self._position(message.geo)
        self._judge_ready()

    def _judge_ready(self) -> None:
        seen = self._seen
        placed = seen.position is not None and seen.home is not None
        seen.ready = seen.armable = self._has_fix and self._has_local_position and placed

    def _battery(self, message: Any) -> None:
        """ROS counts a current that discharges as negative."""
        amperes = -message.current if message.current == message.current else nan
        self._seen.battery = Battery(message.percentage, message.voltage, amperes)

    def _text(self, message: Any) -> None:
        self._seen.texts.append(Said(self._kernel.now(), message.severity, message.text))

    def _reached(self, message: Any) -> None:
        self._seen.mission_reached = message.wp_seq
