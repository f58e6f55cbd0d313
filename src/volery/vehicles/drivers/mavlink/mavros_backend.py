"""What MAVROS's topics say, as ``Telemetry``. One method for each topic that is listened to.

An autopilot over MAVROS: topics and services of a graph, as a node that commands a vehicle uses them.

The node's own loop, at 10 Hz, is run by whoever waits: take in what has arrived (one ``spinOnce``), sleep. So
all that driving takes is charged to the component whose node this is. Nothing goes on in the background: a
set-point that is to be repeated is repeated by that loop, or by the caller.

MAVROS does not pass on everything: it does not say what kind of vehicle it is (``Drone`` or ``Rover`` tells),
nor the result of the arming checks. Here a vehicle is ready once it has a local position, a fix and a home.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from math import nan, radians
from typing import Any, NamedTuple

from volery.base.errors import LinkError, LinkSilent
from volery.base.frames import enu_to_ned, ned_to_enu
from volery.base.geoid import EGM96, EGM96_NAME, Geoid, parse_geoid
from volery.base.position import AMSL, Position
from volery.base.time import MS, Ns, S
from volery.kernel.api import Action, Kernel
from volery.links.mavlink_messages import constant, entry_name
from volery.ros.graph import Node, ServiceError
from volery.ros.graph.callbacks import Work
from volery.ros.messages import message_class, new, request
from volery.vehicles.address import check_options
from volery.vehicles.drivers.mavlink import backend as key
from volery.vehicles.drivers.mavlink.backend import (
    ACTIVE,
    FAILSAFE,
    FORCE,
    GROUND_SPEED,
    ON_GROUND,
    UNCHANGED,
    UNDEFINED,
    Item,
)
from volery.vehicles.telemetry import Answer, Battery, StatusText, Telemetry, Velocity

NO_FIX = -1

Handler = Callable[[Any], None]


class MavrosDecoder:
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
        self._seen.last_message_ns = self._kernel.now()
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
        self._seen.texts.append(StatusText(self._kernel.now(), message.severity, message.text))

    def _reached(self, message: Any) -> None:
        self._seen.mission_reached = message.wp_seq


PERIOD: Ns = 100 * MS
ANSWERED_WITHIN: Ns = 6 * S
"""A vehicle node waits up to 5 s for the autopilot's acknowledgement."""

MAVROS_OPTIONS = ("geoid", "namespace")


class FirmwareBehind(NamedTuple):
    """What flies behind the vehicle node: the firmware's name, and the mode in which its rovers rest."""

    autopilot: str
    resting: str


