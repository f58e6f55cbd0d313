"""Where the examples are, how commands are started as processes, and how a test waits for one of them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[3]
COMMAND = (sys.executable, "-c", "from volery.cli.main import main; main()")
WITHIN_S = 300
"""Wall seconds: far more than anything here takes, so that a hang ends as a failure."""


ONE_DRONE = """
volery: 1
name: one-drone
components:
  Pilot:
    language: python
    path: pilot.py
    requires: {drone: Drone}
    active: true
    at: {processor: rpi4-cortex-a72, frequency: 1500 MHz}
    activation: {time: 1 ms}
application:
  pilot: {is: Pilot, drone: drone_1}
platform:
  processors:
    onboard: {is: rpi4-cortex-a72, frequency: 1500 MHz, carried_by: drone_1}
allocations:
  only: {pilot: onboard}
environment:
  origin: {latitude: 43.4717, longitude: -3.7997, amsl: 12 m}
  places:
    pad: {east: 0 m, north: 0 m}
  vehicles:
    drone_1: {kind: multirotor, autopilot: ardupilot, at: pad, battery: 5 Ah}
run:
  duration: 30 min
"""

PILOT = """
import volery

class Pilot:
    def __init__(self, drone):
        self._drone = drone

    def run(self):
        self._drone.takeoff(8)
        volery.log("up")
"""


@pytest.fixture(scope="session")
def one_drone() -> Callable[..., Path]:
    """Writes a model of one drone into a folder: it takes off, and then what a test wants it to do."""

    def write(folder: Path, then: str, *changes: tuple[str, str]) -> Path:
        text = ONE_DRONE
        for old, new in changes:
            assert old in text, old
            text = text.replace(old, new, 1)
        (folder / "model.yaml").write_text(text)
        (folder / "pilot.py").write_text(PILOT + then)
        return folder

    return write


@pytest.fixture(scope="session")
def delivery(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy: the runs of a comparison read the same files, also while somebody edits the example."""
    kept = tmp_path_factory.mktemp("examples") / "delivery"
    return shutil.copytree(REPOSITORY / "examples" / "delivery", kept)


@pytest.fixture(scope="session")
def mission_file() -> Path:
    return REPOSITORY / "examples" / "mission.py"


class Commands:
    """``volery`` as processes of their own in one folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._started: list[subprocess.Popen[str]] = []

    def start(
        self, *arguments: object, prelude: str = "", terminal: int | None = None, **environment: str
    ) -> subprocess.Popen[str]:
        """Begin a command.

        *prelude* is Python that its process runs first, *terminal* the controlling terminal of a session.
        """
        if terminal is not None:
            prelude = f"import fcntl, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0); {prelude}"
        command = [*COMMAND[:2], f"{prelude}\n{COMMAND[2]}", *map(str, arguments)]
        process = subprocess.Popen(
            command,
            cwd=self.folder,
            env={**os.environ, **environment},
            stdin=terminal,
            stdout=subprocess.PIPE if terminal is None else terminal,
            stderr=subprocess.PIPE if terminal is None else terminal,
            start_new_session=terminal is not None,
            text=True,
        )
        self._started.append(process)
        return process

    def run(
        self, *arguments: object, prelude: str = "", **environment: str
    ) -> subprocess.CompletedProcess[str]:
        """A command from its start to its end."""
        process = self.start(*arguments, prelude=prelude, **environment)
        return self.end_of(process)

    def end_of(self, process: subprocess.Popen[str]) -> subprocess.CompletedProcess[str]:
        """Wait for the end of a command that was started."""
        out, err = process.communicate(timeout=WITHIN_S)
        return subprocess.CompletedProcess(process.args, process.returncode, out, err)

    def until(self, process: subprocess.Popen[str], holds: Callable[[], bool]) -> None:
        """Wait, on the process's own end, until *holds*."""
        for _ in range(WITHIN_S * 20):
            if holds():
                return
            try:
                process.wait(timeout=0.05)
            except subprocess.TimeoutExpired:
                continue
            break
        pytest.fail(f"it ended, or took too long: {process.stderr.read() if process.stderr else ''}")

    def close(self) -> None:
        """Nothing that was started outlives its test."""
        for process in self._started:
            process.kill()
            process.communicate()


@pytest.fixture
def commands(tmp_path: Path) -> Iterator[Commands]:
    commands = Commands(tmp_path)
    yield commands
    commands.close()
