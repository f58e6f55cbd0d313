"""ArduPilot's camera: pictures by command, switch, mission item, time and distance.

A servo presses its trigger (CAM1_TYPE 1), or components of the vehicle get each command (5). There is no
picture: CAMERA_FEEDBACK reports where one would have been taken. CAM1_TYPE counts from the next boot on.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import degrees, hypot
from typing import Any

from volery.base.frames import Vector
from volery.base.time import US, Ns, from_seconds
from volery.simulation.autopilots.ardupilot.feature import Feature, Kept, MissionCommand, as_command
from volery.simulation.autopilots.ardupilot.servo_outputs import write
from volery.simulation.autopilots.mavlink.messages import (
    ACCEPTED,
    EPOCH_US,
    FAILED,
    UNSUPPORTED,
    Command,
    Fields,
    Handler,
    finite,
)
from volery.simulation.autopilots.onboard_mission import MissionItem
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

SERVO, COMPONENTS = 1, 5
"""CAM1_TYPE."""
TRIGGER = 10
"""SERVOn_FUNCTION."""
DIGICAM_CONFIGURE, DIGICAM_CONTROL, TRIGGER_DISTANCE, START_CAPTURE, STOP_CAPTURE = 202, 203, 206, 2000, 2001
SET_ZOOM, SET_FOCUS, SET_SOURCE, START_VIDEO, STOP_VIDEO = 531, 532, 534, 2500, 2501
"""Commands that a camera by servo or relay takes as mission items only, without an effect."""
"""MAV_CMD."""
SHOOT = 1
"""Shooting command of DIGICAM_CONTROL."""
WITHOUT_END = -1
CAMERA_SWITCH = 9
"""RCn_OPTION."""


@dataclass
class CameraState:
    """Camera."""

    kind: int | None = None
    """Type that the vehicle has booted with; ``None``: not known yet."""
    pictures: int = 0
    taken_at: Ns = NEVER
    place: Vector | None = None
    """Where the last picture was taken, or the distance to the next one counts from."""
    pressed_until: Ns = NEVER
    """Until when the servo presses the trigger."""
    pending: bool = False
    """Whether a picture came too early and is taken later."""
    period: Ns = 0
    left: int = 0
    """Pictures that are still to be taken in that period; negative: without end."""
    feedback: dict[str, Any] = field(default_factory=dict)
    """Report of the last picture."""
    has_components: bool = False
    """Whether a component of the vehicle has been received that may be a camera."""


camera_of = Kept(CameraState)


def _present(vehicle: AutopilotVehicle) -> bool:
    return camera_of(vehicle).kind in (SERVO, COMPONENTS)


def take_picture(vehicle: AutopilotVehicle) -> bool:
    """Take a picture and return whether it was taken now.

    One that comes before CAM1_INTRVAL_MIN has passed since the last is taken then; one that comes while the
    servo still presses the trigger is not taken.
    """
    camera, now = camera_of(vehicle), vehicle.kernel.now()
    if not _present(vehicle):
        return False
    too_early = camera.taken_at != NEVER and now - camera.taken_at < from_seconds(
        vehicle.parameters["CAM1_INTRVAL_MIN"]
    )
    camera.pending = too_early
    if too_early or camera.pressed_until > now:
        return False
    if camera.kind == SERVO:
        write(vehicle, TRIGGER, round(vehicle.parameters["CAM1_SERVO_ON"]))
        camera.pressed_until = now + from_seconds(vehicle.parameters["CAM1_DURATION"])
    else:
        _forward(vehicle, DIGICAM_CONTROL, 0.0, 0.0, 0.0, 0.0, float(SHOOT))
    camera.pictures += 1
    camera.taken_at, camera.place = now, vehicle.estimate.position
    camera.feedback = _feedback_now(vehicle, camera)
    vehicle.output.send_event("CAMERA_FEEDBACK", camera.feedback)
    return True


def _forward(vehicle: AutopilotVehicle, number: int, *params: float) -> None:
    """Send a command to the components of the vehicle, if one has been received."""
    if camera_of(vehicle).has_components:
        values = {f"param{place}": 0.0 for place in range(1, 8)}
        values |= {f"param{place}": value for place, value in enumerate(params, start=1)}
        fields = {"target_system": 0, "target_component": 0, "command": number, "confirmation": 0, **values}
        vehicle.output.send_event("COMMAND_LONG", fields)


def on_component(vehicle: AutopilotVehicle, _fields: dict[str, Any], sender: int) -> None:
    """Handle HEARTBEAT of a component of the vehicle."""
    if sender == vehicle.system:
        camera_of(vehicle).has_components = True


def update_camera(vehicle: AutopilotVehicle) -> None:
    """Release the trigger, and take the pictures that are due by time or distance, at each tick."""
    camera, parameters, now = camera_of(vehicle), vehicle.parameters, vehicle.kernel.now()
    if camera.kind is None:
        camera.kind = round(parameters["CAM1_TYPE"])
    if not _present(vehicle):
        return
    if camera.kind == SERVO and camera.pressed_until <= now:
        write(vehicle, TRIGGER, round(parameters["CAM1_SERVO_OFF"]))
    if camera.pending:
        take_picture(vehicle)
    if camera.left:
        if (camera.taken_at == NEVER or now - camera.taken_at > camera.period) and take_picture(vehicle):
            camera.left -= camera.left > 0
    elif _due_by_distance(vehicle, camera):
        take_picture(vehicle)


def _due_by_distance(vehicle: AutopilotVehicle, camera: CameraState) -> bool:
    """Return whether the vehicle is CAM1_TRIGG_DIST away from the last picture, or from where it was set."""
    parameters, estimate = vehicle.parameters, vehicle.estimate
    every, most_roll = parameters["CAM1_TRIGG_DIST"], parameters["CAM_MAX_ROLL"]
    if every <= 0.0:
        camera.place = None
        return False
    not_now = parameters["CAM_AUTO_ONLY"] and vehicle.mode.name != "AUTO"
    leans = most_roll > 0.0 and abs(degrees(estimate.attitude[0])) > most_roll
    if not_now or leans or not estimate.position_ok:
        return False
    here = estimate.position
    if camera.place is None:
        camera.place = here
    return hypot(here[0] - camera.place[0], here[1] - camera.place[1]) >= every


def _feedback_now(vehicle: AutopilotVehicle, camera: CameraState) -> Fields:
    estimate = vehicle.estimate
    latitude, longitude, amsl = estimate.geodetic
    roll, pitch, yaw = (degrees(angle) for angle in estimate.attitude)
    return {
        "time_usec": EPOCH_US + vehicle.kernel.now() // US,
        "img_idx": camera.pictures,
        "lat": round(latitude * 1e7),
        "lng": round(longitude * 1e7),
        "alt_msl": amsl,
        "alt_rel": vehicle.height,
        "roll": roll,
        "pitch": pitch,
        "yaw": yaw % 360.0,
    }


def feedback(vehicle: AutopilotVehicle) -> Fields | None:
    """Return CAMERA_FEEDBACK of the last picture, empty before the first; ``None`` without a camera."""
    return camera_of(vehicle).feedback if _present(vehicle) else None


def _control(vehicle: AutopilotVehicle, params: tuple[float, ...]) -> None:
    """Take a picture or give the order to the components; params as in DIGICAM_CONTROL, from the first."""
    if int(params[4]) == SHOOT:
        take_picture(vehicle)
    elif camera_of(vehicle).kind == COMPONENTS:
        _forward(vehicle, DIGICAM_CONTROL, *params)


def _set_distance(vehicle: AutopilotVehicle, metres: float, at_once: bool) -> None:
    vehicle.parameters.set("CAM1_TRIGG_DIST", metres)
    if at_once:
        take_picture(vehicle)


def on_digicam_control(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_DIGICAM_CONTROL: param5 is 1 for a picture."""
    params = (command.param1, command.param2, command.param3, command.param4, command.fifth, command.sixth)
    _control(vehicle, params)
    return ACCEPTED


