"""``volery doctor``: what is installed, what each missing part would enable, how to get it."""

from __future__ import annotations

import platform
import shutil
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec

from rich.text import Text

from volery.cli.console import Output
from volery.cli.endings import FAILED, OK

LEAST_PYTHON = (3, 11)


@dataclass(frozen=True)
class Part:
    """Something that may be installed: how to find it, what it is for, how to get it."""

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
    """Finds a Python package by the name it is installed under."""

    def find() -> str:
        try:
            return version(name)
        except PackageNotFoundError:
            return ""

    return find


def module(name: str) -> Callable[[], str]:
    """Finds a Python module wherever it comes from, such as Debian's or a sourced workspace."""

    def find() -> str:
        found = find_spec(name)
        return (found.origin or "installed") if found else ""

    return find


def program(*names: str) -> Callable[[], str]:
    """Finds a program by any of its names."""
    return lambda: next((found for name in names if (found := shutil.which(name))), "")


def _python() -> str:
    return platform.python_version() if sys.version_info >= LEAST_PYTHON else ""


def _needed(name: str, enables: str) -> Part:
    return Part(name, distribution(name), enables, f"pip install {name}", needed=True)


PARTS: tuple[Part, ...] = (
    Part("Python 3.11 or newer", _python, "everything", "apt install python3", needed=True),
    _needed("greenlet", "component code that blocks, in virtual time"),
    _needed("numpy", "arrays of the world's state"),
    _needed("numba", "the compiled world: physics and inner control loops"),
    _needed("pymavlink", "MAVLink: ArduPilot and ground stations"),
    _needed("pyserial", "radios and cables to real vehicles"),
    _needed("rosbags", "ROS message types without ROS"),
    _needed("mcap", "traces that Foxglove opens"),
    _needed("pydantic", "models and run records"),
    _needed("ruamel.yaml", "models with line numbers"),
    _needed("jinja2", "reports"),
    Part(
        "mavsdk", distribution("mavsdk"), "flying `volery vehicle` with MAVSDK", "pip install 'mavsdk>=3,<4'"
    ),
    Part("MAVProxy", distribution("MAVProxy"), "fly `volery vehicle` by typing", "pip install MAVProxy"),
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
        "what blocks of C++ code cost on another processor",
        "apt install clang-19 llvm-19",
    ),
    Part("addr2line", program("addr2line"), "the line where a C++ component crashed", "apt install binutils"),
    Part(
        "a browser",
        program("chromium", "chromium-browser", "google-chrome", "firefox"),
        "looking at report.html",
        "apt install chromium",
    ),
)


def examine() -> list[Finding]:
    """Look for every part."""
    return [Finding(part.name, part.find(), part.needed, part.enables, part.get) for part in PARTS]


def doctor(output: Output) -> int:
    """Show what there is; 0 if nothing that is needed is missing."""
    findings = examine()
    for one in findings:
        output.show(_line(one))
    missing = [one.name for one in findings if one.needed and not one.found]
    output.show(f"missing: {', '.join(missing)}" if missing else "everything that is needed is here")
    output.give({"ok": not missing, "parts": [asdict(one) for one in findings]})
    return FAILED if missing else OK


def _line(one: Finding) -> Text:
    if one.found:
        return Text.assemble(
            ("✓ ", "green"), (f"{one.name} ", "bold"), one.found, (f"  {one.enables}", "dim")
        )
    mark = ("✗ ", "bold red") if one.needed else ("· ", "yellow")
    return Text.assemble(mark, (f"{one.name} ", "bold"), "missing", f"  {one.enables}: ", (one.get, "cyan"))
