"""A model as a launch file: of ROS 1, or of ROS 2 in XML or Python.

Components that are ROS nodes become nodes with the names, parameters, remappings and arguments of their
instances, and vehicles the nodes of MAVROS that serve them. What a launch file cannot say is noted.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple
from xml.sax.saxutils import escape, quoteattr

from volery.exchange.launch.launch_reading import Packages
from volery.exchange.notes import Note, Unmapped, instances

ENDINGS = {".launch": 1, ".launch.xml": 2, ".launch.py": 2}
"""Endings of launch files that are written, and their versions of ROS."""
LANGUAGES = {1: ("rospy", "roscpp"), 2: ("rclpy", "rclcpp")}


class _Node(NamedTuple):
    """A node to be started."""

    package: str
    executable: str
    name: str
    namespace: str = ""
    parameters: Mapping[str, Any] = {}
    remaps: Mapping[str, str] = {}
    arguments: tuple[str, ...] = ()
    on_failure: Any = None


def launch_ending(file: Path) -> str:
    """Return the ending of ``ENDINGS`` that *file* has, or nothing."""
    found = [one for one in ENDINGS if file.name.endswith(one)]
    return max(found, key=len, default="")


def launch_text(
    tree: Mapping[str, Any], folder: Path, ending: str, packages: Packages
) -> tuple[str, tuple[Note, ...]]:
    """Return a model as a launch file, and notes on what is not in it.

    Args:
        tree: The model.
        folder: The folder that its paths start in.
        ending: One of ``ENDINGS``.
        packages: Finds the packages of programs.
    """
    unmapped = Unmapped()
    nodes = [
        *_components(tree, folder, ENDINGS[ending], packages, unmapped),
        *_vehicles(tree, ENDINGS[ending]),
    ]
    if ending == ".launch.py":
        text = _python(nodes)
    else:
        lines = _roslaunch(nodes, unmapped) if ending == ".launch" else _xml(nodes, unmapped)
        text = "<launch>\n" + "".join(f"  {line}\n" for line in lines) + "</launch>\n"
    return text, tuple(Note(line) for line in unmapped.lines())


def _components(
    tree: Mapping[str, Any], folder: Path, ros: int, packages: Packages, unmapped: Unmapped
) -> Iterator[_Node]:
    components = tree.get("components") or {}
    for name, stated in instances(tree).items():
        component = components.get(stated.get("is")) or {}
        language = component.get("language")
        if language not in LANGUAGES[ros]:
            unmapped.add(f"components in {language}, which are no nodes of ROS {ros}", name)
            continue
        program = _program(component, folder, ros, packages)
        if program is None:
            unmapped.add("components of no package", name)
            continue
        yield _Node(
            *program,
            str(stated.get("node_name") or name),
            str(stated.get("namespace") or "/").strip("/"),
            {**(component.get("parameters") or {}), **(stated.get("parameters") or {})},
            stated.get("remap") or {},
            tuple(map(str, _listed(stated.get("arguments", component.get("arguments"))))),
            component.get("on_failure"),
        )


def _program(
    component: Mapping[str, Any], folder: Path, ros: int, packages: Packages
) -> tuple[str, str] | None:
    """Return the package and the name of a component's program, or None."""
    if component.get("package"):
        return str(component["package"]), str(component.get("executable", ""))
    if not component.get("path"):
        return None
    return packages.executable_of(folder / str(component["path"]), ros)


