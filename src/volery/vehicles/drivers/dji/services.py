"""Gimbal and camera of a DJI aircraft by topics and services of its SDK node, which offers nothing else.

Requests arrive as the MAVLink commands that ``vehicles.payload`` sends. The pitch is confirmed by the node's
``gimbal_angle``. The yaw is not: what it is measured from is a setting of the DJI Go app.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import isnan

from volery.base.errors import NotArrived, Refused
from volery.base.time import Ns, S
from volery.kernel.api import Kernel
from volery.ros.graph import ServiceError
from volery.ros.messages.dji_constants import GIMBAL_PITCHES
from volery.vehicles.drivers.dji.backend import DjiBackend
from volery.vehicles.drivers.dji.node_interfaces import ServiceRequest
from volery.vehicles.services import PartialServices, PlanItem

ANSWERED_WITHIN: Ns = 10 * S
AGAIN: Ns = 2 * S
TRIES = 3
NEAR_DEG = 2.0
_OFFER = (
    "the SDK node of a DJI offers gimbal and camera only; "
    "an ArduPilot or PX4 offers it, over MAVLink or MAVROS"
)


class DjiServices(PartialServices):
    """``Services`` of one aircraft: gimbal and camera.

    Args:
        kernel: clock and tasks.
        backend: the aircraft.
    """

    def __init__(self, kernel: Kernel, backend: DjiBackend) -> None:
        super().__init__(backend.telemetry.name, _OFFER)
        self._kernel = kernel
        self._backend = backend
        self._commands: Mapping[str, Callable[[str, Sequence[float]], None]] = {
            "MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW": self._point,
            "MAV_CMD_IMAGE_START_CAPTURE": self._take_picture,
        }

    def command(self, asked: str, command: str, *parameters: float, within: Ns = 0) -> None:
        """See ``Services``: a pitch and yaw of the gimbal, or a picture; ``CapabilityError`` otherwise."""
        handler = self._commands.get(command)
        if handler is None:
            raise self._unsupported(asked)
        with self._kernel.joined():
            handler(asked, parameters)

    def _point(self, asked: str, parameters: Sequence[float]) -> None:
        pitch, yaw = parameters[:2]
        low, high = GIMBAL_PITCHES
        if not low <= pitch <= high:
            raise Refused(self._name, asked, f"its pitch goes from {low:g} to {high:g} degrees")
        backend = self._backend
        backend.follow_gimbal()

        def points() -> bool:
            return abs(backend.decoder.gimbal_pitch - pitch) <= NEAR_DEG

        for _ in range(TRIES):  # on a topic a command may be lost, the first before the node has connected
            request = backend.interface.gimbal(pitch, yaw)
            if request is not None:
                self._call(asked, request, "its gimbal refuses, or there is none")
            if backend.telemetry.changed.wait_for(points, AGAIN, ends_activation=True):
                return
        seen = backend.decoder.gimbal_pitch
        what = "no angle of a gimbal arrives" if isnan(seen) else f"its pitch is {seen:.0f} degrees"
        raise NotArrived(self._name, asked, f"{what} after {TRIES} commands")

    def _take_picture(self, asked: str, _parameters: Sequence[float]) -> None:
        self._call(asked, self._backend.interface.picture(), "its camera refuses, or there is none")

    def _call(self, asked: str, request: ServiceRequest, refusal: str) -> None:
        """Call a service of the node and wait for its answer."""
        try:
            response = request.client.call(request.request, within=ANSWERED_WITHIN)
        except ServiceError as error:
            if error.by_server:
                raise Refused(self._name, asked, refusal) from error
            raise NotArrived(self._name, asked, str(error)) from error
        if not response.result:
            raise Refused(self._name, asked, refusal)

    def upload_items(self, kind: int, items: Sequence[PlanItem]) -> None:
        """Raise ``CapabilityError``: ``upload_mission()`` uploads missions."""
        raise self._unsupported("store a plan on board (upload_mission() stores a mission)")
