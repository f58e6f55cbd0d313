"""Real ROS 1 and ROS 2, and what talks to them beside us. Without them tests skip; in CI they fail."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from rigs.requirements import lacking
from volery.base.time import MS, S
from volery.kernel.task import ExecutionContext
from volery.kernel.wall import WallKernel
from volery.ros.graph import Node
from volery.ros.transports.ros1 import Roscore, available, ros1_graph
from volery.ros.transports.ros1.master import environment, own_roscore
from volery.ros.transports.transport_graph import TransportGraph
from volery.trace.events import Text

HERE = Path(__file__).parent
LIMIT_S = 300
"""Longest time of one program: some seconds, many times as long on a busy machine."""
LIMIT = 120 * S
"""Longest time until something happens that takes much less than a second; DDS may need several."""


def python_of(distribution: str) -> str:
    found = Path(sys.prefix) / f"ros2-{distribution}" / "bin" / "python"
    if not found.exists():
        lacking(f"no environment with ROS 2 {distribution} (scripts/ros2-venv {sys.prefix} {distribution})")
    return str(found)


_claimed: list[socket.socket] = []


def unused_domain() -> int:
    """A domain of ROS 2 that no other test on this machine uses; it is claimed until this process ends."""
    for domain in range(1, 102):  # those beyond have ports that Linux gives to whoever asks for any
        claim = socket.socket(socket.AF_UNIX)
        with suppress(OSError):  # taken
            claim.bind(f"\0volery-tests-ros2-domain-{domain}")
            _claimed.append(claim)
            return domain
        claim.close()
    raise AssertionError("all domains are taken")


def surroundings() -> dict[str, str]:
    """Loopback, a domain of one's own, and nothing of what another rclpy has left behind."""
    leaked = ("_ROS_WHEELS_BOOTSTRAP_COMPLETE", "LD_LIBRARY_PATH", "PYTHONPATH", "VIRTUAL_ENV")
    kept = {key: value for key, value in os.environ.items() if key not in leaked}
    return {**kept, "ROS_DOMAIN_ID": str(unused_domain()), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


@pytest.fixture(scope="session")
def roscore() -> Iterator[Roscore]:
    """One for all tests, since a process knows one master."""
    if not available() or shutil.which("roscore") is None:
        lacking("no rospy or no roscore here (scripts/debian-packages ros1, scripts/ros1-modules)")
    before = {key: os.environ.get(key) for key in ("ROS_IP", "ROS_MASTER_URI")}
    os.environ["ROS_IP"] = "127.0.0.1"
    with own_roscore() as core:
        yield core
    for key, value in before.items():
        os.environ.pop(key, None)
        if value is not None:
            os.environ[key] = value


class Ours(NamedTuple):
    """Our side: a graph on the clock on the wall, within a task."""

    graph: TransportGraph
    texts: list[str]

    def spinning(self, name: str, **options: Any) -> Node:
        node = self.graph.node(name, **options)
        self.graph.kernel.spawn(node.spin, f"spins {name}", ExecutionContext(name))
        return node

    def until(self, holds: Callable[[], object], what: str, within: int = LIMIT) -> None:
        kernel = self.graph.kernel
        end = kernel.now() + within
        while not holds():
            assert kernel.now() < end, f"not in time: {what}; told: {self.texts}"
            kernel.sleep_until(kernel.now() + 10 * MS)


@pytest.fixture
def ours(roscore: Roscore) -> Iterator[Ours]:
    texts: list[str] = []
    kernel = WallKernel(lambda event: texts.append(event.text) if isinstance(event, Text) else None)
    with kernel.adopt("test"):
        graph = ros1_graph(kernel, master=roscore.uri, start_master=False)
        yield Ours(graph, texts)
        graph.close()
    assert kernel.close() == []


Run = Callable[..., str]


@pytest.fixture
def ros(roscore: Roscore) -> Run:
    """Run one of Debian's command-line tools; gives what it printed."""

    def run(*command: str, fails: bool = False) -> str:
        done = subprocess.run(
            command,
            env=environment(roscore.uri),
            capture_output=True,
            text=True,
            timeout=LIMIT_S,
            check=False,
        )
        assert fails or done.returncode == 0, done.stdout + done.stderr
        return done.stdout + (done.stderr if fails else "")

    return run


Start = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def start(roscore: Roscore) -> Iterator[Start]:
    """Start a program that is ended with the test."""
    started: list[subprocess.Popen[str]] = []

    def run(*command: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            command, env=environment(roscore.uri), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        started.append(process)
        return process

    yield run
    for process in started:
        with suppress(ProcessLookupError):
            process.send_signal(signal.SIGINT)  # roscpp says good-bye at nothing else
        try:
            process.communicate(timeout=5)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()


@pytest.fixture(scope="session")
def roscpp_peer(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The program of ``roscpp_peer.cpp``, compiled against Debian's libroscpp."""
    if shutil.which("g++") is None or shutil.which("pkg-config") is None:
        lacking("no g++ or no pkg-config here")
    asked = ["pkg-config", "--cflags", "--libs", "roscpp", "std_msgs", "std_srvs"]
    flags = subprocess.run(asked, capture_output=True, text=True, check=False)
    if flags.returncode:
        lacking("no libroscpp here (scripts/debian-packages roscpp)")
    program = tmp_path_factory.mktemp("roscpp") / "peer"
    subprocess.run(
        ["g++", "-O0", "-o", str(program), str(HERE / "roscpp_peer.cpp"), *flags.stdout.split()],
        check=True,
        timeout=LIMIT_S,
    )
    return str(program)
