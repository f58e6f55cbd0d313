"""Write the packages of a deployment: one for each computer, one for verification, and a README."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from volery.base.errors import UsageError, choices
from volery.base.files import read_text, write_text
from volery.deploy import ros1, ros2
from volery.deploy.content import MODEL_FOLDER, VERIFICATION, Computer, computers, model_files
from volery.deploy.texts import markdown
from volery.model.instances import Instance
from volery.model.system import System
from volery.run.assembly.cpp import is_cpp
from volery.run.distributed.call_types import call_types, package_name

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
    surroundings = tuple(instance for instance in system.instances if instance.is_environment)
    contents: dict[str, tuple[Iterable[tuple[Path, str]], tuple[Instance, ...] | None]]
    contents = {types.package: (generator.interface_files(types, system), None)}
    for one in found:
        hosted = tuple(each.instance for each in one.hosted)
        contents[one.package] = (generator.computer_files(one, system), hosted)
    contents[verification] = (generator.verification_files(system, found), surroundings)
    try:
        earlier = _earlier(folder, contents)
        with TemporaryDirectory(prefix=".volery-", dir=folder) as made:
            for name, (files, instances) in contents.items():
                _write(Path(made) / name, files)
                if instances is not None:
                    _copy_model(system, instances, Path(made) / name, name, ros)
            _write(
                Path(made), [(Path("README.md"), _readme(system, found, verification, types.package, ros))]
            )
            _write(Path(made), [(Path(MARK), "".join(f"{name}\n" for name in contents))])
            _replace(folder, Path(made), earlier, contents)
    except OSError as error:
        raise UsageError(f"{folder}: cannot be written: {error.strerror or error}") from error
    packages = {one.processor.name: one.package for one in found}
    return Deployment(folder, packages, verification, types.package)


def _earlier(folder: Path, names: Iterable[str]) -> list[str]:
    """Make *folder* and return the packages of an earlier deployment in it.

    A symbolic link is never followed: another user may have put it there.

    Raises:
        UsageError: The folder holds something that would be overwritten and that no deployment wrote.
    """
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        raise UsageError(f"{folder} is {'a symbolic link' if folder.is_symlink() else 'not a folder'}")
    folder.mkdir(parents=True, exist_ok=True)
    if not any(folder.iterdir()):
        return []
    mark = folder / MARK
    if mark.is_symlink() or not mark.is_file():
        raise UsageError(f"{folder} holds something that no deployment wrote: give an empty or a new folder")
    listed = [line for line in read_text(mark).splitlines() if Path(line).name == line and line != ".."]
    for name in names:
        if name not in listed and (folder / name).is_symlink() | (folder / name).exists():
            raise UsageError(f"{folder / name} was not written by a deployment: move it away")
    return listed


def _write(package: Path, files: Iterable[tuple[Path, str]]) -> None:
    for name, text in files:
        path = package / name
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, text)
        if text.startswith("#!"):
            path.chmod(_EXECUTABLE)


def _copy_model(system: System, instances: tuple[Instance, ...], package: Path, name: str, ros: int) -> None:
    """Copy the model with the code of *instances*; of the others, an empty file stands for the code."""
    root = package / name if ros == 2 else package
    for source, target in model_files(system, instances):
        path = root / target
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, path)
    for instance in system.instances:
        if instance.component.path and not instance.component.package:
            elsewhere = root / MODEL_FOLDER / instance.component.path
            if not elsewhere.exists():  # the model names it; this computer does not execute it
                elsewhere.parent.mkdir(parents=True, exist_ok=True)
                elsewhere.touch()


def _replace(folder: Path, made: Path, earlier: Iterable[str], contents: Iterable[str]) -> None:
    """Put what was *made* into *folder* in place of an *earlier* deployment: all is written by now."""
    old = made / "earlier"
    old.mkdir()
    for name in earlier:
        if (folder / name).is_symlink() or (folder / name).exists():
            (folder / name).rename(old / name)
    for name in (*contents, "README.md", MARK):
        (made / name).replace(folder / name)


def _readme(system: System, found: tuple[Computer, ...], verification: str, interfaces: str, ros: int) -> str:
    rows = [
        f"| {markdown(one.processor.name)} ({one.processor.kind}, {one.processor.frequency_mhz:g} MHz) "
        f"| `{one.package}` "
        f"| {', '.join(markdown(each.instance.name) for each in one.hosted)} "
        f"| {', '.join(markdown(each.vehicle) for each in one.bridged)} |"
        for one in found
    ]
    name = markdown(system.name)
    chosen = f"allocation {markdown(system.allocation)}" + (
        f", scenario {markdown(system.scenario)}" if system.scenario else ""
    )
    steps = (_ROS1 if ros == 1 else _ROS2).format(
        first=found[0].package,
        verification=verification,
        packages=" ".join((*(one.package for one in found), verification, interfaces)),
    )
    used = sorted({name for one in found for name in one.packages})
    cpp = any(is_cpp(each.instance.component) for one in found for each in one.hosted)
    return "\n".join(
        [
            f"# {name} on its computers",
            "",
            f"Generated from the model of {name}, {chosen}. Do not edit: generate it again. "
            "Parameters in `config/` may be edited on a computer.",
            "",
            "| computer | package | components | vehicles |",
            "|---|---|---|---|",
            *rows,
            "",
            _VOLERY,
            *([_COMPILED, ""] if cpp else []),
            *([_WORKSPACE.format(packages=", ".join(f"`{one}`" for one in used)), ""] if used else []),
            f"Calls between components are services `/<component>/<operation>` of the types in `{interfaces}`, "
            "topics are topics. Components need no built package of types; other nodes that call them do.",
            "",
            steps,
        ]
    )


_VOLERY = """## Volery on a computer

