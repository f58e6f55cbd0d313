"""The checks over a socket, as over a real vehicle: what flies is asked for, others come by a second link.

Whatever a check leaves in the air is landed before the next one, and when the command is ended by a signal.
"""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from pymavlink import mavutil

pytestmark = pytest.mark.integration

HERE = "127.0.0.1"
COMMAND = (sys.executable, "-c", "from volery.cli.main import main; main()")
WITHIN_S = 300


@contextmanager
def served(autopilot: str, faster: int) -> Iterator[str]:
    with socket.create_server((HERE, 0)) as listener:
        port = listener.getsockname()[1]
    where = f"tcp://{HERE}:{port}"
    vehicle = subprocess.Popen(
        [*COMMAND, "vehicle", "serve", autopilot, "--listen", where, "--speed", str(faster)],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert vehicle.stdout is not None
    try:
        assert any("Ctrl-C" in line for line in vehicle.stdout)
        yield f"{autopilot}+{where}"
    finally:
        vehicle.kill()
        vehicle.wait(WITHIN_S)


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with served("ardupilot", 2) as url:  # on a busy machine it would arrive before it is sent elsewhere
        yield url


def is_armed(address: str) -> bool:
    """What an independent station sees."""
    where = address.partition("+")[2].replace("tcp://", "tcp:")
    station = mavutil.mavlink_connection(where, source_system=254)
    try:
        heartbeat = station.recv_match(type="HEARTBEAT", blocking=True, timeout=WITHIN_S)
        assert heartbeat is not None
        return bool(heartbeat.base_mode & mavutil.mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
    finally:
        station.close()


def checked(address: str, folder: Path, *arguments: str) -> dict[str, dict[str, Any]]:
    command = [*COMMAND, "vehicle", "conformance", address, "--out", str(folder), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=WITHIN_S, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    report = json.loads((folder / "conformance.json").read_text(encoding="utf-8"))
    return {one["check"]: one for one in report["results"]}


def test_nothing_moves_without_leave(address: str, tmp_path: Path) -> None:
    found = checked(address, tmp_path, "--only", "identification,readiness,takeoff,wrong-system-id")
    assert found["identification"]["outcome"] == "passed"
    assert found["readiness"]["outcome"] == "passed"
    assert found["takeoff"]["outcome"] == "not possible here"
    assert "--fly" in found["takeoff"]["detail"]
    assert "--second" in found["wrong-system-id"]["detail"]


def test_with_leave_and_a_second_link(address: str, tmp_path: Path) -> None:
    wanted = "takeoff,sent-elsewhere-by-another,mode-change-while-idle,link-cut-for-a-moment,disarmed-midway"
    found = checked(address, tmp_path, "--only", wanted, "--fly", "--second", address)
    outcomes = {name: one["outcome"] for name, one in found.items()}
    assert outcomes == {
        "takeoff": "passed",
        "sent-elsewhere-by-another": "passed",
        "mode-change-while-idle": "passed",
        "link-cut-for-a-moment": "passed",
        "disarmed-midway": "not possible here",
    }
    assert not is_armed(address)


def test_a_px4_that_other_programs_have_commanded(tmp_path: Path) -> None:
    wanted = "home-moved-by-another,commander-silence"
    with served("px4", 8) as px4:
        found = checked(px4, tmp_path, "--only", wanted, "--fly", "--second", px4)
        assert {one["outcome"] for one in found.values()} == {"passed"}, found
        assert not is_armed(px4)


def test_sigterm_lands_it_and_keeps_the_results(address: str, tmp_path: Path) -> None:
    arguments = ("--only", "takeoff,goto,hold", "--fly", "--out", str(tmp_path))
    running = subprocess.Popen(
        [*COMMAND, "vehicle", "conformance", address, *arguments],
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
    )
    assert running.stderr is not None
    lines = []
    for line in running.stderr:  # not a terminal: a line for each check
        lines.append(line)
        if "takeoff: passed" in line:
            break
    partial = json.loads((tmp_path / "conformance.json").read_text(encoding="utf-8"))
    assert [one["check"] for one in partial["results"]] == ["takeoff"]
    station = mavutil.mavlink_connection(address.partition("+")[2].replace("tcp://", "tcp:"))
    armed = mavutil.mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    assert any(
        station.recv_match(type="HEARTBEAT", blocking=True, timeout=WITHIN_S).base_mode & armed
        for _ in range(200)
    )
    station.close()
    running.send_signal(signal.SIGTERM)
    _, said = running.communicate(timeout=WITHIN_S)
    assert running.returncode == 1
    assert "interrupted after 1 checks" in said
    assert "NOT DOWN" not in said
    kept = json.loads((tmp_path / "conformance.json").read_text(encoding="utf-8"))
    assert kept["interrupted"]
    assert not kept["left"]
    assert [one["outcome"] for one in kept["results"]] == ["passed"]
    assert not is_armed(address)