class MavrosBackend:
    """See ``Carrier``. *namespace* is where the vehicle node's names begin: ``/drone_1``.

    Making it joins the graph: it computes, in the task that makes it.
    """

    behind: FirmwareBehind

    def __init__(self, kernel: Kernel, node: Node, name: str, namespace: str, geoid: Geoid = EGM96) -> None:
        self.telemetry = Telemetry(kernel, name)
        self._kernel = kernel
        self._node = node
        self._namespace = namespace.rstrip("/")
        self._hearing = MavrosDecoder(kernel, self.telemetry, geoid, *self.behind)
        self._wrong = ""
        self._arrived: deque[Work] = deque()
        self._spinner = node.group()
        inbox = node.group(self._arrived.append)
        for topic, (message_type, handler) in self._hearing.topics().items():
            node.subscribe(self._name(topic), message_type, handler, group=inbox)
        self._velocity = node.advertise(self._name("setpoint_raw/local"), "mavros_msgs/msg/PositionTarget")
        self._set_mode = node.client(self._name("set_mode"), "mavros_msgs/srv/SetMode")
        self._arming = node.client(self._name("cmd/arming"), "mavros_msgs/srv/CommandBool")
        self._takeoff = node.client(self._name("cmd/takeoff"), "mavros_msgs/srv/CommandTOL")
        self._long = node.client(self._name("cmd/command"), "mavros_msgs/srv/CommandLong")
        self._push = node.client(self._name("mission/push"), "mavros_msgs/srv/WaypointPush")
        self._rate = node.rate(PERIOD)

    def _name(self, name: str) -> str:
        return f"{self._namespace}/{name}"

    # -- the node's loop

    @property
    def cycle(self) -> Action | None:
        """Spin once, sleep."""
        return self._go_round

    def _go_round(self) -> None:
        self.poll()
        self._rate.sleep()

    @property
    def parameters(self) -> Mapping[str, float] | None:
        """Not read over a graph."""
        return None

    def poll(self) -> None:
        """One ``spinOnce``: it is paid once, and runs the callbacks of all that has arrived."""
        self._spinner.spin_once(0)
        while self._arrived:
            self._arrived.popleft().run()
        self._hearing.judge_flying()

    def problem(self) -> LinkError | None:
        """What is wrong on the way, as far as it shows."""
        if self._wrong:
            return LinkSilent(self._wrong)
        if self.telemetry.last_message_ns >= 0:
            return None
        if self._hearing.node_seen:
            return LinkSilent(f"the vehicle node at {self._namespace} hears no autopilot")
        return LinkSilent(f"no vehicle node publishes {self._name('state')}")

    def close(self) -> None:
        """Commands no more; the node is its owner's."""

    # -- services

    def _call(self, client: Any, asked: Any) -> Any | None:
        """The response; ``None`` if there was none, which is not the autopilot's refusal."""
        try:
            response = client.call(asked, within=ANSWERED_WITHIN)
        except ServiceError as error:
            self._wrong = str(error)
            return None
        self._wrong = ""
        return response

    def _answer(self, which: str, response: Any | None) -> None:
        if response is not None:
            result = entry_name("MAV_RESULT", response.result)
            self.telemetry.answers[which] = Answer(self._kernel.now(), response.success, result)

    def _command(self, command: str, *parameters: float) -> Any | None:
        kind = "mavros_msgs/srv/CommandLong"
        named = {f"param{number}": float(value) for number, value in enumerate(parameters, 1)}
        return self._call(self._long, request(kind, command=constant(command), **named))

    def set_mode(self, mode: str) -> None:
        """``set_mode``: MAVROS says that it was sent, not that it was done."""
        kind = "mavros_msgs/srv/SetMode"
        self._call(self._set_mode, request(kind, custom_mode=mode))

    def arm(self, arm: bool, *, force: bool = False) -> None:
        """``cmd/arming``; by force as a command of its own."""
        if force:
            self._answer(key.ARM, self._command("MAV_CMD_COMPONENT_ARM_DISARM", float(arm), FORCE))
            return
        kind = "mavros_msgs/srv/CommandBool"
        self._answer(key.ARM, self._call(self._arming, request(kind, value=arm)))

    def takeoff(self, altitude: float) -> None:
        """``cmd/takeoff``: the altitude is what the firmware takes it for."""
        kind = "mavros_msgs/srv/CommandTOL"
        asked = request(kind, altitude=altitude, **self._take_off_from())
        self._answer(key.TAKEOFF, self._call(self._takeoff, asked))

    def _take_off_from(self) -> Mapping[str, float]:
        """The place and the heading with which to take off; none is the place where it stands."""
        return {}

    def speed(self, metres_per_second: float) -> None:
        """``cmd/command`` with DO_CHANGE_SPEED."""
        answer = self._command("MAV_CMD_DO_CHANGE_SPEED", GROUND_SPEED, metres_per_second, UNCHANGED)
        self._answer(key.SPEED, answer)

    def check(self) -> None:
        """``cmd/command`` with RUN_PREARM_CHECKS."""
        self._command("MAV_CMD_RUN_PREARM_CHECKS")

    def watch_target(self) -> None:
        """It would be a topic more, and one more subscription to pay for."""

    def watch_mission(self) -> None:
        """``mission/reached`` comes anyhow."""

    def upload(self, items: Sequence[Item]) -> None:
        """``mission/push``."""
        kind = "mavros_msgs/srv/WaypointPush"
        waypoints = [_waypoint(item, number == 0) for number, item in enumerate(items)]
        response = self._call(self._push, request(kind, start_index=0, waypoints=waypoints))
        if response is not None:
            result = "ACCEPTED" if response.success else f"{response.wp_transfered} items went over"
            self.telemetry.answers[key.MISSION] = Answer(self._kernel.now(), response.success, result)

    # -- topics

    def _publish_velocity(self, velocity: Velocity, mask: int, **yaw: float) -> None:
        """``setpoint_raw/local``: east, north, up; *yaw* as the message has it, anticlockwise."""
        message = new(
            "mavros_msgs/msg/PositionTarget",
            coordinate_frame=constant("MAV_FRAME_LOCAL_NED"),
            type_mask=mask,
            **yaw,
        )
        vector = message_class("geometry_msgs/msg/Vector3")
        message.velocity = vector(*ned_to_enu((velocity.north, velocity.east, -velocity.up)))
        self._velocity.publish(message)


def clockwise(degrees: float) -> float:
    """A yaw rate in degrees/s clockwise, as ROS has it: in rad/s anticlockwise."""
    return -radians(degrees)


def _waypoint(item: Item, current: bool) -> Any:
    first, second, third, fourth = item.parameters
    return new(
        "mavros_msgs/msg/Waypoint",
        frame=item.frame,
        command=item.command,
        is_current=current,
        autocontinue=True,
        param1=first,
        param2=second,
        param3=third,
        param4=fourth,
        x_lat=item.latitude,
        y_long=item.longitude,
        z_alt=item.z,
    )


def namespace_and_geoid(driver: str, name: str, options: Mapping[str, str]) -> tuple[str, Geoid]:
    """What the options of an address say of the vehicle node called *name*.

    ``geoid``: MAVROS counts altitudes from the ellipsoid, by EGM96; else metres.
    """
    check_options(driver, options, *MAVROS_OPTIONS)
    return options.get("namespace", f"/{name}"), parse_geoid(options.get("geoid", EGM96_NAME))
