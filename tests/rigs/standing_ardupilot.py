"""A program that takes the place of an ArduCopter which stands disarmed, behind ArduPilot's JSON interface.

It is no firmware: it tests what starts, asks, records and ends one. Its arming checks pass after
``READY_AFTER``. A parameter ``SIM_ENDS_AT`` in its file of defaults ends it after that many simulated
seconds, with the exit code 3. With ``SIM_FAULTLESS`` it has no parameters by which its sensors fail.
"""

from __future__ import annotations

import re
import socket
import struct
import sys
from contextlib import suppress
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega as mavlink

FAULTS = (
    "SIM_GPS_DISABLE",
    "SIM_BARO_FREEZE",
    "SIM_BAR2_FREEZE",
    "SIM_MAG1_FAIL",
    "SIM_MAG2_FAIL",
    "SIM_MAG3_FAIL",
)
VERSION, COMMIT = 0x040603FF, b"92b0cd78"
CHECKED = mavlink.MAV_SYS_STATUS_PREARM_CHECK
READY_AFTER = 1.5
"""Simulated seconds."""


def write_program(path: Path) -> Path:
    """Write a program at *path* that becomes this one, and return the path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f'#!/bin/sh\nexec "{sys.executable}" "{__file__}" "$@"\n', encoding="utf-8")
    path.chmod(0o755)
    return path


class StandingArduPilot:
    """One instance, as its arguments describe it."""

    def __init__(self, arguments: list[str]) -> None:
        stated = dict(one.lstrip("-").split("=", 1) for one in arguments if "=" in one)
        instance = int(next(one[2:] for one in arguments if one.startswith("-I")))
        latitude, longitude, amsl, _ = map(float, stated["home"].split(","))
        self._place = int(latitude * 1e7), int(longitude * 1e7), int(amsl * 1e3)
        self._parameters = self._read(stated["defaults"])
        if "SIM_FAULTLESS" not in self._parameters:
            self._parameters |= dict.fromkeys(FAULTS, 0.0)
        self._world = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._world.settimeout(1.0)
        self._address = "127.0.0.1", 9002 + 10 * instance
        host, port = stated["serial0"].removeprefix("udpclient:").split(":")
        self._station = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._station.connect((host, int(port)))
        self._station.setblocking(False)
        self._mavlink = mavlink.MAVLink(None, srcSystem=int(stated["sysid"]), srcComponent=1)
        self._said = -1.0

    @staticmethod
    def _read(file: str) -> dict[str, float]:
        lines = [line.split() for line in Path(file).read_text("ascii").splitlines()]
        return {name: float(value) for name, value in lines}

    def run(self) -> int:
        """Ask and answer until it is ended."""
        self._print(f"standing at {self._place}")
        number = 0
        while True:
            question = struct.pack("<HHI16H", 18458, 400, number, *[1000] * 16)
            self._world.sendto(question, self._address)
            try:
                answer = self._world.recv(4096).decode()
            except TimeoutError:
                continue  # the same question again
            number += 1
            time = float(re.search(r'"timestamp":([0-9.e+-]+)', answer)[1])
            if time >= self._parameters.get("SIM_ENDS_AT", float("inf")):
                self._print("it ends as it was asked to")
                return 3
            self._hear()
            if time >= self._said + 0.25:
                self._said = time
                self._report(time)

    @staticmethod
    def _print(text: str) -> None:
        sys.stdout.write(f"{text}\n")
        sys.stdout.flush()

    def _hear(self) -> None:
        octets = b""
        with suppress(BlockingIOError):
            while True:
                octets += self._station.recv(4096)
        for message in self._mavlink.parse_buffer(octets) or []:
            if message.get_type() in ("PARAM_REQUEST_READ", "PARAM_SET"):
                self._answer(message)
            if (
                message.get_type() == "COMMAND_LONG"
                and message.param1 == mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION
            ):
                self._say(
                    mavlink.MAVLink_autopilot_version_message(
                        0, VERSION, 0, 0, 0, COMMIT, COMMIT, COMMIT, 0, 0, 0
                    )
                )

    def _answer(self, message: mavlink.MAVLink_message) -> None:
        """Answer for a parameter of the file of defaults; there is no other."""
        name = message.param_id
        if name in self._parameters:
            if message.get_type() == "PARAM_SET":
                self._parameters[name] = message.param_value
            value = self._parameters[name]
            kind = mavlink.MAV_PARAM_TYPE_REAL32
            self._say(mavlink.MAVLink_param_value_message(name.encode(), value, kind, 1, 0))

    def _report(self, time: float) -> None:
        ready = CHECKED if time >= READY_AFTER else 0
        self._say(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_QUADROTOR, 3, 1, 0, 3, 3))
        self._say(
            mavlink.MAVLink_sys_status_message(CHECKED, CHECKED, ready, 0, 16000, 0, 100, 0, 0, 0, 0, 0, 0)
        )
        located = mavlink.EKF_POS_HORIZ_ABS if ready else 0
        self._say(mavlink.MAVLink_ekf_status_report_message(located, 0, 0, 0, 0, 0))
        self._say(mavlink.MAVLink_global_position_int_message(int(time * 1e3), *self._place, 0, 0, 0, 0, 0))

    def _say(self, message: mavlink.MAVLink_message) -> None:
        self._station.sendall(message.pack(self._mavlink))


if __name__ == "__main__":
    sys.exit(StandingArduPilot(sys.argv[1:]).run())
