"""Gimbal and gripper against an end of the link that answers as the real PX4 1.14 with these devices does."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from rigs.missions import carried_out
from volery.base.errors import Refused
from volery.base.time import MS, S
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.links.in_process_link import in_process_pair
from volery.links.mavlink_messages import constant
from volery.vehicles.drivers.mavlink.services import MavlinkServices
from volery.vehicles.payload import Payload
from volery.vehicles.telemetry import Telemetry

TURN, TAKE = (constant(f"MAV_CMD_DO_GIMBAL_MANAGER_{name}") for name in ("PITCHYAW", "CONFIGURE"))
GRIPPER = constant("MAV_CMD_DO_GRIPPER")
ACCEPTED, TEMPORARILY_REJECTED, DENIED, IN_PROGRESS = 0, 1, 2, 5


class Carrier:
    """A vehicle whose gimbal has one master, and whose gripper takes 3 s."""

    def __init__(self, sender: tuple[int, int] | None = (255, 190)) -> None:
        self.kernel = VirtualKernel()
        link, self._end = in_process_pair(self.kernel, 5 * MS)
        self._end.receive(self._receive)
        services = MavlinkServices(
            self.kernel,
            Telemetry(self.kernel, "craft_1"),
            void,
            lambda name, **fields: link.send(Frame(name, TO | ZEROS | fields, 255, 190)),
            bytewise=True,
            home_first=False,
            sender=sender,
        )
        link.receive(services.receive)
        self.payload = Payload("craft_1", services)
        self.master = (0, 0)
        self.pointed: list[tuple[float, float]] = []
        self.moving = False
        self.asked: list[int] = []

    def _receive(self, frame: Frame) -> None:
        fields = frame.fields
        self.asked.append(fields["command"])
        if fields["command"] == TAKE:
            self.master = (round(fields["param1"]), round(fields["param2"]))
            self._answer(TAKE, ACCEPTED)
        elif fields["command"] == TURN:
            obeys = self.master == (frame.system, frame.component)
            if obeys:
                self.pointed.append((fields["param1"], fields["param2"]))
            self._answer(TURN, ACCEPTED if obeys else DENIED)
        elif fields["command"] == GRIPPER:
            self._answer(GRIPPER, TEMPORARILY_REJECTED if self.moving else IN_PROGRESS)
            if not self.moving:
                self.moving = True
                self.kernel.call_at(self.kernel.now() + 3 * S, self._moved)

    def _moved(self) -> None:
        self.moving = False
        self._answer(GRIPPER, ACCEPTED)

    def _answer(self, command: int, result: int) -> None:
        self._end.send(Frame("COMMAND_ACK", {"command": command, "result": result}, 1, 1))

    def carry_out(self, action: Callable[[], object]) -> Any:
        return carried_out(self.kernel, action)


TO = {"target_system": 1, "target_component": 1}
ZEROS = {"confirmation": 0} | dict.fromkeys([f"param{place}" for place in range(1, 8)], 0.0)


def void(_name: str, **_fields: Any) -> None:
    pass


def test_control_of_the_gimbal_is_taken_where_it_is_denied() -> None:
    carrier = Carrier()
    carrier.carry_out(lambda: carrier.payload.point_gimbal(-45.0, 10.0))
    carrier.carry_out(lambda: carrier.payload.point_gimbal(-30.0))
    assert carrier.pointed == [(-45.0, 10.0), (-30.0, 0.0)]
    assert carrier.asked == [TURN, TAKE, TURN, TURN]


def test_it_is_not_taken_where_nobody_knows_who_sends_the_commands() -> None:
    carrier = Carrier(sender=None)
    with pytest.raises(Refused, match="DENIED to MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW"):
        carrier.carry_out(lambda: carrier.payload.point_gimbal(-45.0))


def test_a_command_in_progress_is_not_sent_again() -> None:
    carrier = Carrier()
    carrier.carry_out(carrier.payload.open_gripper)
    assert carrier.asked == [GRIPPER]
    assert carrier.kernel.now() >= 3 * S
