"""The nodes of a launch file as a model: components with their files, instances, vehicles behind MAVROS.

``read_launch`` gives the nodes of any launch file; ``launch_tree`` makes the model of them.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path, PurePath
from typing import Any, NamedTuple

from volery.base.errors import Location, ModelError
from volery.exchange.identifiers import identifier
from volery.exchange.launch.launch_reading import LaunchedNode, LaunchReading, Packages, UnresolvedError
from volery.exchange.launch.ros2_actions import LaunchScope
from volery.exchange.launch.ros2_markup import read_markup, xml_entity, yaml_entity
from volery.exchange.launch.ros2_python import PythonLaunch
from volery.exchange.launch.roslaunch import Ros1Reader, read_xml
from volery.model.text import Quoted

COMPUTER = "onboard"
"""Name of the computer in the model."""
LONGEST_TEXT = 10_000
"""Longest text of a parameter that is written into a model: a robot's description is longer."""
MAVROS = ("mavros_node", "mavros::router::Router")
_ARDUPILOT = re.compile(r"apm|ardu", re.IGNORECASE)
_YAML = (".yaml", ".yml")


def read_launch(source: Path, given: Mapping[str, str], packages: Packages) -> LaunchReading:
    """Return what a launch file starts, with all that it includes; nothing in it is executed.

    Args:
        source: A launch file of ROS 1 (XML) or ROS 2 (XML, YAML or Python).
        given: Arguments, as after ``roslaunch`` and ``ros2 launch``.
        packages: The packages that it can name.

    Raises:
        ModelError: it cannot be read, or is no launch file.
    """
    reading = LaunchReading(packages, given)
    source = source.resolve()
    where = Location(str(source), 1)
    try:
        if source.suffix not in (".py", *_YAML):
            root = read_xml(source)
            if root.tag != "launch":
                what = f"its root is <{root.tag}>; a launch file has <launch>"
                raise ModelError(what, "", where)
            if _is_of_ros1(root, source):
                Ros1Reader(reading).read(root, source)
                return reading
        scope = LaunchScope(reading, source, _read_ros2, dict(given))
        _read_ros2(source, scope, where)
    except UnresolvedError as error:
        raise ModelError(str(error), "", where) from None
    for name in sorted(given.keys() - reading.declared.keys()):
        reading.note(f"the file declares no argument {name!r}", where)
    return reading


def _is_of_ros1(root: Any, source: Path) -> bool:
    """Return whether a launch file in XML is one of ROS 1, by what only one of both has."""
    texts = [str(value) for element in root.iter("*") for value in element.attrib.values()]
    if (
        any("$(var " in text or "$(find-pkg" in text for text in texts)
        or root.find(".//node[@exec]") is not None
    ):
        return False
    old = any("$(find " in text for text in texts) or root.find(".//node[@type]") is not None
    return old or not source.name.endswith((".launch.xml", "_launch.xml"))


def _read_ros2(file: Path, scope: LaunchScope, where: Location) -> None:
    """Visit a launch file of ROS 2 in the scope of the one that includes it."""
    if not scope.reading.enter(file, where, scope.environment | scope.arguments):
        return
    before, scope.file = scope.file, file
    try:
        if file.suffix == ".py":
            PythonLaunch(file, scope).read()
        elif file.suffix in _YAML:
            read_markup(yaml_entity(file), scope)
        else:
            read_markup(xml_entity(read_xml(file), file), scope)
    finally:
        scope.file = before
        scope.reading.leave()


# -- the model


class LaunchComputer(NamedTuple):
    """The computer that the nodes run on: its kind in the catalogue, and its frequency, Hz."""

    kind: str
    frequency_hz: float
    assumed: bool = False