def on_digicam_message(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int) -> None:
    """Handle the deprecated DIGICAM_CONTROL."""
    names = ("session", "zoom_pos", "zoom_step", "focus_lock", "shot", "command_id")
    _control(vehicle, tuple(float(fields[name]) for name in names))


def on_digicam_configure(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_DIGICAM_CONFIGURE, which is for the components."""
    if camera_of(vehicle).kind == COMPONENTS:
        params = (command.param1, command.param2, command.param3, command.param4)
        _forward(vehicle, DIGICAM_CONFIGURE, *params, command.fifth, command.sixth, finite(command.z))
    return ACCEPTED


def on_trigger_distance(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_SET_CAM_TRIGG_DIST: param1 metres between pictures, 0 none; param3 is 1 for one at once."""
    _set_distance(vehicle, command.param1, command.param3 == 1.0)
    return ACCEPTED


def on_start_capture(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle IMAGE_START_CAPTURE: param2 seconds between param3 pictures, 0 without end; 0 and 0 is one."""
    camera, period, count = camera_of(vehicle), command.param2, round(command.param3)
    if command.param1 < 0.0:
        return UNSUPPORTED
    if command.param1 > 1.0 or not _present(vehicle):
        return FAILED
    if count == 1 or (period == 0.0 and count == 0):
        return ACCEPTED if take_picture(vehicle) else FAILED
    camera.period, camera.left = from_seconds(max(0.0, period)), count or WITHOUT_END
    return ACCEPTED


def on_stop_capture(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle IMAGE_STOP_CAPTURE."""
    if not 0.0 <= command.param1 <= 1.0 or (command.param1 == 1.0 and not _present(vehicle)):
        return UNSUPPORTED
    camera_of(vehicle).left = 0
    return ACCEPTED


CAMERA_COMMANDS: Mapping[int, Handler] = {
    DIGICAM_CONFIGURE: on_digicam_configure,
    DIGICAM_CONTROL: on_digicam_control,
    TRIGGER_DISTANCE: on_trigger_distance,
    START_CAPTURE: on_start_capture,
    STOP_CAPTURE: on_stop_capture,
}


def act_on_camera(vehicle: AutopilotVehicle, item: MissionItem) -> None:
    """Execute the mission item DO_DIGICAM_CONTROL or DO_SET_CAM_TRIGG_DIST."""
    if item.command == DIGICAM_CONTROL:
        _control(vehicle, (item.param1, item.param2, item.param3, item.param4, float(item.x), float(item.y)))
    else:
        _set_distance(vehicle, item.param1, item.param3 == 1.0)


def picture_by_switch(vehicle: AutopilotVehicle, position: int) -> None:
    """Take a picture when the switch goes up."""
    if position > 0:
        take_picture(vehicle)


COPTER = Feature(
    parameters={
        "CAM1_TYPE": ("", "from the next boot on: 1 a camera with a servo, 5 with commands to components"),
        "CAM1_DURATION": ("s", "time for which the servo presses the trigger"),
        "CAM1_INTRVAL_MIN": ("s", "least time between two pictures"),
        "CAM1_SERVO_OFF": ("µs", "pulse width of the servo that does not press"),
        "CAM1_SERVO_ON": ("µs", "pulse width of the servo that presses"),
        "CAM1_TRIGG_DIST": ("m", "distance between two pictures; 0: none by distance"),
        "CAM_AUTO_ONLY": ("", "any value but 0: pictures by distance in AUTO only"),
        "CAM_MAX_ROLL": ("°", "largest roll for pictures by distance; 0: any"),
    },
    commands=CAMERA_COMMANDS,
    messages={"DIGICAM_CONTROL": on_digicam_message, "HEARTBEAT": on_component},
    items={
        DIGICAM_CONTROL: MissionCommand("DigiCamCtrl", act_on_camera, silent=True),
        TRIGGER_DISTANCE: MissionCommand("SetCamTrigDst", act_on_camera, silent=True),
        DIGICAM_CONFIGURE: MissionCommand("DigiCamCfg", as_command(on_digicam_configure), silent=True),
        START_CAPTURE: MissionCommand("ImageStartCapture", as_command(on_start_capture), silent=True),
        STOP_CAPTURE: MissionCommand("ImageStopCapture", as_command(on_stop_capture), silent=True),
        SET_ZOOM: MissionCommand("SetCameraZoom", silent=True),
        SET_FOCUS: MissionCommand("SetCameraFocus", silent=True),
        SET_SOURCE: MissionCommand("SetCameraSource", silent=True),
        START_VIDEO: MissionCommand("VideoStartCapture", silent=True),
        STOP_VIDEO: MissionCommand("VideoStopCapture", silent=True),
    },
    switches={CAMERA_SWITCH: picture_by_switch},
    on_tick=update_camera,
    telemetry={"CAMERA_FEEDBACK": feedback},
)
ROVER = replace(
    COPTER, items={**COPTER.items, TRIGGER_DISTANCE: MissionCommand("SetCamTrigDst", act_on_camera)}
)
