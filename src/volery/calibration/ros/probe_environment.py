"""Environment of probes: a ROS graph of their own, their peers, and the command for each client library."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from volery.base.errors import LinkError, LinkSilent, UsageError, choices
from volery.calibration.ros.call_costs import Round, read_round
from volery.components.cpp.compiler import CppToolchain
from volery.ros.transports.ros1 import available
from volery.ros.transports.ros1.master import environment, own_roscore

CLIENTS = ("roscpp", "rospy", "rclpy")
PROBES = Path(str(files("volery.calibration.ros").joinpath("probes")))
MESSAGES = ("geometry_msgs", "sensor_msgs", "nav_msgs")
"""Packages of messages that nodes often include, used where they are installed."""

STOP_TIMEOUT_S = 10.0
LIMIT_S = 120.0
_DOMAIN = "77"


@dataclass(frozen=True)
class Pace:
    """Durations of a probe, ms; periods, sleeps and numbers of subscribers in the order of measurement."""

    block_ms: float = 600.0
    periods_ms: tuple[float, ...] = (20.0, 50.0)
    sleeps_ms: tuple[float, ...] = (5.0, 10.0, 20.0, 50.0, 100.0, 200.0)
    counts: tuple[int, ...] = (1, 2, 4, 8)

    def arguments(self) -> list[str]:
        """Return the arguments of a probe."""
        several = (self.periods_ms, self.sleeps_ms, self.counts)
        return [f"{self.block_ms:g}", *(",".join(f"{one:g}" for one in these) for these in several)]


@dataclass(frozen=True)
class ProbeSetup:
    """A ROS graph with peers: the command that starts a probe, and the environment of its node."""

    client: str
    command: tuple[str, ...]
    environment: Mapping[str, str]

    def probe(self, pace: Pace) -> Round:
        """Run a probe; raise ``LinkError`` with its last output if it fails."""
        try:
            done = subprocess.run(
                [*self.command, *pace.arguments()],
                env=self.environment,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                timeout=LIMIT_S,
                check=False,
                start_new_session=True,  # Ctrl-C is for the campaign: it keeps what was measured
            )
        except subprocess.TimeoutExpired as error:
            raise LinkSilent(f"the {self.client} probe did not end within {LIMIT_S:g} s") from error
        if done.returncode:
            lines = done.stderr.strip().splitlines()[-3:]
            raise LinkError(f"the {self.client} probe failed: {' / '.join(lines) or done.returncode}")
        return read_round(done.stdout.splitlines())


def check_client(client: str, python: str = "") -> None:
    """Raise ``UsageError`` naming what to install if a client library or a part of it is missing."""
    if client not in CLIENTS:
        raise UsageError(f"no client library {client!r}; there is {choices(CLIENTS)}")
    if client == "rclpy":
        _check_imports(python or sys.executable, "rclpy", "std_msgs.msg", "std_srvs.srv")
        return
    if shutil.which("roscore") is None:
        raise UsageError("no roscore on this machine: on Debian install python3-roslaunch and rosout")
    if not available():
        raise UsageError(
            "ROS 1 needs rospy, which this Python does not see: on Debian install python3-rospy and "
            "python3-std-msgs, then run scripts/ros1-modules VENV for the virtual environment"
        )
    if client == "roscpp":
        roscpp_flags()
    else:
        _check_imports(python or sys.executable, "rospy", "std_msgs.msg", "std_srvs.srv")


def _check_imports(python: str, *modules: str) -> None:
    program = "import " + ", ".join(modules)
    try:
        tried = subprocess.run(
            [python, "-c", program], capture_output=True, text=True, check=False, env=_for_ros2()
        )
    except OSError as error:
        raise UsageError(f"--python {python}: {error.strerror}") from error
    if tried.returncode:
        said = (tried.stderr.strip().splitlines() or ["it does not import"])[-1]
        raise UsageError(
            f"{python} does not see {modules[0]} ({said}): install {modules[0]} and its packages of std_msgs "
            f"and std_srvs (on Debian python3-rospy, python3-std-msgs, python3-std-srvs; for ROS 2 "
            f"scripts/ros2-venv), or name the Python that does with --python"
        )


def roscpp_flags() -> tuple[list[str], list[str]]:
    """Return the options for compiling and linking with roscpp; raise ``UsageError`` if it is missing."""
    if shutil.which("pkg-config") is None:
        raise UsageError("roscpp is found by pkg-config, which is not there: on Debian install pkg-config")
    there = [one for one in MESSAGES if not subprocess.call(["pkg-config", "--exists", one])]
    modules = ("roscpp", "std_msgs", "std_srvs", *there)
    found = []
    for option in ("--cflags", "--libs"):
        done = subprocess.run(["pkg-config", option, *modules], capture_output=True, text=True, check=False)
        if done.returncode:
            raise UsageError(
                f"no roscpp on this machine: on Debian install libroscpp-dev, libstd-msgs-dev and "
                f"libstd-srvs-dev (pkg-config says: {done.stderr.strip().splitlines()[0]})"
            )
        found.append(shlex.split(done.stdout))
    return found[0], found[1]


def roscpp_program(
    name: str, sources: Sequence[Path], flags: Sequence[str] = (), libraries: Sequence[str] = ()
) -> Path:
    """Compile and link a program with roscpp, reusing cached objects.

    Args:
        name: Name of the program, for error messages.
        sources: C++ files.
        flags: Options of the compiler.
        libraries: Libraries without the leading ``-l``.
    """
    compile_with, link_with = roscpp_flags()
    tools = CppToolchain(name)
    objects = [tools.object_file(source, flags=[*compile_with, *flags]) for source in sources]
    return tools.executable(objects, [*(f"-l{library}" for library in libraries), *link_with])


@contextmanager
def probe_setup(client: str, python: str = "") -> Iterator[ProbeSetup]:
    """Set up a ROS graph on loopback with the peers of a probe.

    Args:
        client: Client library of the probe.
        python: Interpreter that has rospy or rclpy, by default this one.
    """
    check_client(client, python)
    interpreter = python or sys.executable
    probe = (interpreter, str(PROBES / "python.py"), client)
    if client == "rclpy":
        with _sinks((interpreter, str(PROBES / "sinks.py"), "rclpy"), _for_ros2()):
            yield ProbeSetup(client, probe, _for_ros2())
        return
    command = (str(_roscpp_probe()),) if client == "roscpp" else probe
    with own_roscore() as core:
        surroundings = environment(core.uri)
        with _sinks((sys.executable, str(PROBES / "sinks.py"), "rospy"), surroundings):
            yield ProbeSetup(client, command, surroundings)


def _roscpp_probe() -> Path:
    return roscpp_program("the roscpp probe", [PROBES / "roscpp.cpp"])


def _for_ros2() -> dict[str, str]:
    """Return the environment of a ROS 2 domain on loopback, without settings of other installations."""
    kept = {
        key: value
        for key, value in os.environ.items()
        if key not in ("_ROS_WHEELS_BOOTSTRAP_COMPLETE", "LD_LIBRARY_PATH")
    }
    if "AMENT_PREFIX_PATH" in os.environ and "LD_LIBRARY_PATH" in os.environ:
        kept["LD_LIBRARY_PATH"] = os.environ["LD_LIBRARY_PATH"]  # a sourced installation needs it
    return {**kept, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": _DOMAIN}


@contextmanager
def _sinks(command: Sequence[str], surroundings: Mapping[str, str]) -> Iterator[None]:
    process = subprocess.Popen(
        command,
        env=surroundings,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        if process.stdout.readline() != b"ready\n":
            raise LinkSilent("the nodes that a probe talks to did not start")
        yield
    finally:
        process.stdin.close()
        try:
            process.wait(STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
