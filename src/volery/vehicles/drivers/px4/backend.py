"""What can be sent to a PX4, and how it is sent over MAVLink."""

from __future__ import annotations

from collections.abc import Sequence
from math import nan, radians
from typing import Any, NamedTuple, Protocol

from volery.base.errors import UsageError, VoleryError
from volery.base.position import AMSL, Position
from volery.base.time import Ns
from volery.kernel.task import ExecutionContext
from volery.links.mavlink_messages import constant
from volery.vehicles.driver import Acceleration, AttitudeTarget, ManualControl
from volery.vehicles.drivers.mavlink.backend import (
    ATTITUDE_AND_YAW_RATE,
    INT_FRAMES,
    VELOCITY_AND_YAW_RATE,
    Ack,
    Backend,
    acceleration_fields,
)
from volery.vehicles.drivers.mavlink.client import FirmwareTraits, MavlinkClient
from volery.vehicles.drivers.mavlink.services import MavlinkServices
from volery.vehicles.drivers.px4.decoder import PX4Decoder
from volery.vehicles.drivers.px4.events import (
    LARGEST_FILE,
    EventTexts,
    path_of_events,
    path_on_board,
    uncompressed,
)
from volery.vehicles.drivers.px4.modes import LINK_LOSS_PARAMETERS, MODES
from volery.vehicles.drivers.px4.versions import COVERAGE, PARAMETER_RULES
from volery.vehicles.drivers.steps import DRONE_KIND
from volery.vehicles.telemetry import Velocity

PX4_FIRMWARE = FirmwareTraits(
    number=constant("MAV_AUTOPILOT_PX4"),
    name="PX4",
    called="a PX4",
    oldest=(1, 12),
    coverage=COVERAGE,
    estimator="ESTIMATOR_STATUS",
    turning=ATTITUDE_AND_YAW_RATE,  # with all three rates it takes the rates as a set-point of their own
    parameter_rules=PARAMETER_RULES,
    bytewise=True,
)

_LOCAL_NED = constant("MAV_FRAME_LOCAL_NED")
_NO_PITCH = -1.0
_CHANGE_MODE = float(constant("MAV_DO_REPOSITION_FLAGS_CHANGE_MODE"))
"""In DO_REPOSITION: enter AUTO.LOITER. Without this flag PX4 refuses the command, but flies there."""
_NO_SPEED = -1.0
"""In DO_REPOSITION: speed unchanged."""


class OffboardSetpoint(NamedTuple):
    """A set-point of OFFBOARD: velocity, and yaw rate in degrees/s.

    An acceleration, where given, takes the place of the velocity.
    """

    velocity: Velocity
    yaw_rate: float = 0.0
    acceleration: Acceleration | None = None


def reposition_fields(goal: Position, heading: float | None) -> dict[str, Any]:
    """Return DO_REPOSITION as the fields of a COMMAND_INT; the altitude of *goal* is AMSL.

    Without a heading, in degrees, PX4 turns as its parameters say.
    """
    return {
        "frame": INT_FRAMES[AMSL],
        "command": constant("MAV_CMD_DO_REPOSITION"),
        "param1": _NO_SPEED,
        "param2": _CHANGE_MODE,
        "param4": nan if heading is None else radians(heading),
        "x": round(goal.latitude * 1e7),
        "y": round(goal.longitude * 1e7),
        "z": goal.altitude.metres,
    }


def manual_control_axes(control: ManualControl, kind: str) -> dict[str, int]:
    """Return the axes of MANUAL_CONTROL: -1000..1000, and throttle 0..1000 with its centre at 500."""
    throttle = control.throttle if kind == DRONE_KIND else (control.throttle + 1.0) / 2.0
    return {
        "x": round(1000 * control.pitch),
        "y": round(1000 * control.roll),
        "z": round(1000 * throttle),
        "r": round(1000 * control.yaw),
    }


class PX4Backend(Backend, Protocol):
    """Commands of PX4 beyond those of every MAVLink autopilot."""

    @property
    def last_heartbeat_ns(self) -> Ns:
        """Time of the last heartbeat: the known mode is as old as that, up to a second."""

    def takeoff(self, amsl: float) -> None:
        """Climb, armed on the ground, to an altitude in m AMSL; at least its MIS_TAKEOFF_ALT."""

    def reposition(self, goal: Position, heading: float | None) -> None:
        """Enter AUTO.LOITER and go to *goal*, whose altitude is AMSL; *heading* in degrees."""

    def send_setpoint(self, setpoint: OffboardSetpoint | AttitudeTarget) -> None:
        """Send one set-point of the stream that OFFBOARD needs."""

    def send_manual_control(self, control: ManualControl) -> None:
        """Send one sample of the stream that manual modes need."""

    def rewind_mission(self) -> None:
        """Make the mission begin at its first item."""


