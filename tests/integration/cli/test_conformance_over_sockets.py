"""The checks over a socket, as over a real vehicle: what flies is asked for, others come by a second link."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.integration

HERE = "127.0.0.1"
FASTER = "4"
COMMAND = (sys.executable, "-c", "from volery.cli.main import main; main()")
WITHIN_S = 150


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with socket.create_server((HERE, 0)) as listener:
        port = listener.getsockname()[1]
    where = f"tcp://{HERE}:{port}"
    served = subprocess.Popen(
        [*COMMAND, "serve", "ardupilot", "--listen", where, "--speed", FASTER],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert served.stdout is not None
    assert any("Ctrl-C" in line for line in served.stdout)
    yield f"ardupilot+{where}"
    served.kill()
    served.wait(10)


def checked(address: str, folder: Path, *arguments: str) -> dict[str, dict[str, Any]]:
    command = [*COMMAND, "conformance", address, "--out", str(folder), *arguments]
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
    wanted = "takeoff,mode-change-while-idle,link-cut-for-a-moment,disarmed-midway"
    found = checked(address, tmp_path, "--only", wanted, "--fly", "--second", address)
    outcomes = {name: one["outcome"] for name, one in found.items()}
    assert outcomes == {
        "takeoff": "passed",
        "mode-change-while-idle": "passed",
        "link-cut-for-a-moment": "passed",
        "disarmed-midway": "not possible here",
    }
