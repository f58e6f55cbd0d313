"""The topics and services of the two DJI nodes: the same requests, with different names and types.

``dji_sdk`` 3.8 takes set-points on topics, in the conventions of ROS. The vehicle node of ``dji_osdk_ros``
4.1 takes them by a service, in those of the flight controller: north and east, or forward and right;
clockwise; degrees. Its missions are of a second kind where it serves an M300.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from math import degrees, radians
from typing import Any, NamedTuple, Protocol

from volery.base.frames import yaw_to_heading
from volery.ros.graph import Client, Node, Publisher
from volery.ros.messages import message_class, request
from volery.ros.messages.dji_constants import (
    DRONE_TYPES,
    HORIZONTAL,
    NEW_NAMES,
    OLD_NAMES,
    SETPOINT,
    SETPOINT_TOPICS,
    TAKE_PICTURE,
    Flag,
    GimbalMode,
    aircraft_of,
)

GO_HOME, TAKE_OFF, LAND = 1, 4, 6
"""Numbers of tasks."""
EXIT_GO_HOME, EXIT_LANDING = 12, 14
START_MOTOR, STOP_MOTOR = 7, 8
START_MISSION = 0

SETPOINT_WITHIN = 200_000_000
"""Time-out of a set-point sent by a service, ns."""

GIMBAL_TURNS_S = 1
"""Time in which a gimbal turns to an angle, s."""

JOY = "sensor_msgs/msg/Joy"
_joy: Any = message_class(JOY)
SECOND_KIND = f"{NEW_NAMES}/msg/WaypointV2InitSetting"
"""Type of a mission of the second kind."""


class ServiceRequest(NamedTuple):
    """A request to a service."""

    client: Client
    request: Any


class SdkRequests(Protocol):
    """Requests that both nodes support. ``None`` means that the node needs no such request."""

    namespace: str
    package: str
    kills_without_authority: bool
    blocks: bool
    """Whether it answers nothing while a take-off or a landing is in progress."""

    def version(self) -> ServiceRequest:
        """Request the type of aircraft, on which the meaning of its numbers depends."""

    def aircraft(self, response: Any) -> str:
        """Return the type of aircraft that a response to ``version`` states."""

    def activation(self) -> ServiceRequest | None:
        """Activate the SDK."""

    def authority(self, wanted: bool) -> ServiceRequest:
        """Obtain or release the control authority."""

    def motors(self, on: bool) -> ServiceRequest:
        """Start or stop the motors on the ground."""

    def kill(self) -> ServiceRequest:
        """Stop the motors anywhere."""

    def task(self, task: int) -> ServiceRequest:
        """Start the task to go home, take off or land."""

    def interrupt(self, task: int) -> ServiceRequest | None:
        """End going home or landing; ``None`` means that no request does."""

    def reference(self) -> ServiceRequest:
        """Set the local reference."""

    def mission(self, task: Any) -> tuple[ServiceRequest, ...]:
        """Upload a mission by requests, one after another."""

    def start_mission(self, task: Any) -> ServiceRequest:
        """Start the mission that was uploaded."""

    def gimbal(self, pitch: float, yaw: float) -> ServiceRequest | None:
        """Point the gimbal, degrees; ``None`` means that it was commanded on a topic."""

    def picture(self) -> ServiceRequest:
        """Take a picture."""

    def setpoint(self, flag: int, numbers: Sequence[float]) -> None:
        """Send four numbers in the conventions of ROS. May block while they are sent."""


def _raise(_index: int, error: Exception) -> None:
    raise error


class _CommonInterface:
    """Services that both nodes have below their namespace."""

    package = ""

    def __init__(self, node: Node, namespace: str) -> None:
        self.namespace = namespace
        self._node = node
        self._upload = self._client(f"{namespace}/mission_waypoint_upload", "MissionWpUpload")
        self._action = self._client(f"{namespace}/mission_waypoint_action", "MissionWpAction")

    def _client(self, name: str, kind: str) -> Client:
        return self._node.client(name, f"{self.package}/srv/{kind}")

    def _make_request(self, client: Client, **fields: Any) -> ServiceRequest:
        return ServiceRequest(client, request(client.type, **fields))

    def mission(self, task: Any) -> tuple[ServiceRequest, ...]:
        """Return a request to ``mission_waypoint_upload``."""
        return (self._make_request(self._upload, waypoint_task=task),)

    def start_mission(self, task: Any) -> ServiceRequest:
        """Return a request to ``mission_waypoint_action``."""
        return self._make_request(self._action, action=START_MISSION)


class DjiSdkInterface(_CommonInterface):
    """The node of ``dji_sdk`` 3.8."""

    package = OLD_NAMES
    kills_without_authority = False
    blocks = False

    def __init__(self, node: Node, namespace: str) -> None:
        super().__init__(node, namespace)
        below = f"{namespace}/"
        self._version = self._client(f"{below}query_drone_version", "QueryDroneVersion")
        self._activation = self._client(f"{below}activation", "Activation")
        self._authority = self._client(f"{below}sdk_control_authority", "SDKControlAuthority")
        self._arm = self._client(f"{below}drone_arm_control", "DroneArmControl")
        self._task = self._client(f"{below}drone_task_control", "DroneTaskControl")
        self._reference = self._client(f"{below}set_local_pos_ref", "SetLocalPosRef")
        self._publishers: dict[int, Publisher] = {
            flag: node.advertise(f"{below}{name}", JOY) for name, flag in SETPOINT_TOPICS.items()
        }
        self._generic = node.advertise(f"{below}{SETPOINT}generic", JOY)

    def version(self) -> ServiceRequest:
        """Return a request to ``query_drone_version``."""
        return self._make_request(self._version)

    def aircraft(self, response: Any) -> str:
        """Return the type of the aircraft with this hardware."""
        return aircraft_of(response.hardware) or "aircraft"

    def activation(self) -> ServiceRequest:
        """Return a request to ``activation``; the key is among the node's parameters."""
        return self._make_request(self._activation)

    def authority(self, wanted: bool) -> ServiceRequest:
        """Return a request to ``sdk_control_authority``."""
        return self._make_request(self._authority, control_enable=int(wanted))

    def motors(self, on: bool) -> ServiceRequest:
        """Return a request to ``drone_arm_control``."""
        return self._make_request(self._arm, arm=int(on))

    def kill(self) -> ServiceRequest:
        """Return a request to ``drone_arm_control``: there is no kill switch."""
        return self.motors(False)

    def task(self, task: int) -> ServiceRequest:
        """Return a request to ``drone_task_control``."""
        return self._make_request(self._task, task=task)

    def interrupt(self, task: int) -> None:
        """Return ``None``: there is no such task, and set-points do not end it either."""

    def reference(self) -> ServiceRequest:
        """Return a request to ``set_local_pos_ref``."""
        return self._make_request(self._reference)

    @cached_property
    def _gimbal(self) -> Publisher:
        return self._node.advertise(f"{self.namespace}/gimbal_angle_cmd", f"{self.package}/msg/Gimbal")

    @cached_property
    def _camera(self) -> Client:
        return self._client(f"{self.namespace}/camera_action", "CameraAction")

    def gimbal(self, pitch: float, yaw: float) -> None:
        """Publish on ``gimbal_angle_cmd``; the roll stays as it is."""
        command: Any = message_class(self._gimbal.type)()
        command.mode = GimbalMode.ABSOLUTE | GimbalMode.KEEPS_ROLL
        command.ts, command.pitch, command.yaw = GIMBAL_TURNS_S, radians(pitch), radians(yaw)
        self._gimbal.publish(command)

    def picture(self) -> ServiceRequest:
        """Return a request to ``camera_action``."""
        return self._make_request(self._camera, camera_action=TAKE_PICTURE)

    def setpoint(self, flag: int, numbers: Sequence[float]) -> None:
        """Publish on the topic of the flag, or on the generic one."""
        publisher = self._publishers.get(flag)
        axes = list(numbers) if publisher is not None else [*numbers, float(flag)]
        joy = _joy()
        joy.axes = axes
        self._node.publish_all([(publisher or self._generic, joy)], _raise)


