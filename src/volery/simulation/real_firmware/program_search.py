"""Which programs of real firmware there are, how they are found, and how users get one.

Nothing here needs an extra: ``volery doctor`` looks for programs, too.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from volery.base.errors import UsageError


class ProjectPrograms(NamedTuple):
    """The programs of a project whose firmware can fly a body of the simulated world.

    Attributes:
        programs: Usual name of its program by kind of vehicle.
        targets: Last words of the command that builds a program, by its name.
        output: Where that command writes programs, in the sources.
        sensors: Which sensors of the firmware are those of the world; the firmware simulates all others.
    """

    programs: Mapping[str, str]
    targets: Mapping[str, str]
    output: str
    sensors: str


PROGRAMS: Mapping[str, ProjectPrograms] = {
    "ardupilot": ProjectPrograms(
        {"multirotor": "arducopter", "rover": "ardurover"},
        {
            "arducopter": "./waf configure --board sitl; ./waf copter",
            "ardurover": "./waf configure --board sitl; ./waf rover",
        },
        "build/sitl/bin",
        "inertial sensors, pose, battery (from 4.6 on) and one range",
    ),
    "px4": ProjectPrograms(
        {"multirotor": "px4"},
        {"px4": "make px4_sitl_default"},
        "build/px4_sitl_default/bin",
        "inertial sensors, magnetometer, barometer, GPS, range and battery",
    ),
}
NOT_IN_STEP: Mapping[str, str] = {
    "paparazzi": "its simulator NPS keeps a time of its own; start it and fly by URL, such as "
    "paparazzi+udp://:4242",
    "dji": "its firmware runs on its aircraft only",
}
"""Why programs of other projects do not fly in lock step."""
_PROJECT_OF = {program: name for name, project in PROGRAMS.items() for program in project.targets}
USUAL_PROGRAMS = tuple(_PROJECT_OF)
"""Names of the programs of all projects."""


def project_of(program: str) -> str:
    """Return the project of a usual program."""
    return _PROJECT_OF[program]


def variable(program: str) -> str:
    """Return the environment variable that states the path of a usual program."""
    return f"VOLERY_{program.upper()}"


def how_to_get(program: str) -> str:
    """Return how users build a usual program and say where it is."""
    project = PROGRAMS[_PROJECT_OF[program]]
    return f"{project.targets[program]}, then {variable(program)}=SOURCES/{project.output}/{program}"


def find_program(name: str) -> Path:
    """Return the absolute path of a program.

    Args:
        name: Its path, or a name without ``/``. A usual name is that of the environment variable
            ``VOLERY_<NAME>``, where there is one; else it is searched on PATH.

    Raises:
        UsageError: There is no such program, or it cannot be executed.
    """
    source = ""
    if "/" in name:
        path = name
    elif name in _PROJECT_OF:
        path = os.environ.get(variable(name), "") or shutil.which(name) or ""
        if not path:
            raise UsageError(
                f"there is no {name} on PATH, and {variable(name)} does not state one; build it from its "
                f"sources: {how_to_get(name)}"
            )
        source = f" ({variable(name)})" if os.environ.get(variable(name)) else ""
    else:
        path = shutil.which(name) or ""
        if not path:
            raise UsageError(f"there is no program {name!r} on PATH; give its path, such as ./{name}")
    found = Path(path).absolute()
    if not found.is_file():
        raise UsageError(f"{path}{source}: there is no such program")
    if not os.access(found, os.X_OK):
        raise UsageError(f"{path}{source} cannot be executed; make it so with: chmod +x {path}")
    return found
