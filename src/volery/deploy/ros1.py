"""The package of a computer for ROS 1: catkin, launch files in XML, executables in ``scripts``."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from xml.sax.saxutils import quoteattr

from volery.deploy.content import MODEL_FOLDER, VERIFICATION, Computer
from volery.deploy.texts import (
    bridge_script,
    host_script,
    model_expression,
    package_xml,
    system_files,
    verification_script,
)
from volery.model.system import System
from volery.run.distributed.call_types import INTERFACES, CallTypes, package_name

GRAPH = "ros1"
_SHEBANG = "#!/usr/bin/env python3\n"
_TOOLS = ("<buildtool_depend>catkin</buildtool_depend>",)


def computer_files(computer: Computer, system: System) -> Iterator[tuple[Path, str]]:
    """Yield the files of a computer's package, without those of the model."""
    name, model = computer.package, model_expression(1)
    what = f"{system.name}: what {computer.processor.name} executes"
    interfaces = package_name(system.name, INTERFACES)
    packages = dict.fromkeys(
        ("rospy", "std_msgs", interfaces, *message_packages(computer), *computer.packages)
    )
    depends = [f"<exec_depend>{package}</exec_depend>" for package in packages]
    yield Path("package.xml"), package_xml(name, system, what, _TOOLS, depends)
    scripts = {one.executable: host_script(one, system, GRAPH, model) for one in computer.hosted}
    scripts |= {one.executable: bridge_script(one, GRAPH) for one in computer.bridged}
    for executable, text in scripts.items():
        yield Path("scripts") / executable, _SHEBANG + text
    yield Path("CMakeLists.txt"), _cmake(name, scripts, ("launch", "config", MODEL_FOLDER))
    yield Path("launch") / f"{name}.launch", _launch(computer)
    launch = f"roslaunch {name} {name}.launch"
    yield from system_files(computer, system, launch, "$WORKSPACE/devel/setup.bash")


def verification_files(system: System, computers: Sequence[Computer]) -> Iterator[tuple[Path, str]]:
    """Yield the files of the package that simulates vehicles and environment."""
    name = package_name(system.name, VERIFICATION)
    depends = [f"<exec_depend>{one}</exec_depend>" for one in ("rospy", "std_msgs", "rosgraph_msgs")]
    what = f"{system.name}: simulated vehicles and environment for the deployed components"
    yield Path("package.xml"), package_xml(name, system, what, _TOOLS, depends)
    yield Path("CMakeLists.txt"), _cmake(name, ["world"], ("launch", MODEL_FOLDER))
    yield Path("scripts") / "world", _SHEBANG + verification_script(system, GRAPH, model_expression(1))
    yield Path("launch") / "world.launch", _document(_world(name))
    included = [
        f'<include file="$(find {computer.package})/launch/{computer.package}.launch">'
        '<arg name="simulated" value="true"/></include>'
        for computer in computers
    ]
    yield Path("launch") / f"{name}.launch", _document([*_world(name), *included])


def interface_files(types: CallTypes, system: System) -> Iterator[tuple[Path, str]]:
    """Yield the files of the package of messages and services."""
    tools = (*_TOOLS, "<build_depend>message_generation</build_depend>")
    depends = [
        "<build_export_depend>message_runtime</build_export_depend>",
        "<exec_depend>message_runtime</exec_depend>",
    ]
    what = f"{system.name}: services of the operations of its interfaces"
    yield Path("package.xml"), package_xml(types.package, system, what, tools, depends)
    files = definition_files(types)
    yield from files.items()
    listed = {
        kind: " ".join(file.name for file in files if file.parent.name == kind) for kind in ("msg", "srv")
    }
    messages = f"add_message_files(FILES {listed['msg']})\n" if listed["msg"] else ""
    yield (
        Path("CMakeLists.txt"),
        f"""cmake_minimum_required(VERSION 3.5)
project({types.package})
find_package(catkin REQUIRED COMPONENTS message_generation)
{messages}add_service_files(FILES {listed["srv"]})
generate_messages()
catkin_package(CATKIN_DEPENDS message_runtime)
""",
    )


def definition_files(types: CallTypes) -> dict[Path, str]:
    """Return the files of messages and services below their package, which name each other without it."""
    found = {}
    for name, text in types.definitions.items():
        package, kind, short = name.split("/")
        found[Path(kind) / f"{short}.{kind}"] = text.replace(f"{package}/", "") if kind == "msg" else text
    return found


def _world(package: str) -> list[str]:
    return [
        '<arg name="options" default="" doc="further options of volery simulate"/>',
        '<param name="/use_sim_time" value="true"/>',
        f'<node pkg="{package}" type="world" name="world" required="true" output="screen" args="$(arg options)"/>',
    ]


def _launch(computer: Computer) -> str:
    lines = ['<arg name="simulated" default="false" doc="vehicles and time are those of a simulation"/>']
    for one in computer.hosted:
        file = f"$(find {computer.package})/config/{one.executable}.yaml"
        lines.append(
            f'<node pkg="{computer.package}" type="{one.executable}" name="{package_name(one.instance.name)}" '
            f'output="screen" args="--parameters {file} --simulated $(arg simulated)"/>'
        )
    for each in computer.bridged:
        url = f"{each.autopilot}+serial:///dev/{each.device}?baud=57600"
        lines.append(f'<arg name="{each.executable}_url" default={quoteattr(url)}/>')
        lines.append(
            f'<node unless="$(arg simulated)" pkg="{computer.package}" type="{each.executable}" '
            f'name="{each.executable}" respawn="true" output="screen" args="$(arg {each.executable}_url)"/>'
        )
    return _document(lines)


def _document(lines: Iterable[str]) -> str:
    return "<launch>\n" + "".join(f"  {line}\n" for line in lines) + "</launch>\n"


def _cmake(name: str, scripts: Iterable[str], folders: Sequence[str]) -> str:
    programs = " ".join(f"scripts/{script}" for script in scripts)
    return f"""cmake_minimum_required(VERSION 3.5)
project({name} NONE)
find_package(catkin REQUIRED)
catkin_package()
catkin_install_python(PROGRAMS {programs} DESTINATION ${{CATKIN_PACKAGE_BIN_DESTINATION}})
install(DIRECTORY {" ".join(folders)} DESTINATION ${{CATKIN_PACKAGE_SHARE_DESTINATION}})
"""


def message_packages(computer: Computer) -> Iterator[str]:
    """Yield the packages of the messages that the components of a computer publish and subscribe to."""
    for one in computer.hosted:
        component = one.instance.component
        types = [topic.type for topic in component.publishes.values()]
        types += [topic.type for topic in component.subscribes.values()]
        yield from (kind.partition("/")[0] for kind in types)
