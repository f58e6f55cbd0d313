"""A served vehicle for clients that others wrote, and a ground station made of pymavlink alone."""

from __future__ import annotations

import os
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing
from importlib.util import find_spec
from time import monotonic
from typing import Any, NamedTuple

import pytest

from rigs.requirements import lacking

HERE = "127.0.0.1"
WITHIN_S = 200.0
"""Longer than anything here takes on a busy machine; nothing waits so long unless it fails."""

AGAIN_S = 6.0

COMMAND = (sys.executable, "-c", "from volery.cli.main import main; main()")


class Served(NamedTuple):
    """A vehicle in a process of its own, and the port where it listens or to which it sends."""

    process: subprocess.Popen[str]
    port: int


def a_free_port(kind: int = socket.SOCK_STREAM) -> int:
    with closing(socket.socket(socket.AF_INET, kind)) as free:
        free.bind((HERE, 0))
        return int(free.getsockname()[1])


def served(
    carrier: str, speed: float, *options: str, autopilot: str = "ardupilot", query: str = ""
) -> Served:
    """Start ``volery vehicle serve`` and wait for the line that says it can be reached."""
    port = a_free_port(socket.SOCK_DGRAM if carrier == "udp" else socket.SOCK_STREAM)
    where = ("--listen", f"{carrier}://{HERE}:{port}{query}", "--speed", str(speed))
    command = [*COMMAND, "vehicle", "serve", autopilot, *where, *options]
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, env=environment, text=True)
    assert process.stdout is not None
    ready, _, _ = select.select([process.stdout], [], [], WITHIN_S)
    line = process.stdout.readline() if ready else ""
    if f"serving {autopilot}" not in line:
        process.kill()
        process.wait()
        pytest.fail(f"the server said {line!r} instead of that it serves")
    return Served(process, port)


def ended(process: subprocess.Popen[str]) -> int:
    """Interrupt it as Ctrl-C does; its exit status."""
    process.send_signal(signal.SIGINT)
    try:
        return process.wait(WITHIN_S)
    finally:
        process.kill()
        process.communicate()


@pytest.fixture
def serve() -> Iterator[Callable[..., Served]]:
    """``serve(carrier, speed, *options)``: vehicles that end with the test, each as Ctrl-C ends it.

    ``autopilot`` is which, ``query`` what follows the address that it is served at.
    """
    running: list[Served] = []

    def start(carrier: str = "tcp", speed: float = 20.0, *options: str, **about: str) -> Served:
        running.append(served(carrier, speed, *options, **about))
        return running[-1]

    try:
        yield start
    finally:
        statuses = [ended(one.process) for one in running]
    assert statuses == [0] * len(running), "a server had ended, or did not end well"


@pytest.fixture(scope="session")
def free_port() -> Callable[..., int]:
    """``free_port(kind=SOCK_STREAM)``: one that nobody uses now."""
    return a_free_port


@pytest.fixture(scope="session")
def require() -> Callable[[str, str], None]:
    """Skip for want of a client package; where everything is required, fail."""

    def installed(module: str, package: str) -> None:
        if find_spec(module) is None:
            lacking(f"{package} is not installed (pip install {package})")

    return installed


STREAMED_S = 0.02