class PX4Mavlink(MavlinkClient):
    """PX4 on a MAVLink link. See ``PX4Backend``."""

    firmware = PX4_FIRMWARE
    _decoder: PX4Decoder
    _event_texts_read = False

    def _make_decoder(self, record: bool) -> PX4Decoder:
        return PX4Decoder(
            self._kernel,
            self.telemetry,
            record=record,
            request=self._request_events,
            on_unknown=self._read_event_texts,
        )

    def _requested_parameters(self) -> Sequence[str]:
        return LINK_LOSS_PARAMETERS

    @property
    def last_heartbeat_ns(self) -> Ns:
        """Time of the last heartbeat."""
        return self._decoder.last_heartbeat_ns

    def _on_refusal(self, key: str) -> None:
        if key == Ack.ARM and not self.telemetry.armed and not self._decoder.add_failing_checks():
            self.request_arming_checks()

    def request_arming_checks(self) -> None:
        """Send RUN_PREARM_CHECKS, which reports all failing checks; without it only changes are reported."""
        self._command("MAV_CMD_RUN_PREARM_CHECKS")

    def failing_checks(self) -> Sequence[str]:
        """Return the arming checks that forbid to arm in the present mode."""
        return self._decoder.failing_checks()

    def lasting_reasons(self, since: Ns) -> Sequence[str]:
        """Return the arming checks that fail and that waiting does not mend."""
        return self._decoder.lasting_reasons()

    def _read_event_texts(self) -> None:
        """Read the vehicle's own texts of events, once, on the ground: some 16 kB by MAVLink FTP."""
        if self._event_texts_read or self.telemetry.armed:
            return
        self._event_texts_read = True
        name = f"texts of events of {self.telemetry.name}"

        def read() -> None:
            try:
                texts = read_event_texts(self.services)
            except (VoleryError, ValueError):
                return  # their numbers are shown
            with self._kernel.interact():
                self._decoder.set_event_texts(texts)

        self._kernel.spawn(read, name, ExecutionContext(self.telemetry.name))

    def _request_events(self, first: int, last: int) -> None:
        self._send_to("REQUEST_EVENT", first_sequence=first, last_sequence=last)

    def set_mode(self, mode: str) -> None:
        """Send DO_SET_MODE."""
        number = MODES.get(mode)
        if number is None:
            raise UsageError(f"{self.telemetry.name} has no mode {mode!r}")
        custom = constant("MAV_MODE_FLAG_CUSTOM_MODE_ENABLED")
        self._command("MAV_CMD_DO_SET_MODE", custom, number.main, number.sub)

    def takeoff(self, amsl: float) -> None:
        """Send NAV_TAKEOFF, whose altitude PX4 takes as AMSL."""
        self._command("MAV_CMD_NAV_TAKEOFF", _NO_PITCH, 0, 0, nan, nan, nan, amsl)

    def reposition(self, goal: Position, heading: float | None) -> None:
        """Send DO_REPOSITION."""
        self._send_to("COMMAND_INT", **reposition_fields(goal, heading))

    def send_setpoint(self, setpoint: OffboardSetpoint | AttitudeTarget) -> None:
        """Send SET_ATTITUDE_TARGET, or SET_POSITION_TARGET_LOCAL_NED in frame 1; PX4 accepts only 1 and 8."""
        if isinstance(setpoint, AttitudeTarget):
            self.send_attitude(setpoint)
            return
        if setpoint.acceleration is not None:
            fields = acceleration_fields(setpoint.acceleration, setpoint.yaw_rate)
            self._send_to("SET_POSITION_TARGET_LOCAL_NED", **fields)
            return
        north, east, up = setpoint.velocity
        self._send_to(
            "SET_POSITION_TARGET_LOCAL_NED",
            coordinate_frame=_LOCAL_NED,
            type_mask=VELOCITY_AND_YAW_RATE,
            vx=north,
            vy=east,
            vz=-up,
            yaw=0.0,
            yaw_rate=radians(setpoint.yaw_rate),
        )

    def send_manual_control(self, control: ManualControl) -> None:
        """Send MANUAL_CONTROL."""
        axes = manual_control_axes(control, self.telemetry.kind)
        self._send("MANUAL_CONTROL", target=self._system or 0, **axes)

    def rewind_mission(self) -> None:
        """Send MISSION_SET_CURRENT."""
        self._send_to("MISSION_SET_CURRENT", seq=0)


def read_event_texts(services: MavlinkServices) -> EventTexts:
    """Return the texts of events that the vehicle keeps on board.

    Raises:
        VoleryError: it keeps none, or does not answer.
        ValueError: what it keeps is no file of events.
    """
    general = path_on_board(services.metadata_uri())
    path = path_of_events(_on_board(services, general)) if general else ""
    if not path:
        raise ValueError("the vehicle names no file of events on board")
    return EventTexts(_on_board(services, path))


def _on_board(services: MavlinkServices, path: str) -> bytes:
    files = services.files
    size = files.open(path)
    try:
        data = b""
        while len(data) < min(size, LARGEST_FILE):
            part = files.read(path, len(data))
            if not part:
                break
            data += part
    finally:
        files.close()
    return uncompressed(path, data)