def _listed(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [] if value is None else [value]


def _vehicles(tree: Mapping[str, Any], ros: int) -> Iterator[_Node]:
    """Yield a node of MAVROS for each vehicle; its address is stated where it is started."""
    for name in (tree.get("environment") or {}).get("vehicles") or {}:
        parameters = {"fcu_url": _ArgumentName(f"{name}_url")}
        yield _Node("mavros", "mavros_node", name, "" if ros == 1 else name, parameters)


class _ArgumentName(str):
    """The name of an argument whose value a parameter is."""

    __slots__ = ()


FCU_URL = "udp://:14540@"
"""Address of an autopilot where the one who starts the launch file states no other."""


def _arguments(nodes: Iterable[_Node]) -> list[_ArgumentName]:
    return [value for node in nodes for value in node.parameters.values() if isinstance(value, _ArgumentName)]


# -- ROS 1


def _roslaunch(nodes: list[_Node], unmapped: Unmapped) -> Iterator[str]:
    for name in _arguments(nodes):
        yield f'<arg name={quoteattr(name)} default="{FCU_URL}"/>'
    shared = {key: one for node in nodes for key, one in node.parameters.items() if key.startswith("/")}
    for key, value in shared.items():
        yield _parameter_1(key, value, unmapped)
    for node in nodes:
        own = {key: one for key, one in node.parameters.items() if not key.startswith("/")}
        attributes = {"pkg": node.package, "type": node.executable, "name": node.name, "ns": node.namespace}
        attributes |= {"args": _command_line(node.arguments), **_ending(node), "output": "screen"}
        inner = [_parameter_1(key, one, unmapped) for key, one in own.items()]
        inner += [_element("remap", {"from": key, "to": one}) for key, one in node.remaps.items()]
        yield from _with_children("node", attributes, inner)


def _ending(node: _Node) -> dict[str, str]:
    """Return what follows when a node ends."""
    action = node.on_failure.get("action") if isinstance(node.on_failure, Mapping) else node.on_failure
    return {"required": "true"} if action == "end_run" else {"respawn": "true"} if action == "restart" else {}


def _parameter_1(name: str, value: Any, unmapped: Unmapped) -> str:
    if isinstance(value, _ArgumentName):
        return _element("param", {"name": name, "value": f"$(arg {value})"})
    if "$(" in str(value):
        unmapped.add("values with `$(`, which roslaunch would replace", name)
    kinds = {bool: "bool", int: "int", float: "double"}
    if isinstance(value, list | Mapping):
        return f"<rosparam param={quoteattr(name)}>{escape(json.dumps(value))}</rosparam>"
    text = str(value).lower() if isinstance(value, bool) else str(value)
    return _element("param", {"name": name, "type": kinds.get(type(value), "str"), "value": text}, keep=True)


# -- ROS 2


def _xml(nodes: list[_Node], unmapped: Unmapped) -> Iterator[str]:
    for name in _arguments(nodes):
        yield f'<arg name={quoteattr(name)} default="{FCU_URL}"/>'
    for node in nodes:
        attributes = {"pkg": node.package, "exec": node.executable, "name": node.name}
        attributes |= {"namespace": node.namespace, "args": _command_line(node.arguments), "output": "screen"}
        attributes |= _ending_2(node, unmapped)
        inner = [_parameter_2(key, one, unmapped) for key, one in node.parameters.items()]
        inner += [_element("remap", {"from": key, "to": one}) for key, one in node.remaps.items()]
        yield from _with_children("node", attributes, inner)


def _ending_2(node: _Node, unmapped: Unmapped) -> dict[str, str]:
    ending = _ending(node)
    if ending.pop("required", ""):
        unmapped.add("`on_failure: end_run` of components", node.name)
    return ending


def _parameter_2(name: str, value: Any, unmapped: Unmapped) -> str:
    if isinstance(value, _ArgumentName):
        return _element("param", {"name": name, "value": f"$(var {value})"})
    if isinstance(value, Mapping):
        inner = "".join(_parameter_2(key, below, unmapped) for key, below in value.items())
        return f"<param name={quoteattr(name)}>{inner}</param>"
    if "$" in str(value) or "\\" in str(value):
        unmapped.add("values with `$` or `\\`, which launch would replace", name)
    text = json.dumps(value) if not isinstance(value, str) else str(value)
    attributes = {"name": name, "value": text}
    return _element("param", attributes | ({"type": "str"} if isinstance(value, str) else {}), keep=True)


def _python(nodes: list[_Node]) -> str:
    lines = [f"DeclareLaunchArgument({str(name)!r}, default_value={FCU_URL!r})" for name in _arguments(nodes)]
    for node in nodes:
        parameters = ", ".join(f"{str(key)!r}: {_python_value(one)}" for key, one in node.parameters.items())
        words = {
            "package": repr(str(node.package)),
            "executable": repr(str(node.executable)),
            "name": repr(str(node.name)),
            "namespace": repr(node.namespace),
            "parameters": f"[{{{parameters}}}]",
            "remappings": repr([(str(key), str(one)) for key, one in node.remaps.items()]),
            "arguments": repr([str(argument) for argument in node.arguments]),
        }
        empty = ("''", "[]", "[{}]")
        stated = ", ".join(f"{key}={one}" for key, one in words.items() if one not in empty)
        ending = {"required": ", on_exit=[Shutdown()]", "respawn": ", respawn=True"}
        lines.append(f"Node({stated}, output='screen'{''.join(ending[key] for key in _ending(node))})")
    body = "".join(f"        {line},\n" for line in lines)
    return f"{_PYTHON_HEAD}    return LaunchDescription([\n{body}    ])\n"


def _python_value(value: Any) -> str:
    return f"LaunchConfiguration({str(value)!r})" if isinstance(value, _ArgumentName) else repr(_plain(value))


def _plain(value: Any) -> Any:
    """Return a value whose ``repr`` is Python: texts without the mark of their quotation."""
    if isinstance(value, Mapping):
        return {str(key): _plain(below) for key, below in value.items()}
    if isinstance(value, list):
        return [_plain(below) for below in value]
    return str(value) if isinstance(value, str) else value


_PYTHON_HEAD = '''"""The nodes of a model, as volery wrote them."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
'''


# -- XML


def _command_line(arguments: Iterable[str]) -> str:
    return " ".join(
        argument if argument and not set(argument) & set(" '\"\\") else json.dumps(argument)
        for argument in arguments
    )


def _element(tag: str, attributes: Mapping[str, str], *, keep: bool = False) -> str:
    stated = "".join(f" {key}={quoteattr(one)}" for key, one in attributes.items() if one or keep)
    return f"<{tag}{stated}/>"


def _with_children(tag: str, attributes: Mapping[str, str], inner: list[str]) -> Iterator[str]:
    element = _element(tag, attributes)
    if not inner:
        yield element
        return
    yield element.removesuffix("/>") + ">"
    yield from (f"  {one}" for one in inner)
    yield f"</{tag}>"