class Station:
    """A ground station of pymavlink's ``mavutil`` alone; ``texts`` keeps what was said. ``streams`` is sent
    fifty times a second, whatever it waits for.
    """

    streams: Callable[[], None] | None = None

    def __init__(self, url: str, system: int = 255) -> None:
        os.environ["MAVLINK20"] = "1"
        from pymavlink import mavutil

        self.mavlink = mavutil.mavlink
        self.connection = mavutil.mavlink_connection(url, source_system=system, source_component=190)
        self.texts: list[str] = []
        self._beaten = self._streamed = -1.0

    def close(self) -> None:
        self.connection.close()

    def wait(
        self,
        kind: str | tuple[str, ...],
        holds: Callable[[Any], bool] = lambda message: True,
        within: float = WITHIN_S,
    ) -> Any:
        """The next message of that kind for which *holds*; keeps a heartbeat of its own going."""
        kinds = (kind,) if isinstance(kind, str) else kind
        end = monotonic() + within
        while monotonic() < end:
            self._beat()
            message = self.connection.recv_match(blocking=True, timeout=STREAMED_S if self.streams else 0.2)
            if message is None:
                continue
            if message.get_type() == "STATUSTEXT":
                self.texts.append(message.text)
            if message.get_type() in kinds and holds(message):
                return message
        raise AssertionError(f"no such {kind} within {within} s; last texts: {self.texts[-4:]}")

    def wait_text(self, start: str) -> None:
        """Until a text that begins so has come; texts come before or after the answer they explain."""
        if not any(text.startswith(start) for text in self.texts):
            self.wait("STATUSTEXT", lambda message: message.text.startswith(start))

    def _beat(self) -> None:
        if self.streams is not None and monotonic() - self._streamed > STREAMED_S:
            self._streamed = monotonic()
            self.streams()
        if monotonic() - self._beaten > 0.2:
            self._beaten = monotonic()
            self.connection.mav.heartbeat_send(self.mavlink.MAV_TYPE_GCS, 8, 0, 0, 0)

    def meet(self) -> Any:
        """Hear the vehicle, ask for its streams."""
        beat = self.wait("HEARTBEAT", lambda message: message.get_srcComponent() == 1)
        self.connection.target_system, self.connection.target_component = 1, 1
        self.connection.mav.request_data_stream_send(1, 1, 0, 4, 1)
        self.connection.param_set_send("DISARM_DELAY", 0)  # a busy client is no idle pilot
        return beat

    def command(self, number: int, *values: float) -> int:
        """Send a COMMAND_LONG; the result it is acknowledged with. As stations do, it is sent again where no
        acknowledgement comes: UDP may lose either.
        """
        padded = [*values, *(0.0,) * (7 - len(values))]
        for confirmation in range(round(WITHIN_S / AGAIN_S)):
            self.connection.mav.command_long_send(1, 1, number, confirmation, *padded)
            try:
                return int(self.wait("COMMAND_ACK", lambda ack: ack.command == number, AGAIN_S).result)
            except AssertionError as nothing:
                missing = nothing
        raise missing

    def mode(self, name: str) -> int:
        number = self.connection.mode_mapping()[name]
        return self.command(self.mavlink.MAV_CMD_DO_SET_MODE, 1, number)

    def arm(self) -> int:
        return self.command(self.mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)

    def takeoff(self, height: float) -> int:
        """Up, until it is there."""
        result = self.command(self.mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, height)
        if result == self.mavlink.MAV_RESULT_ACCEPTED:
            self.wait_height(height)
        return result

    def wait_height(self, height: float) -> Any:
        return self.wait(
            "GLOBAL_POSITION_INT", lambda message: abs(message.relative_alt / 1000 - height) < 0.5
        )

    def wait_ready(self) -> None:
        """Until the checks before arming are passed and there is a place to fly from."""
        prearm = self.mavlink.MAV_SYS_STATUS_PREARM_CHECK
        self.wait("GPS_RAW_INT", lambda message: message.fix_type >= 3)
        self.wait("EKF_STATUS_REPORT", lambda message: message.flags & self.mavlink.EKF_POS_HORIZ_ABS)
        self.wait("SYS_STATUS", lambda message: message.onboard_control_sensors_health & prearm)

    def wait_armed(self, armed: bool = True) -> Any:
        return self.wait(
            "HEARTBEAT",
            lambda beat: (
                beat.get_srcComponent() == 1
                and bool(beat.base_mode & self.mavlink.MAV_MODE_FLAG_SAFETY_ARMED) == armed
            ),
        )

    def airborne(self, height: float = 10.0) -> None:
        """From boot to hovering in GUIDED."""
        self.meet()
        self.wait_ready()
        assert self.mode("GUIDED") == 0
        while self.arm() != 0:  # the checks pass when no position is needed before they do for GUIDED
            self.wait("SYS_STATUS")
        assert self.takeoff(height) == 0


@pytest.fixture
def station() -> Iterator[Callable[..., Station]]:
    """``station(url)``: ground stations that are closed when the test ends."""
    opened: list[Station] = []

    def connect(url: str, system: int = 255) -> Station:
        opened.append(Station(url, system))
        return opened[-1]

    yield connect
    for one in opened:
        one.close()
