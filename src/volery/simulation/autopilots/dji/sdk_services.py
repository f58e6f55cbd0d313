"""The services of the two nodes of DJI's onboard SDK.

``dji_sdk`` 3.8 has all names below its prefix. The vehicle node of ``dji_osdk_ros`` 4.1 has its names beside
it, and those of waypoint missions below it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import pi, radians
from typing import Any, NamedTuple

from volery.base.frames import heading_to_yaw
from volery.ros.messages import message_class
from volery.ros.messages.dji_constants import (
    GO_HOME_ALTITUDES,
    HARDWARE,
    HORIZONTAL,
    MISSION_SPEEDS,
    NEW_NAMES,
    OLD_NAMES,
    DisplayMode,
    Flag,
)
from volery.simulation.autopilots.dji.flight_controller import FlightController

START, STOP, PAUSE, RESUME = range(4)
"""Actions on a mission."""
GO_HOME, TAKE_OFF, LAND = 1, 4, 6
"""Tasks of both packages."""

ACCEPTED, REFUSED = 0, 1
"""Values of ``ack_data``: assumed; the public definitions do not list them."""


class Served(NamedTuple):
    """One service: its name in the node's namespace, its type, and its handler."""

    name: str
    type: str
    answer: Callable[[Any], Any]


def _response(kind: str, result: bool) -> Any:
    """Return a response with its result and, where the type has one, its acknowledgement."""
    cls = message_class(f"{kind}_Response")
    if "ack_data" in cls.__match_args__:
        return cls(result=result, ack_data=ACCEPTED if result else REFUSED)
    return cls(result=result)


def _accepting(
    prefix: str, package: str, *rows: tuple[str, str, Callable[[Any], bool]]
) -> tuple[Served, ...]:
    """Return services that answer whether a request is accepted, from rows of name, type and handler."""

    def served(name: str, kind: str, handle: Callable[[Any], bool]) -> Served:
        kind = f"{package}/srv/{kind}"
        return Served(prefix + name, kind, lambda request: _response(kind, handle(request)))

    return tuple(served(*row) for row in rows)


