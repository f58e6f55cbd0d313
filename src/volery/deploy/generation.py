"""Write the packages of a deployment: one for each computer, one for verification, and a README."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from volery.base.errors import UsageError, choices
from volery.deploy import ros1, ros2
from volery.deploy.content import MODEL_FOLDER, VERIFICATION, Computer, computers, model_files
from volery.model.instances import Instance
from volery.model.system import System
from volery.run.distributed.call_types import INTERFACES, call_types, package_name

GRAPHS = {1: ros1, 2: ros2}
"""Generators by the version of ROS."""
MARK = ".volery-deployment"
"""A file in the folder of a deployment: what was generated before may be replaced."""
_EXECUTABLE = 0o755


@dataclass(frozen=True)
class Deployment:
    """What was written: the folder, the packages by computer, and those of simulation and of types."""

    folder: Path
    packages: dict[str, str]
    verification: str
    interfaces: str


def deploy(system: System, folder: Path, ros: int) -> Deployment:
    """Write the packages of *system* for a version of ROS into *folder*.

    Args:
        system: The model with the allocation to deploy.
        folder: New or empty, or of an earlier deployment, which is replaced.
        ros: 1 or 2.

    Raises:
        CapabilityError: A component cannot be hosted there.
        UsageError: The folder holds something else, or a file of the model is outside the model's folder.
    """
    if ros not in GRAPHS:
        raise UsageError(f"--ros {ros}: there is {choices(map(str, GRAPHS))}")
    generator = GRAPHS[ros]
    found = computers(system)
    verification = package_name(system.name, VERIFICATION)
    types = call_types(system)
    _prepare(folder)
    _write(folder / types.package, generator.interface_files(types, system))
    for one in found:
        package = folder / one.package
        _write(package, generator.computer_files(one, system))
        _copy_model(system, tuple(each.instance for each in one.hosted), package, one.package, ros)
    _write(folder / verification, generator.verification_files(system, found))
    _copy_model(system, system.instances, folder / verification, verification, ros)
    (folder / "README.md").write_text(_readme(system, found, verification, ros), encoding="utf-8")
    packages = {one.processor.name: one.package for one in found}
    return Deployment(folder, packages, verification, types.package)


def _prepare(folder: Path) -> None:
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder} is not a folder")
    if folder.is_dir() and any(folder.iterdir()):
        if not (folder / MARK).is_file():
            raise UsageError(
                f"{folder} holds something that no deployment wrote: give an empty or a new folder"
            )
        for line in (folder / MARK).read_text(encoding="utf-8").splitlines():
            if line and "/" not in line and line not in (".", ".."):
                shutil.rmtree(folder / line, ignore_errors=True)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / MARK).write_text("", encoding="utf-8")
    except OSError as error:
        raise UsageError(f"{folder}: {error.strerror}") from error


def _write(package: Path, files: Iterable[tuple[Path, str]]) -> None:
    with (package.parent / MARK).open("a", encoding="utf-8") as mark:
        mark.write(f"{package.name}\n")
    for name, text in files:
        path = package / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        if text.startswith("#!"):
            path.chmod(_EXECUTABLE)


def _copy_model(system: System, instances: tuple[Instance, ...], package: Path, name: str, ros: int) -> None:
    """Copy the model with the code of *instances*; of the others, an empty file stands for the code."""
    root = package / name if ros == 2 else package
    for source, target in model_files(system, instances):
        path = root / target
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, path)
    for one in system.instances:
        if one.component.path:
            elsewhere = root / MODEL_FOLDER / one.component.path
            if not elsewhere.exists():  # the model names it; this computer does not execute it
                elsewhere.parent.mkdir(parents=True, exist_ok=True)
                elsewhere.touch()


def _readme(system: System, found: tuple[Computer, ...], verification: str, ros: int) -> str:
    rows = [
        f"| {one.processor.name} ({one.processor.kind}, {one.processor.frequency_mhz:g} MHz) | `{one.package}` | "
        f"{', '.join(each.instance.name for each in one.hosted)} | "
        f"{', '.join(each.vehicle for each in one.bridged)} |"
        for one in found
    ]
    steps = _ROS1 if ros == 1 else _ROS2
    chosen = f"allocation `{system.allocation}`" + (
        f", scenario `{system.scenario}`" if system.scenario else ""
    )
    return "\n".join(
        [
            f"# {system.name} on its computers",
            "",
            f"Generated from the model of {system.name}, {chosen}. Do not edit: generate it again. "
            "Parameters in `config/` may be edited on a computer.",
            "",
            "| computer | package | components | vehicles |",
            "|---|---|---|---|",
            *rows,
            "",
            "Every package needs volery in the Python that executes it: `pip install 'volery[simulation]'`.",
            f"Calls between components are services `/<component>/<operation>` of the types in `{package_name(system.name, INTERFACES)}`, "
            "topics are topics. Components need no built package of types; other nodes that call them do.",
            "",
            steps.format(
                first=found[0].package,
                verification=verification,
                packages=" ".join(one.package for one in found),
            ),
        ]
    )


_ROS1 = """## Build and start

```sh
mkdir -p ws/src && cp -r * ws/src && cd ws && catkin_make && . devel/setup.bash
roslaunch {verification} {verification}.launch      # all on one computer, with simulated vehicles
roslaunch {first} {first}.launch                    # on the computer itself, with its autopilots
```

In reality one computer executes `roscore`; `ROS_MASTER_URI` on the others names it. For a start at boot copy the unit
in `systemd/` to `/etc/systemd/system`, and the rules in `udev/` to `/etc/udev/rules.d` after adapting them to the autopilots.
"""

_ROS2 = """## Build and start

```sh
mkdir -p ws/src && cp -r * ws/src && cd ws && colcon build && . install/setup.bash
ros2 launch {verification} {verification}.launch.py      # all on one computer, with simulated vehicles
ros2 launch {first} {first}.launch.py                    # on the computer itself, with its autopilots
```

Without colcon, `pip install ./{first}` installs the same entry points. All computers use the same `ROS_DOMAIN_ID`. For a
start at boot copy the unit in `systemd/` to `/etc/systemd/system`, and the rules in `udev/` to `/etc/udev/rules.d` after
adapting them to the autopilots.
"""
