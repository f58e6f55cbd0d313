"""The services of the two nodes of DJI's onboard SDK.

``dji_sdk`` 3.8 has all names below its prefix. The vehicle node of ``dji_osdk_ros`` 4.1 has its names beside
it, and those of waypoint missions below it. It fails the call of a refused flight task, authority or kill,
and answers a take-off or a landing when it is finished.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import isfinite, pi, radians
from typing import Any, NamedTuple

from volery.base.frames import heading_to_yaw
from volery.base.time import Ns, S
from volery.ros.messages import message_class
from volery.ros.messages.dji_constants import (
    DRONE_TYPES,
    GO_HOME_ALTITUDES,
    HARDWARE,
    HORIZONTAL,
    M100,
    M300,
    MISSION_SPEEDS,
    NEW_NAMES,
    NO_CODE,
    OLD_NAMES,
    OTHER_DRONE_TYPE,
    TAKE_PICTURE,
    AuthorityAck,
    DisplayMode,
    Flag,
    M100TaskAck,
    MissionAck,
    TaskAck,
)
from volery.simulation.autopilots.dji.flight_controller import FlightController

START, STOP, PAUSE, RESUME = range(4)
"""Actions on a mission."""
GO_HOME, TAKE_OFF, LAND = 1, 4, 6
"""Tasks of both packages."""

_AUTHORITY = f"{OLD_NAMES}/srv/SDKControlAuthority"
_TASK = f"{OLD_NAMES}/srv/DroneTaskControl"
MAIN_GIMBAL = 0
GIMBAL_PERIOD: Ns = 2 * S
"""Time after which the node of 4.1 answers a command to its gimbal."""

_GIMBAL_TASK = f"{NEW_NAMES}/srv/GimbalAction"
_FLIGHT_TASK = f"{NEW_NAMES}/srv/FlightTaskControl"

Condition = Callable[[], bool]


class Reply(NamedTuple):
    """A response, or None to fail the call, and when it is given: at once, or once ``finished`` is true."""

    response: Any
    finished: Condition | None = None


Answer = Callable[[Any], Reply]


class Served(NamedTuple):
    """One service: its name in the node's namespace, its type, and its handler."""

    name: str
    type: str
    answer: Answer


def _response(kind: str, result: bool, code: int) -> Any:
    """Return a response with its result and, where the type has one, the code of the aircraft."""
    cls = message_class(f"{kind}_Response")
    if "ack_data" in cls.__match_args__:
        return cls(result=result, ack_data=code)
    return cls(result=result)


Row = tuple[str, str, Callable[[Any], int]]
"""Name, type and handler, which returns the code of the aircraft."""


def accepting(prefix: str, package: str, *rows: Row) -> tuple[Served, ...]:
    """Return services that answer whether a request is accepted: its code is 0."""

    def served(name: str, kind: str, handle: Callable[[Any], int]) -> Served:
        kind = f"{package}/srv/{kind}"

        def answer(request: Any) -> Reply:
            code = handle(request)
            return Reply(_response(kind, code == TaskAck.OK, code))

        return Served(prefix + name, kind, answer)

    return tuple(served(*row) for row in rows)


def _failing(package: str, name: str, kind: str, handle: Callable[[Any], bool]) -> Served:
    """Return a service whose call fails where the request is refused."""
    kind = f"{package}/srv/{kind}"

    def answer(request: Any) -> Reply:
        return Reply(_response(kind, True, TaskAck.OK) if handle(request) else None)

    return Served(name, kind, answer)


UPLOAD_PERIOD: Ns = S
"""Time that the node takes for a mission, and for each of its waypoints."""