class OsdkRosInterface(_CommonInterface):
    """The vehicle node of ``dji_osdk_ros`` 4.1; most of its services lie beside its namespace."""

    package = NEW_NAMES
    kills_without_authority = True
    blocks = True

    def __init__(self, node: Node, namespace: str) -> None:
        super().__init__(node, namespace)
        beside = self._beside = namespace.rpartition("/")[0] + "/"
        self._version = self._client(f"{beside}get_drone_type", "GetDroneType")
        self._task = self._client(f"{beside}flight_task_control", "FlightTaskControl")
        self._authority = self._client(f"{beside}obtain_release_control_authority", "ObtainControlAuthority")
        self._kill = self._client(f"{beside}kill_switch", "KillSwitch")
        self._reference = self._client(f"{beside}set_local_pos_reference", "SetLocalPosRef")
        self._mode = self._client(f"{beside}set_joystick_mode", "SetJoystickMode")
        self._joystick = self._client(f"{beside}joystick_action", "JoystickAction")
        self._flag = -1

    def version(self) -> ServiceRequest:
        """Return a request to ``get_drone_type``."""
        return self._make_request(self._version)

    def aircraft(self, response: Any) -> str:
        """Return the type of aircraft with this number; it has none for an A3 and an N3."""
        return DRONE_TYPES.get(response.drone_type, "aircraft of OSDK 4")

    def activation(self) -> None:
        """Return ``None``: the node activates when it starts."""

    def authority(self, wanted: bool) -> ServiceRequest:
        """Return a request to ``obtain_release_control_authority``."""
        return self._make_request(self._authority, enable_obtain=wanted)

    def motors(self, on: bool) -> ServiceRequest:
        """Return a request to ``flight_task_control``."""
        return self.task(START_MOTOR if on else STOP_MOTOR)

    def kill(self) -> ServiceRequest:
        """Return a request to ``kill_switch``."""
        return self._make_request(self._kill, enable=True)

    def task(self, task: int) -> ServiceRequest:
        """Return a request to ``flight_task_control``."""
        return self._make_request(self._task, task=task)

    def interrupt(self, task: int) -> ServiceRequest:
        """Return a request to ``flight_task_control``."""
        return self.task(EXIT_GO_HOME if task == GO_HOME else EXIT_LANDING)

    def reference(self) -> ServiceRequest:
        """Return a request to ``set_local_pos_reference``."""
        return self._make_request(self._reference)

    def _second_kind(self, name: str, kind: str) -> Client:
        return self._client(f"{self.namespace}/waypointV2_{name}", kind)

    @cached_property
    def _settings(self) -> Client:
        return self._second_kind("initSetting", "InitWaypointV2Setting")

    @cached_property
    def _upload_settings(self) -> Client:
        return self._second_kind("uploadMission", "UploadWaypointV2Mission")

    @cached_property
    def _start(self) -> Client:
        return self._second_kind("startMission", "StartWaypointV2Mission")

    def mission(self, task: Any) -> tuple[ServiceRequest, ...]:
        """Return requests that state the settings of a mission of the second kind and upload it."""
        if task.__msgtype__ != SECOND_KIND:
            return super().mission(task)
        return (
            self._make_request(self._settings, waypointV2InitSettings=task),
            self._make_request(self._upload_settings),
        )

    def start_mission(self, task: Any) -> ServiceRequest:
        """Return a request to ``waypointV2_startMission`` for a mission of the second kind."""
        if task.__msgtype__ != SECOND_KIND:
            return super().start_mission(task)
        return self._make_request(self._start)

    @cached_property
    def _gimbal(self) -> Client:
        return self._client(f"{self._beside}gimbal_task_control", "GimbalAction")

    @cached_property
    def _camera(self) -> Client:
        name = f"{self._beside}camera_start_shoot_single_photo"
        return self._client(name, "CameraStartShootSinglePhoto")

    def gimbal(self, pitch: float, yaw: float) -> ServiceRequest:
        """Return a request to ``gimbal_task_control`` for the main gimbal."""
        return self._make_request(self._gimbal, pitch=pitch, yaw=yaw, time=float(GIMBAL_TURNS_S))

    def picture(self) -> ServiceRequest:
        """Return a request to ``camera_start_shoot_single_photo`` of the main camera."""
        return self._make_request(self._camera)

    def setpoint(self, flag: int, numbers: Sequence[float]) -> None:
        """Call ``joystick_action``, after ``set_joystick_mode`` if the flag has changed.

        Raises:
            ServiceError: a service did not answer.
        """
        if flag != self._flag:
            self._mode.call(self._mode_of(flag).request, within=SETPOINT_WITHIN)
            self._flag = flag
        x, y, z, yaw = numbers
        if not flag & HORIZONTAL:
            x, y = degrees(x), -degrees(y)
        else:
            x, y = (x, -y) if flag & Flag.BODY else (y, x)
        turn = -degrees(yaw) if flag & Flag.YAW_RATE else degrees(yaw_to_heading(yaw))
        command = {"x": x, "y": y, "z": z, "yaw": turn}
        self._joystick.call(
            self._make_request(self._joystick, joystickCommand=command).request, within=SETPOINT_WITHIN
        )

    def _mode_of(self, flag: int) -> ServiceRequest:
        return self._make_request(
            self._mode,
            horizontal_mode=(flag & HORIZONTAL) >> 6,
            vertical_mode=(flag >> 4) & 3,
            yaw_mode=int(bool(flag & Flag.YAW_RATE)),
            horizontal_coordinate=int(bool(flag & Flag.BODY)),
            stable_mode=int(bool(flag & Flag.STABLE)),
        )
