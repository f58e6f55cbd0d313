"""``volery doctor``: installed parts, what each missing part would enable, how to install it."""

from __future__ import annotations

import platform
import shutil
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec

from rich.text import Text

from volery.base.extras import install_command
from volery.cli.command import FAILED, OK, Commands
from volery.cli.console import Output

commands = Commands("First steps")

MINIMUM_PYTHON = (3, 11)


@dataclass(frozen=True)
class Part:
    """Something that may be installed.

    ``find`` returns a version or a path, or an empty text if the part is missing.
    """

    name: str
    find: Callable[[], str]
    enables: str
    get: str
    needed: bool = False


@dataclass(frozen=True)
class Finding:
    """A part and what was found of it; ``found`` is empty if it is missing."""

    name: str
    found: str
    needed: bool
    enables: str
    get: str


def distribution(name: str) -> Callable[[], str]:
    """Return a function that finds a Python package by the name it is installed under."""

    def find() -> str:
        try:
            return version(name)
        except PackageNotFoundError:
            return ""

    return find


def module(name: str) -> Callable[[], str]:
    """Return a function that finds a Python module of any origin, such as Debian's."""

    def find() -> str:
        found = find_spec(name)
        return (found.origin or "installed") if found else ""

    return find


def program(*names: str) -> Callable[[], str]:
    """Return a function that finds a program by any of *names*."""
    return lambda: next((found for name in names if (found := shutil.which(name))), "")


def _python() -> str:
    return platform.python_version() if sys.version_info >= MINIMUM_PYTHON else ""


def _core(name: str, enables: str) -> Part:
    return Part(name, distribution(name), enables, f"pip install {name}", needed=True)


def _optional(name: str, extra: str, enables: str) -> Part:
    return Part(name, distribution(name), enables, install_command(extra))


PARTS: tuple[Part, ...] = (
    Part("Python 3.11 or newer", _python, "everything", "apt install python3", needed=True),
    _core("greenlet", "code that blocks, in virtual time"),
    _core("numpy", "arrays"),
    _core("pymavlink", "MAVLink: ArduPilot, PX4 and ground stations"),
    _core("pyserial", "radios and cables to real vehicles"),
    _core("mcap", "traces that Foxglove opens"),
    _core("pydantic", "run records and cost laws"),
    _core("shapely", "geofences"),
    _optional("numba", "simulation", "simulated vehicles, and the cost of C++ code on another processor"),
    _optional("ruamel.yaml", "model", "models and catalogues of processors"),
    _optional("rosbags", "ros", "ROS messages and bags, also without ROS"),
    _optional("jinja2", "report", "HTML reports"),
    Part("mavsdk", distribution("mavsdk"), "to fly `volery serve` with MAVSDK", "pip install 'mavsdk>=3,<4'"),
    Part("MAVProxy", distribution("MAVProxy"), "to fly `volery serve` by typing", "pip install MAVProxy"),
    Part("rospy", module("rospy"), "real ROS 1: the bridge, --graph ros1", "apt install python3-rospy"),
    Part("rclpy", module("rclpy"), "real ROS 2: the bridge, --graph ros2", "source your ROS 2 set-up"),
    Part(
        "g++ or clang++",
        program("g++", "clang++"),
        "components in C++ (language c++ or roscpp)",
        "apt install g++",
    ),
    Part(
        "LLVM 17 to 19",
        program("opt-19", "opt-18", "opt-17", "opt"),
        "cost of C++ code on another processor",
        "apt install clang-19 llvm-19",
    ),
    Part("addr2line", program("addr2line"), "the line where a C++ component crashed", "apt install binutils"),
    Part(
        "a browser",
        program("chromium", "chromium-browser", "google-chrome", "firefox"),
        "to open report.html",
        "apt install chromium",
    ),
)


@commands.add("json", "debug")
def doctor(output: Output) -> int:
    """Show which parts are installed, what each missing part would enable, and how to install it.

    Exit status: 0 if no necessary part is missing, 1 otherwise.
    """
    findings = [Finding(part.name, part.find(), part.needed, part.enables, part.get) for part in PARTS]
    for one in findings:
        output.show(_line(one))
    missing = [one.name for one in findings if one.needed and not one.found]
    output.show(f"missing: {', '.join(missing)}" if missing else "every necessary part is installed")
    output.give({"ok": not missing, "parts": [asdict(one) for one in findings]})
    return FAILED if missing else OK


def _line(one: Finding) -> Text:
    if one.found:
        return Text.assemble(
            ("✓ ", "green"), (f"{one.name} ", "bold"), one.found, (f"  {one.enables}", "dim")
        )
    mark = ("✗ ", "bold red") if one.needed else ("· ", "yellow")
    return Text.assemble(mark, (f"{one.name} ", "bold"), "missing", f"  {one.enables}: ", (one.get, "cyan"))
