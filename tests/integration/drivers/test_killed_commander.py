"""In wall time, over a socket: the process that commands a vehicle is killed, and the next one finds it."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

import volery

pytestmark = pytest.mark.integration

HERE = "127.0.0.1"
FASTER = "4"
"""Simulated seconds a second: a boot takes three quarters of a minute of them."""
COMMAND = (sys.executable, "-c", "from volery.cli.main import main; main()")
MISSION = """
def mission(drone):
    drone.wait_ready(within=300)
    drone.takeoff(8)
    print("up", flush=True)
    while True:
        drone.hold()
        drone.set_velocity(north=0.5, lasting=1.0)
"""


def free_port() -> int:
    with socket.create_server((HERE, 0)) as listener:
        return int(listener.getsockname()[1])


@contextmanager
def child(arguments: Sequence[str]) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen([*COMMAND, *arguments], stdout=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        process.kill()
        process.wait(300)


def line_of(process: subprocess.Popen[str], word: str) -> str:
    """The first line with *word* in it; empty if the process ends before."""
    assert process.stdout is not None
    return next((line for line in process.stdout if word in line), "")


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4", "paparazzi"])
def test_a_commander_is_killed_in_flight(autopilot: str, tmp_path: Path) -> None:
    mission = tmp_path / "mission.py"
    mission.write_text(MISSION)
    where = f"tcp://{HERE}:{free_port()}"
    url = f"{autopilot}+{where}"
    with child(["vehicle", "serve", autopilot, "--listen", where, "--speed", FASTER]) as vehicle:
        assert line_of(vehicle, "Ctrl-C")
        with child(["fly", str(mission), "--on", url, "--out", str(tmp_path / "run")]) as commander:
            assert "up" in line_of(commander, "up")
            commander.send_signal(signal.SIGKILL)
            assert commander.wait(300) == -signal.SIGKILL
        assert vehicle.poll() is None
        with volery.connect(url) as drone:
            assert drone.telemetry.last_message_ns >= 0
            words = drone.come_to_rest()
            left = "is left to the pilot or station" in words
            assert left or not drone.armed, words
        assert vehicle.poll() is None