Every package needs volery in the Python that executes it. It is on no package index: make a wheel where its
sources are, copy it to the computer and install it there.

```sh
python3 -m pip wheel --no-deps --wheel-dir wheels SOURCES_OF_VOLERY
scp wheels/volery-*.whl COMPUTER:
ssh COMPUTER "python3 -m pip install \\$(echo volery-*.whl)[simulation]"
```
"""

_COMPILED = """Components in C++ are compiled when they are started for the first time: a computer that hosts them needs
a C++ compiler (`apt-get install g++`)."""

_WORKSPACE = """## Packages of your workspace

Programs of components, and modules and messages that they import, are in {packages}. These packages are not
copied here. Build them, and what they depend on, in the workspace of each computer below."""

_ROS1 = """## Build and start

In this folder:

```sh
mkdir -p ~/ws/src && cp -r {packages} ~/ws/src
cd ~/ws && catkin_make && . devel/setup.bash
roslaunch {verification} {verification}.launch      # all on one computer, with simulated vehicles
roslaunch {first} {first}.launch                    # on the computer itself, with its autopilots
```

In reality one computer executes `roscore`; `ROS_MASTER_URI` on the others names it. For a start at boot copy the unit
in `systemd/` to `/etc/systemd/system`, and the rules in `udev/` to `/etc/udev/rules.d` after adapting them to the autopilots.
"""

_ROS2 = """## Build and start

In this folder:

```sh
mkdir -p ~/ws/src && cp -r {packages} ~/ws/src
cd ~/ws && colcon build && . install/setup.bash
ros2 launch {verification} {verification}.launch.py      # all on one computer, with simulated vehicles
ros2 launch {first} {first}.launch.py                    # on the computer itself, with its autopilots
```

Without colcon, `pip install ./{first}` installs the same entry points. All computers use the same `ROS_DOMAIN_ID`. For a
start at boot copy the unit in `systemd/` to `/etc/systemd/system`, and the rules in `udev/` to `/etc/udev/rules.d` after
adapting them to the autopilots.
"""