class SdkServices:
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
            *accepting(
                f"{OLD_NAMES}/",
                OLD_NAMES,
                ("activation", "Activation", lambda _: _plain(controller.activate())),
                (
                    "drone_arm_control",
                    "DroneArmControl",
                    lambda request: controller.motors(bool(request.arm)),
                ),
                ("set_local_pos_ref", "SetLocalPosRef", lambda _: _plain(self._set_reference())),
            ),
            Served(f"{OLD_NAMES}/sdk_control_authority", _AUTHORITY, self._authority),
            Served(f"{OLD_NAMES}/drone_task_control", _TASK, self._task),
            *accepting(f"{OLD_NAMES}/", OLD_NAMES, ("camera_action", "CameraAction", self._camera_action)),
            Served(f"{OLD_NAMES}/query_drone_version", f"{OLD_NAMES}/srv/QueryDroneVersion", self._version),
        )

    def _version(self, _request: Any) -> Reply:
        hardware, version = HARDWARE[self._controller.aircraft]
        return Reply(message_class(f"{OLD_NAMES}/srv/QueryDroneVersion_Response")(version, hardware))

    def _camera_action(self, request: Any) -> int:
        """Handle camera_action: pictures are counted; films are refused, because none is simulated."""
        if request.camera_action != TAKE_PICTURE:
            return NO_CODE
        self._controller.gimbal.pictures += 1
        return TaskAck.OK

    def _authority(self, request: Any) -> Reply:
        wanted = bool(request.control_enable)
        code = self._controller.set_authority(wanted)
        done = code == (AuthorityAck.OBTAINED if wanted else AuthorityAck.RELEASED)
        return Reply(_response(_AUTHORITY, done, code))

    def _task(self, request: Any) -> Reply:
        controller = self._controller
        tasks = {GO_HOME: controller.go_home, TAKE_OFF: controller.take_off, LAND: controller.land}
        code = tasks[request.task]() if request.task in tasks else NO_CODE
        done = code == TaskAck.OK
        if controller.aircraft == M100:
            code = M100TaskAck.OK if done else M100TaskAck.FAILED
        return Reply(_response(_TASK, done, code))

    def _set_reference(self) -> bool:
        done = self._controller.set_reference()
        if done:
            self._on_reference()
        return done

    # -- 4.1

    def _services_4_1(self) -> tuple[Served, ...]:
        controller = self._controller
        controller.activate_at_power_on()
        return (
            Served("get_drone_type", f"{NEW_NAMES}/srv/GetDroneType", self._drone_type),
            Served("flight_task_control", _FLIGHT_TASK, self._flight_task),
            Served("gimbal_task_control", _GIMBAL_TASK, self._gimbal_task),
            _failing(NEW_NAMES, "obtain_release_control_authority", "ObtainControlAuthority", self._obtain),
            _failing(NEW_NAMES, "kill_switch", "KillSwitch", self._kill),
            *accepting(
                "",
                NEW_NAMES,
                ("emergency_brake", "EmergencyBrake", lambda _: _plain(controller.brake())),
                ("set_local_pos_reference", "SetLocalPosRef", lambda _: _plain(self._set_reference())),
                (
                    "set_joystick_mode",
                    "SetJoystickMode",
                    lambda one: _plain(self._joystick_mode(one)),
                ),
                (
                    "camera_start_shoot_single_photo",
                    "CameraStartShootSinglePhoto",
                    lambda one: _plain(self._picture(one)),
                ),
                ("joystick_action", "JoystickAction", lambda one: _plain(self._joystick_action(one))),
                (
                    "set_go_home_altitude",
                    "SetGoHomeAltitude",
                    lambda one: _plain(self._go_home_altitude(one)),
                ),
                ("set_home_point", "SetHomePoint", lambda request: _plain(self._home_point(request))),
            ),
        )

    def _drone_type(self, _request: Any) -> Reply:
        aircraft = self._controller.aircraft
        number = next((one for one, name in DRONE_TYPES.items() if name == aircraft), OTHER_DRONE_TYPE)
        return Reply(message_class(f"{NEW_NAMES}/srv/GetDroneType_Response")(number))

    def _obtain(self, request: Any) -> bool:
        code = self._controller.set_authority(request.enable_obtain)
        return code in (AuthorityAck.OBTAINED, AuthorityAck.RELEASED)

    def _kill(self, request: Any) -> bool:
        if request.enable:
            self._controller.kill()
        return True

    def _flight_task(self, request: Any) -> Reply:
        """Start a task; the answer to a take-off or a landing comes when it is finished."""
        controller, vehicle = self._controller, self._controller.vehicle

        def land_at_once() -> int:
            code = controller.land()
            controller.landing_confirmed = True
            return code

        tasks: Mapping[int, Callable[[], int]] = {
            request.TASK_GOHOME: controller.go_home,
            request.TASK_GOHOME_AND_CONFIRM_LANDING: controller.go_home,
            request.TASK_TAKEOFF: controller.take_off,
            request.TASK_LAND: controller.land,
            request.TASK_FORCE_LANDING: land_at_once,
            request.TASK_FORCE_LANDING_AVOID_GROUND: land_at_once,
            request.START_MOTOR: lambda: controller.motors(True),
            request.STOP_MOTOR: lambda: controller.motors(False),
            request.TASK_EXIT_GO_HOME: lambda: controller.interrupt(DisplayMode.NAVI_GO_HOME),
            request.TASK_EXIT_LANDING: lambda: controller.interrupt(DisplayMode.AUTO_LANDING),
        }
        if request.task not in tasks or tasks[request.task]() != TaskAck.OK:
            return Reply(None)
        doing = {request.TASK_TAKEOFF: DisplayMode.AUTO_TAKEOFF, request.TASK_LAND: DisplayMode.AUTO_LANDING}
        mode = doing.get(request.task)
        finished = None if mode is None else lambda: vehicle.mode.number != mode or not vehicle.armed
        return Reply(_response(_FLIGHT_TASK, True, TaskAck.OK), finished)

    def _gimbal_task(self, request: Any) -> Reply:
        """Turn the main gimbal; the node answers two seconds later."""
        angles = (request.roll, request.pitch, request.yaw)
        done = request.payload_index == MAIN_GIMBAL and all(isfinite(angle) for angle in angles)
        if done:
            wanted = (0.0, 0.0, 0.0) if request.is_reset else angles
            relative = request.rotationMode == 1 and not request.is_reset
            self._controller.gimbal.point(wanted, request.time, relative=relative)
        kernel = self._controller.vehicle.kernel
        until = kernel.now() + GIMBAL_PERIOD
        return Reply(_response(_GIMBAL_TASK, done, NO_CODE), lambda: kernel.now() >= until)

    def _picture(self, request: Any) -> bool:
        done = bool(request.payload_index == MAIN_GIMBAL)
        self._controller.gimbal.pictures += done
        return done

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
            return Served(prefix + name, f"{package}/srv/{kind}", lambda _: Reply(response(*values())))

        action, set_speed = accepting(
            prefix,
            package,
            ("mission_waypoint_action", "MissionWpAction", self._mission_action),
            ("mission_waypoint_setSpeed", "MissionWpSetSpeed", self._set_speed),
        )
        upload_type = f"{package}/srv/MissionWpUpload"
        upload = Served(
            f"{prefix}mission_waypoint_upload",
            upload_type,
            lambda request: self._upload(upload_type, request.waypoint_task.copy()),
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

    def _upload(self, kind: str, task: Any) -> Reply:
        """Take a mission, slowly: the aircraft checks all points with the last one."""
        controller = self._controller
        kernel = controller.vehicle.kernel
        until = kernel.now() + UPLOAD_PERIOD * (1 + len(task.mission_waypoint))
        code = NO_CODE if controller.aircraft == M300 else controller.upload(task)
        return Reply(_response(kind, code == MissionAck.OK, code), lambda: kernel.now() >= until)

    def _mission_action(self, request: Any) -> int:
        controller = self._controller
        if request.action in (STOP, PAUSE):
            return controller.leave_mission()
        if request.action not in (START, RESUME):
            return NO_CODE
        return controller.start_mission(from_start=request.action == START)

    def _set_speed(self, request: Any) -> int:
        low, high = MISSION_SPEEDS
        return self._controller.mission_speed(request.speed) if low <= request.speed <= high else NO_CODE


def _plain(accepted: bool) -> int:
    """Return the code of an answer for which the aircraft has none of its own."""
    return TaskAck.OK if accepted else NO_CODE