def launch_tree(
    reading: LaunchReading, source: Path, folder: Path, computer: LaunchComputer
) -> dict[str, Any]:
    """Return the model of what was read.

    Args:
        reading: The nodes; notes are added to it.
        source: The launch file.
        folder: The folder that the model will be in.
        computer: What all nodes are allocated to, as a launch file does not say.

    Raises:
        ModelError: nothing in it is a node.
    """
    tree = _Tree(reading, source.resolve(), folder.resolve()).tree()
    if computer.assumed:
        what = (
            f"all nodes are allocated to a {computer.kind}, as a launch file names no computer: "
            f"--processor {COMPUTER}=KIND states another"
        )
        reading.note(what, Location(str(source.resolve()), 1), lost=False)
    placed = [*tree["application"], *tree.get("environment", {}).get("vehicles", {})]
    frequency = f"{computer.frequency_hz / 1e6:g} MHz"
    tree["platform"] = {"processors": {COMPUTER: {"is": computer.kind, "frequency": frequency}}}
    tree["allocations"] = {"all": dict.fromkeys(placed, COMPUTER)}
    return tree


class _Tree:
    def __init__(self, reading: LaunchReading, source: Path, folder: Path) -> None:
        self._reading, self._source, self._folder = reading, source, folder
        self._components: dict[str, dict[str, Any]] = {}
        self._kinds: dict[tuple[Any, ...], str] = {}
        self._instances: dict[str, dict[str, Any]] = {}
        self._vehicles: dict[str, dict[str, Any]] = {}
        self._outside: dict[str, None] = {}

    def tree(self) -> dict[str, Any]:
        """Return the model."""
        for node in self._reading.nodes:
            if node.executable in MAVROS and node.package == "mavros":
                self._vehicle(node)
            else:
                self._instance(self._of_the_run(node))
        if not self._instances and not self._vehicles:
            notes = "".join(f"\n  {note}" for note in self._reading.notes)
            what = f"nothing in it is a node that is started{notes and ':' + notes}"
            raise ModelError(what, "", Location(str(self._source), 1))
        name = re.sub(r"\.launch$", "", PurePath(self._source.name).stem)
        made: dict[str, Any] = {"volery": 1, "name": identifier(name) or "launched"}
        if self._outside:
            made["files_from"] = list(self._outside)
            listed = " and ".join(self._outside)
            what = f"its files are in {listed}, which `files_from` allows now"
            self._reading.note(what, Location(str(self._source), 1), lost=False)
        made |= {"components": self._components, "application": self._instances}
        if self._vehicles:
            made["environment"] = {
                "places": {"home": {"east": "0 m", "north": "0 m"}},
                "vehicles": self._vehicles,
            }
        return made

    def _of_the_run(self, node: LaunchedNode) -> LaunchedNode:
        """Return a node without what is the run's: its time."""
        if "use_sim_time" not in node.parameters:
            return node
        what = "`use_sim_time` is left out: the time of all nodes is the run's"
        self._reading.note(what, node.where, lost=False)
        kept = {key: value for key, value in node.parameters.items() if key != "use_sim_time"}
        return replace(node, parameters=kept)

    def _instance(self, node: LaunchedNode) -> None:
        stated: dict[str, Any] = {"is": self._component(node)}
        if node.name:
            stated["node_name"] = node.name
        if node.namespace != "/":
            stated["namespace"] = node.namespace
        parameters = {key: self._value(key, one, node) for key, one in node.parameters.items()}
        parameters = {key: one for key, one in parameters.items() if one is not None}
        if parameters:
            stated["parameters"] = parameters
        if node.remaps:
            stated["remap"] = dict(node.remaps)
        if node.arguments:
            stated["arguments"] = list(node.arguments)
        own = identifier(node.name) or identifier(PurePath(node.executable).stem) or "node"
        last = identifier(node.namespace.strip("/").replace("/", "_"))
        name = own if own not in self._instances or not last else f"{last}_{own}"
        self._instances[_free(name, self._instances)] = stated

    def _value(self, key: str, value: Any, node: LaunchedNode) -> Any:
        """Return the value of a parameter as a model states it; None, with a note, if it cannot."""
        if isinstance(value, str) and len(value) > LONGEST_TEXT:
            what = f"parameter {key} is left out: a text of {len(value)} characters"
            self._reading.note(what, node.where)
            return None
        return _quoted(value)

    def _component(self, node: LaunchedNode) -> str:
        found = None
        if not node.container:
            found = self._reading.packages.program(
                node.package, node.executable, Path(node.where.file), node.ros
            )
        kind = (node.package, node.executable, node.ros, node.required, node.respawn, node.respawn_delay)
        if kind in self._kinds:
            return self._kinds[kind]
        language = "rospy" if node.ros == 1 else "rclpy"
        stated: dict[str, Any] = {"language": found.language if found else language}
        if found is not None:
            stated["path"] = self._path(found.file)
            if found.function and found.function != "main":
                stated["main"] = found.function
        else:
            self._missing(node)
        stated["active"] = True
        if node.required:
            stated["on_failure"] = "end_run"
        elif node.respawn:
            stated["on_failure"] = {"action": "restart", "delay": f"{node.respawn_delay:g} s"}
        shared = self._shared(node) if node.ros == 1 else {}
        if shared:
            stated["parameters"] = shared
        own = identifier(re.split(r"::|/", node.executable)[-1].removesuffix(".py")) or "node"
        name = self._kinds[kind] = _free(own, self._components)
        self._components[name] = stated
        return name

    def _missing(self, node: LaunchedNode) -> None:
        if node.container:
            what = f"the composable node {node.executable} of {node.package} is a component without code"
        elif self._reading.packages.folder(node.package, Path(node.where.file)) is None:
            what = (
                f"there is no package {node.package!r}, so {node.executable} is a component without code: "
                "name its folder with --search"
            )
        else:
            what = f"no source of {node.executable} is in package {node.package}: its component has no code"
        self._reading.note(what, node.where)

    def _shared(self, node: LaunchedNode) -> dict[str, Any]:
        """Return the parameters of no node: each component of ROS 1 states them, as it may read them."""
        shared = {}
        for key, one in self._reading.shared.items():
            value = self._value(key, one, node) if key != "/use_sim_time" else None
            if value is not None:
                shared[key] = value
        return shared

    def _path(self, file: Path) -> str:
        path = PurePath(os.path.relpath(file, self._folder))
        if path.parts[:1] == ("..",):
            package = self._reading.packages.package_of(file)
            folder = package[1] if package else file.parent
            self._outside[PurePath(os.path.relpath(folder, self._folder)).as_posix()] = None
        return path.as_posix()

    def _vehicle(self, node: LaunchedNode) -> None:
        """Add the vehicle whose node MAVROS is; the names of its topics begin with the vehicle's."""
        below = node.namespace if node.ros == 2 else f"{node.namespace}/{node.name}"
        parts = [part for part in below.split("/") if part]
        name = _free(identifier("_".join(parts)) or "mavros", self._vehicles)
        ardupilot = any(_ARDUPILOT.search(file) for file in node.files)
        autopilot = "ardupilot" if ardupilot else "px4"
        self._vehicles[name] = {"kind": "multirotor", "autopilot": autopilot, "at": "home"}
        what = (
            f"MAVROS is the node of the simulated vehicle {name!r}: a multirotor with {autopilot}, by the "
            "names of its files; its own parameters are left out"
        )
        self._reading.note(what, node.where, lost=False)
        if parts != [name]:
            what = f"the names of MAVROS are below /{name} in a run, not below /{'/'.join(parts)}"
            self._reading.note(what, node.where)


def _quoted(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _quoted(below) for key, below in value.items()}
    if isinstance(value, list | tuple):
        return [_quoted(each) for each in value]
    return Quoted(value) if isinstance(value, str) else value


def _free(name: str, taken: Mapping[str, Any]) -> str:
    """Return *name*, with a number if it is taken."""
    made, number = name, 2
    while made in taken:
        made, number = f"{name}_{number}", number + 1
    return made