class Services:
    """Services of one aircraft. ``on_reference`` is called once there is a local reference."""

    def __init__(self, controller: FlightController, on_reference: Callable[[], None]) -> None:
        self._controller = controller
        self._on_reference = on_reference
        self._joystick = 0  # control flag of the last set_joystick_mode

    def table(self, package: str) -> tuple[Served, ...]:
        """Return the services of the node of a package."""
        own = self._services_4_1() if package == NEW_NAMES else self._services_3_8()
        return (*own, *self._missions(package))

    # -- 3.8

    def _services_3_8(self) -> tuple[Served, ...]:
        controller = self._controller
        return (
            *_accepting(
                f"{OLD_NAMES}/",
                OLD_NAMES,
                ("activation", "Activation", lambda _: controller.activate()),
                (
                    "sdk_control_authority",
                    "SDKControlAuthority",
                    lambda request: controller.set_authority(bool(request.control_enable)),
                ),
                (
                    "drone_arm_control",
                    "DroneArmControl",
                    lambda request: controller.motors(bool(request.arm)),
                ),
                ("drone_task_control", "DroneTaskControl", lambda request: self._task(request.task)),
                ("set_local_pos_ref", "SetLocalPosRef", lambda _: self._set_reference()),
            ),
            Served(f"{OLD_NAMES}/query_drone_version", f"{OLD_NAMES}/srv/QueryDroneVersion", self._version),
        )

    def _version(self, _request: Any) -> Any:
        name = self._controller.aircraft
        return message_class(f"{OLD_NAMES}/srv/QueryDroneVersion_Response")(HARDWARE[name], name)

    def _task(self, task: int) -> bool:
        controller = self._controller
        tasks = {GO_HOME: controller.go_home, TAKE_OFF: controller.take_off, LAND: controller.land}
        return task in tasks and tasks[task]()

    def _set_reference(self) -> bool:
        done = self._controller.set_reference()
        if done:
            self._on_reference()
        return done

    # -- 4.1

    def _services_4_1(self) -> tuple[Served, ...]:
        controller = self._controller
        controller.activate_at_power_on()
        return _accepting(
            "",
            NEW_NAMES,
            ("flight_task_control", "FlightTaskControl", self._flight_task),
            (
                "obtain_release_control_authority",
                "ObtainControlAuthority",
                lambda request: controller.set_authority(request.enable_obtain),
            ),
            ("kill_switch", "KillSwitch", lambda request: controller.kill() if request.enable else True),
            ("emergency_brake", "EmergencyBrake", lambda _: controller.brake()),
            ("set_local_pos_reference", "SetLocalPosRef", lambda _: self._set_reference()),
            ("set_joystick_mode", "SetJoystickMode", self._joystick_mode),
            ("joystick_action", "JoystickAction", self._joystick_action),
            ("set_go_home_altitude", "SetGoHomeAltitude", self._go_home_altitude),
            ("set_home_point", "SetHomePoint", self._home_point),
        )

    def _flight_task(self, request: Any) -> bool:
        controller = self._controller
        tasks: Mapping[int, Callable[[], bool]] = {
            request.TASK_GOHOME: controller.go_home,
            request.TASK_GOHOME_AND_CONFIRM_LANDING: controller.go_home,
            request.TASK_TAKEOFF: controller.take_off,
            request.TASK_LAND: controller.land,
            request.TASK_FORCE_LANDING: controller.land,
            request.TASK_FORCE_LANDING_AVOID_GROUND: controller.land,
            request.START_MOTOR: lambda: controller.motors(True),
            request.STOP_MOTOR: lambda: controller.vehicle.landed and controller.motors(False),
            request.TASK_EXIT_GO_HOME: lambda: controller.interrupt(DisplayMode.NAVI_GO_HOME),
            request.TASK_EXIT_LANDING: lambda: controller.interrupt(DisplayMode.AUTO_LANDING),
        }
        return request.task in tasks and tasks[request.task]()

    def _joystick_mode(self, request: Any) -> bool:
        self._joystick = (
            (request.horizontal_mode << 6) & HORIZONTAL
            | (request.vertical_mode << 4)
            | (Flag.YAW_RATE if request.yaw_mode else 0)
            | (Flag.BODY if request.horizontal_coordinate else 0)
            | (Flag.STABLE if request.stable_mode else 0)
        )
        return True

    def _joystick_action(self, request: Any) -> bool:
        """Handle joystick_action: north-east-up or forward-right-up, clockwise, degrees."""
        command, flag = request.joystickCommand, self._joystick
        angles, body = not flag & HORIZONTAL, bool(flag & Flag.BODY)
        if angles:
            x, y = radians(command.x), -radians(command.y)
        else:
            x, y = (command.x, -command.y) if body else (command.y, command.x)
        rate = bool(flag & Flag.YAW_RATE)
        yaw = -radians(command.yaw) if rate else heading_to_yaw(radians(command.yaw) % (2.0 * pi))
        self._controller.handle_setpoint((x, y, command.z, yaw), flag)
        return True

    def _go_home_altitude(self, request: Any) -> bool:
        low, high = GO_HOME_ALTITUDES
        if not low <= request.altitude <= high:
            return False
        return self._controller.vehicle.set_parameter("GO_HOME_ALTITUDE", float(request.altitude))

    def _home_point(self, request: Any) -> bool:
        vehicle = self._controller.vehicle
        if vehicle.home is None or not abs(request.latitude) <= 90.0 or not abs(request.longitude) <= 180.0:
            return False
        vehicle.set_home(request.latitude, request.longitude, vehicle.home.amsl)
        return True

    # -- missions, in both packages

    def _missions(self, package: str) -> tuple[Served, ...]:
        controller, prefix = self._controller, f"{package}/"

        def query(name: str, kind: str, values: Callable[[], tuple[Any, ...]]) -> Served:
            response = message_class(f"{package}/srv/{kind}_Response")
            return Served(prefix + name, f"{package}/srv/{kind}", lambda _: response(*values()))

        upload, action, set_speed = _accepting(
            prefix,
            package,
            (
                "mission_waypoint_upload",
                "MissionWpUpload",
                lambda request: controller.upload(request.waypoint_task.copy()),
            ),
            ("mission_waypoint_action", "MissionWpAction", self._mission_action),
            ("mission_waypoint_setSpeed", "MissionWpSetSpeed", self._set_speed),
        )
        no_task = message_class(f"{package}/msg/MissionWaypointTask")
        return (
            upload,
            action,
            query("mission_waypoint_getInfo", "MissionWpGetInfo", lambda: (controller.task or no_task(),)),
            query(
                "mission_waypoint_getSpeed",
                "MissionWpGetSpeed",
                lambda: (controller.task.idle_velocity if controller.task else 0.0,),
            ),
            set_speed,
            query("mission_status", "MissionStatus", lambda: (int(controller.task is not None), 0)),
        )

    def _mission_action(self, request: Any) -> bool:
        controller = self._controller
        if request.action in (STOP, PAUSE):
            return controller.leave_mission()
        return request.action in (START, RESUME) and controller.start_mission(
            from_start=request.action == START
        )

    def _set_speed(self, request: Any) -> bool:
        low, high = MISSION_SPEEDS
        return low <= request.speed <= high and self._controller.mission_speed(request.speed)
