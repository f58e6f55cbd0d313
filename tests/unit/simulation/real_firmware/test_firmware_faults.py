"""Faults of the world on real firmware: which way each kind goes, and what is said over the ground link."""

from __future__ import annotations

import re
import socket
from collections.abc import Set
from math import radians
from types import SimpleNamespace
from typing import Any

import pytest

from volery.base.errors import CapabilityError
from volery.base.frames import LocalFrame
from volery.base.time import MS, S
from volery.links.frame import Frame
from volery.links.mavlink_codec import MAVLINK
from volery.links.mavlink_messages import constant
from volery.model.faults import FAULTS
from volery.simulation.real_firmware.ardupilot import ArduPilotExchange
from volery.simulation.real_firmware.family import PROJECTS
from volery.simulation.real_firmware.firmware_faults import WAYS, FirmwareFaults
from volery.simulation.real_firmware.firmware_process import FirmwareError
from volery.simulation.real_firmware.ground_link import GroundLink
from volery.simulation.world.state_layout import (
    P_CAPACITY,
    S_AMPS,
    S_ATTITUDE,
    S_CHARGE,
    U_BARO_BLOCKED,
    U_GPS_BLOCKED,
    U_GPS_DRIFT,
    U_GPS_OFFSET,
    U_MAG_BLOCKED,
    U_MAG_TURN,
    WORLD,
)

OF_4_6 = dict.fromkeys(
    (
        "SIM_GPS_DISABLE",
        "SIM_BARO_FREEZE",
        "SIM_BAR2_FREEZE",
        "SIM_MAG1_FAIL",
        "SIM_MAG2_FAIL",
        "SIM_MAG3_FAIL",
        "SIM_MAG1_ORIENT",
        "SIM_MAG2_ORIENT",
        "SIM_MAG3_ORIENT",
        "SIM_RC_FAIL",
    ),
    0.0,
)
OF_4_7 = {name: value for name, value in OF_4_6.items() if name != "SIM_GPS_DISABLE"} | {
    "SIM_GPS1_ENABLE": 1.0
}
PERIOD = 10 * MS


