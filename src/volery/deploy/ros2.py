"""The package of a computer for ROS 2: ament_python, launch files in Python, entry points as console scripts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from volery.deploy.content import MODEL_FOLDER, VERIFICATION, Computer
from volery.deploy.ros1 import definition_files, message_packages
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

GRAPH = "ros2"
_EXPORT = "<export><build_type>ament_python</build_type></export>"
_BELOW_CODE = model_expression(0).replace("parents[0]", "parent")
"""The model is data of the Python package, so that it is there wherever pip or colcon installs it."""


def computer_files(computer: Computer, system: System) -> Iterator[tuple[Path, str]]:
    """Yield the files of a computer's package, without those of the model."""
    name = computer.package
    what = f"{system.name}: what {computer.processor.name} executes"
    interfaces = package_name(system.name, INTERFACES)
    packages = dict.fromkeys(
        ("rclpy", "std_msgs", interfaces, *message_packages(computer), *computer.packages)
    )
    yield from _frame(name, system, what, packages, [
        *(one.executable for one in computer.hosted), *(one.executable for one in computer.bridged)
    ])  # fmt: skip
    code = Path(name)
    for one in computer.hosted:
        yield code / f"{one.executable}.py", host_script(one, system, GRAPH, _BELOW_CODE)
    for each in computer.bridged:
        yield code / f"{each.executable}.py", bridge_script(each, GRAPH)
    yield Path("launch") / f"{name}.launch.py", _launch(computer)
    launch = f"ros2 launch {name} {name}.launch.py"
    yield from system_files(computer, system, launch, "$WORKSPACE/install/setup.bash")


def verification_files(system: System, computers: Sequence[Computer]) -> Iterator[tuple[Path, str]]:
    """Yield the files of the package that simulates vehicles and environment."""
    name = package_name(system.name, VERIFICATION)
    what = f"{system.name}: simulated vehicles and environment for the deployed components"
    yield from _frame(name, system, what, ("rclpy", "std_msgs", "rosgraph_msgs"), ["world"])
    yield Path(name) / "world.py", verification_script(system, GRAPH, _BELOW_CODE)
    yield Path("launch") / f"{name}.launch.py", _world_launch(name, computers)


def interface_files(types: CallTypes, system: System) -> Iterator[tuple[Path, str]]:
    """Yield the files of the package of messages and services."""
    tools = ("<buildtool_depend>ament_cmake</buildtool_depend>",)
    depends = [
        "<build_depend>rosidl_default_generators</build_depend>",
        "<exec_depend>rosidl_default_runtime</exec_depend>",
        "<member_of_group>rosidl_interface_packages</member_of_group>",
        "<export><build_type>ament_cmake</build_type></export>",
    ]
    what = f"{system.name}: services of the operations of its interfaces"
    yield Path("package.xml"), package_xml(types.package, system, what, tools, depends)
    files = definition_files(types)
    yield from files.items()
    listed = "\n".join(f'  "{file}"' for file in files)
    yield (
        Path("CMakeLists.txt"),
        f"""cmake_minimum_required(VERSION 3.8)
project({types.package})
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
rosidl_generate_interfaces(${{PROJECT_NAME}}
{listed}
)
ament_export_dependencies(rosidl_default_runtime)
ament_package()
""",
    )


def _frame(
    name: str, system: System, what: str, packages: Iterable[str], executables: Sequence[str]
) -> Iterator[tuple[Path, str]]:
    depends = [*(f"<exec_depend>{package}</exec_depend>" for package in packages), _EXPORT]
    yield Path("package.xml"), package_xml(name, system, what, (), depends)
    yield Path("resource") / name, ""
    yield (
        Path("setup.cfg"),
        f"[develop]\nscript_dir=$base/lib/{name}\n[install]\ninstall_scripts=$base/lib/{name}\n",
    )
    yield Path("setup.py"), _setup(name, what, executables)
    yield Path(name) / "__init__.py", f"{what + '.'!r}\n"


def _setup(name: str, what: str, executables: Sequence[str]) -> str:
    scripts = "".join(
        f'            "{executable} = {name}.{executable}:main",\n' for executable in executables
    )
    return f'''from glob import glob

from setuptools import setup

setup(
    name="{name}",
    version="0.1.0",
    description={what!r},
    packages=["{name}"],
    package_data={{"{name}": ["{MODEL_FOLDER}/**/*"]}},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/{name}"]),
        ("share/{name}", ["package.xml"]),
        ("share/{name}/launch", glob("launch/*")),
        ("share/{name}/config", glob("config/*")),
    ],
    entry_points={{
        "console_scripts": [
{scripts}        ],
    }},
)
'''


_COMPUTER_HEAD = """{what!r}

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import UnlessCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare


def generate_launch_description() -> LaunchDescription:
"""
_WORLD_HEAD = '''"""The simulated vehicles and environment, and all computers on this one."""

from launch import LaunchDescription
from launch.actions import EmitEvent, IncludeLaunchDescription, RegisterEventHandler
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare


def generate_launch_description() -> LaunchDescription:
'''


def _launch(computer: Computer) -> str:
    lines = [
        f'    share = FindPackageShare("{computer.package}")',
        '    simulated = LaunchConfiguration("simulated")',
        "    return LaunchDescription([",
        '        DeclareLaunchArgument("simulated", default_value="false"),',
    ]
    for one in computer.hosted:
        file = f'PathJoinSubstitution([share, "config", "{one.executable}.yaml"])'
        lines.append(
            f'        Node(package="{computer.package}", executable="{one.executable}", output="screen", '
            f'arguments=["--parameters", {file}, "--simulated", simulated]),'
        )
    for each in computer.bridged:
        url = f"{each.autopilot}+serial:///dev/{each.device}?baud=57600"
        lines.append(f'        DeclareLaunchArgument("{each.executable}_url", default_value={url!r}),')
        lines.append(
            f'        Node(package="{computer.package}", executable="{each.executable}", output="screen", '
            f'respawn=True, arguments=[LaunchConfiguration("{each.executable}_url")], '
            "condition=UnlessCondition(simulated)),"
        )
    lines.append("    ])")
    return _COMPUTER_HEAD.format(what=f"What {computer.processor.name} executes.") + "\n".join(lines) + "\n"


def _world_launch(name: str, computers: Sequence[Computer]) -> str:
    lines = [
        f'    world = Node(package="{name}", executable="world", output="screen")',
        "    ends = OnProcessExit(target_action=world, on_exit=[EmitEvent(event=Shutdown())])",
        "    return LaunchDescription([",
        "        world,",
        "        RegisterEventHandler(ends),",
    ]
    for computer in computers:
        source = f'PathJoinSubstitution([FindPackageShare("{computer.package}"), "launch", "{computer.package}.launch.py"])'
        lines.append(
            f"        IncludeLaunchDescription(PythonLaunchDescriptionSource({source}), "
            'launch_arguments={"simulated": "true"}.items()),'
        )
    lines.append("    ])")
    return _WORLD_HEAD + "\n".join(lines) + "\n"