class Firmware:
    """The other end of a ground link: a firmware of parameters alone, and faults that act on it."""

    def __init__(
        self,
        project: str,
        parameters: dict[str, float],
        *,
        stubborn: bool = False,
        stated: Set[str] = frozenset(),
    ) -> None:
        self.parameters = dict(parameters)
        self.version = 0x040603FF
        self.commands: list[tuple[int, float]] = []
        self.sets: list[tuple[str, float]] = []
        self._stubborn = stubborn
        self._parser = MAVLINK.parser()
        self._said = b""
        self.row = [0.0] * WORLD
        self.row[P_CAPACITY] = 18_000.0
        self._ground = GroundLink(self, LocalFrame(0.0, 0.0, 0.0), lambda: None)
        self.faults = FirmwareFaults(project, "drone_1: arducopter", self._ground, stated)
        self.now = 0

    def run(self, duration: int) -> None:
        """Let time pass."""
        for _ in range(duration // PERIOD):
            self.now += PERIOD
            self._ground.read()
            self.faults.act(self.now, self.row)

    def read(self) -> bytes:
        """See ``Connection``."""
        said, self._said = self._said, b""
        return said

    def write(self, octets: bytes) -> None:
        """See ``Connection``: answer."""
        for message in self._parser.feed(octets):
            fields = message.fields
            if message.name == "COMMAND_LONG":
                if fields["command"] == constant("MAV_CMD_REQUEST_MESSAGE"):
                    self._say("AUTOPILOT_VERSION", {"flight_sw_version": self.version})
                else:
                    self.commands.append((fields["command"], fields["param2"]))
                continue
            name = fields["param_id"]
            if message.name == "PARAM_SET":
                self.sets.append((name, fields["param_value"]))
                if not self._stubborn:
                    self.parameters[name] = fields["param_value"]
            if name in self.parameters:
                answer = {"param_id": name, "param_value": self.parameters[name], "param_type": 9}
                self._say("PARAM_VALUE", answer)

    def _say(self, name: str, fields: dict[str, Any]) -> None:
        self._said += MAVLINK.encode(Frame(name, fields, 1, 1), 0)

    def close(self) -> None:
        """See ``Connection``."""


@pytest.mark.parametrize("project", PROJECTS)
def test_each_kind_of_fault_has_a_way_to_the_firmwares_of_each_project(project: str) -> None:
    assert set(WAYS[project]) == set(FAULTS)


@pytest.mark.parametrize(
    ("parameters", "name", "healthy", "faulty"),
    [(OF_4_6, "SIM_GPS_DISABLE", 0.0, 1.0), (OF_4_7, "SIM_GPS1_ENABLE", 1.0, 0.0)],
)
def test_a_parameter_is_set_by_the_name_that_the_firmware_has_and_restored(
    parameters: dict[str, float], name: str, healthy: float, faulty: float
) -> None:
    firmware = Firmware("ardupilot", parameters)
    firmware.run(6 * S)
    assert firmware.sets == []
    firmware.row[U_GPS_BLOCKED] = 1.0
    firmware.run(S)
    assert firmware.sets == [(name, faulty)]
    firmware.row[U_GPS_BLOCKED] = 0.0
    firmware.run(S)
    assert firmware.sets == [(name, faulty), (name, healthy)]


def test_faults_of_several_sensors_end_each_for_itself_with_the_users_own_values() -> None:
    firmware = Firmware("ardupilot", OF_4_6 | {"SIM_MAG2_FAIL": 1.0})
    firmware.run(6 * S)
    firmware.row[U_BARO_BLOCKED] = firmware.row[U_MAG_BLOCKED] = 1.0
    firmware.run(S)
    frozen = {"SIM_BARO_FREEZE": 1.0, "SIM_BAR2_FREEZE": 1.0}
    failed = {"SIM_MAG1_FAIL": 2.0, "SIM_MAG2_FAIL": 2.0, "SIM_MAG3_FAIL": 2.0}
    assert firmware.parameters == OF_4_6 | frozen | failed
    firmware.row[U_MAG_BLOCKED] = 0.0
    firmware.run(S)
    assert firmware.parameters == OF_4_6 | frozen | {"SIM_MAG2_FAIL": 1.0}


def test_a_turned_compass_has_the_orientation_of_its_angle() -> None:
    firmware = Firmware("ardupilot", OF_4_6)
    firmware.run(6 * S)
    firmware.row[U_MAG_TURN] = radians(135.0)
    firmware.run(S)
    assert firmware.sets == [(f"SIM_MAG{number}_ORIENT", 3.0) for number in (1, 2, 3)]
    firmware.row[U_MAG_TURN] = 0.0
    firmware.run(S)
    assert firmware.parameters == OF_4_6


def test_a_fault_is_refused_by_name_once_it_is_known_that_its_parameter_is_missing() -> None:
    firmware = Firmware("ardupilot", OF_4_6)
    del firmware.parameters["SIM_GPS_DISABLE"]
    firmware.faults.require("gps-lost", "blind")  # it still boots
    words = r"fault blind: drone_1: arducopter 4\.6\.3 cannot be given gps-lost: .* SIM_GPS1_ENABLE or"
    with pytest.raises(CapabilityError, match=words):
        firmware.run(10 * S)
    with pytest.raises(CapabilityError, match=words):
        firmware.faults.require("gps-lost", "blind")
    firmware.faults.require("barometer-stuck", "deaf")


def test_parameters_that_the_firmware_lacks_are_named_after_its_boot() -> None:
    has = {f"OWN_{number}": 1.0 for number in range(200)}
    Firmware("ardupilot", OF_4_6 | has, stated=has.keys()).run(20 * S)
    firmware = Firmware("ardupilot", OF_4_6 | has, stated={*has, "NO_SUCH", "A_NAME_THAT_IS_MUCH_TOO_LONG"})
    firmware.run(10 * S)
    with pytest.raises(
        FirmwareError, match=r"drone_1: arducopter has no parameter A_NAME_\w+, NO_SUCH; leave"
    ):
        firmware.run(10 * S)
    firmware.run(S)  # it is said once


def test_a_version_that_keeps_a_battery_of_its_own_is_named() -> None:
    firmware = Firmware("ardupilot", OF_4_6)
    firmware.version = 0x040507FF
    firmware.run(6 * S)
    words = (
        r"fault low: drone_1: arducopter 4\.5\.7 cannot be given battery-low: from 4\.6 on .*; name a program"
    )
    with pytest.raises(CapabilityError, match=words):
        firmware.faults.require("battery-low", "low")


def test_a_fault_without_a_way_is_refused_with_the_remedy() -> None:
    firmware = Firmware("px4", {})
    with pytest.raises(
        CapabilityError, match=r"fault odd: .* cannot be given eclipse: .* simulated autopilot, or leave"
    ):
        firmware.faults.require("eclipse", "odd")


def test_a_firmware_that_does_not_take_up_a_parameter_ends_the_run() -> None:
    firmware = Firmware("ardupilot", OF_4_6, stubborn=True)
    firmware.run(6 * S)
    firmware.row[U_GPS_BLOCKED] = 1.0
    with pytest.raises(CapabilityError, match=r"not taken up SIM_GPS_DISABLE 1 within 2 s; it says 0"):
        firmware.run(3 * S)


def test_the_count_of_charge_is_set_when_the_world_sets_the_charge_and_only_then() -> None:
    firmware = Firmware("ardupilot", OF_4_6)
    firmware.row[S_AMPS] = 30.0
    for _ in range(3000):
        firmware.row[S_CHARGE] += 30.0 * 0.01
        firmware.run(PERIOD)
    assert firmware.commands == []
    firmware.row[S_CHARGE] = 0.75 * firmware.row[P_CAPACITY]
    firmware.run(S)
    assert firmware.commands == [(constant("MAV_CMD_BATTERY_RESET"), 25.0)]


def test_a_drift_of_the_receiver_is_in_position_and_velocity_and_ends_with_the_fault() -> None:
    world = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    firmware = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    with world, firmware:
        world.bind(("127.0.0.1", 0))
        firmware.settimeout(5.0)
        process: Any = SimpleNamespace(sockets=[world], instance=0)
        exchange = ArduPilotExchange(process, (0.0, 0.0, 0.0), lambda pulses: (), period=100 * MS)
        firmware.sendto(b"\x1a\x48" + bytes(38), world.getsockname())
        row = [0.0] * WORLD
        row[S_ATTITUDE] = 1.0

        def sent(at: int) -> list[str]:
            exchange.prepare(at, row, 0.0)
            exchange.send()
            text = firmware.recv(4096).decode()
            return re.findall(r'"(?:position|velocity)":\[([^]]*)\]', text)

        row[U_GPS_OFFSET] = 4.0
        row[U_GPS_DRIFT : U_GPS_DRIFT + 2] = [2.0, -1.0]
        assert sent(1) == ["4.2, -0.1, -0", "2, -1, -0"]
        assert sent(2) == ["4.4, -0.2, -0", "2, -1, -0"]
        row[U_GPS_DRIFT : U_GPS_DRIFT + 2] = [0.0, 0.0]
        assert sent(3) == ["4, 0, -0", "0, 0, -0"]
