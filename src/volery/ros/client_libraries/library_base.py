"""What every Python client library shares: launch settings, module objects and ``/rosout``."""

from __future__ import annotations

import re
import sys
from ast import literal_eval
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple, NoReturn

from volery.base.errors import UsageError, did_you_mean
from volery.kernel.task import ExecutionContext, Scope
from volery.kernel.waiting import current_task
from volery.ros.graph import EmbeddedGraph, Node, Publisher, QoS, RosGraph
from volery.ros.graph.interface import NameTakenError, full_node_name, join_names
from volery.ros.messages import message_class
from volery.trace.events import WARNING, Text

# -- components and their launch settings


class Launch(NamedTuple):
    """Namespace, remappings, private parameters and arguments of a node, as in a launch file."""

    namespace: str = "/"
    remaps: Mapping[str, str] = {}
    parameters: Mapping[str, Any] = {}
    arguments: tuple[str, ...] = ()
    """The whole command line: the path of the program, and all arguments, those for ROS among them."""
    node_name: str = ""
    """Name of the node in place of the one that the file gives it; empty for the file's own."""

    def given(self, arguments: Sequence[str], ros: int) -> Launch:
        """Return these settings with a command line on top, as rospy or rclpy reads it.

        Those of ROS 1 have a ``:=``: ``a:=b``, ``_parameter:=1``, ``__ns:=/n``, ``__name:=n``. Those of
        ROS 2 follow ``--ros-args`` up to ``--``: ``-r a:=b``, ``-r __ns:=/n``, ``-r __node:=n``,
        ``-p parameter:=1``.
        """
        made = self
        for key, value in _ros_2_arguments(arguments) if ros == 2 else _ros_1_arguments(arguments):
            if key.startswith("_parameter:"):
                parameter = key.removeprefix("_parameter:")
                made = made._replace(parameters={**made.parameters, parameter: scalar(value)})
            elif key == "__ns":
                made = made._replace(namespace=value)
            elif key == "__name":
                made = made._replace(node_name=value)
            elif not key.startswith("__"):  # logging is the run's
                made = made._replace(remaps={**made.remaps, key: value})
        return made._replace(arguments=tuple(arguments))


def _ros_1_arguments(arguments: Iterable[str]) -> Iterator[tuple[str, str]]:
    for argument in arguments:
        key, mark, value = argument.partition(":=")
        if mark:
            private = key.startswith("_") and not key.startswith("__")
            yield (f"_parameter:{key[1:]}" if private else key), value


def _ros_2_arguments(arguments: Iterable[str]) -> Iterator[tuple[str, str]]:
    inside, option = False, ""
    for argument in arguments:
        if argument in ("--ros-args", "--"):
            inside = argument == "--ros-args"
        elif inside and ":=" in argument:
            key, _, value = argument.partition(":=")
            key = key.rpartition(":")[2]  # of another node than the first, too: there is one in a component
            if option in ("-p", "--param"):
                yield f"_parameter:{key}", value
            elif option in ("-r", "--remap"):
                yield ("__name" if key == "__node" else key), value
        elif inside:
            option = argument


def scalar(text: str) -> Any:
    """Return the value that YAML reads from a text of a command line, for numbers, truth values and lists."""
    words = {"true": True, "false": False, "yes": True, "no": False, "on": True, "off": False}
    if text.lower() in words:
        return words[text.lower()]
    try:
        return literal_eval(text)
    except (ValueError, SyntaxError):
        return text


AtEnd = Callable[[ExecutionContext, Callable[[], object]], None]
"""Registers a function that runs in a context at the end of the run, after the components were cancelled."""


def ignore_end(context: ExecutionContext, last: Callable[[], object]) -> None:
    """Register nothing: an ``AtEnd`` for runs that end without notice."""


@dataclass(eq=False)
class LaunchedComponents:
    """The components of one run that use one client library.

    Args:
        graph: The graph of the run.
        launched: Launch settings by component.
        nodes: Existing nodes by component; a component without one creates its own.
        at_end: Registers functions for the end of the run.
    """

    graph: RosGraph
    launched: Mapping[str, Launch] | None = None
    nodes: Mapping[str, Node] | None = None
    at_end: AtEnd = ignore_end

    def __post_init__(self) -> None:
        self.kernel = self.graph.kernel

    @property
    def component(self) -> str:
        """Component of the current task."""
        return current_task(self.kernel).context.component

    def started_again(self, scope: Scope) -> bool:
        """Return whether the current task's component has been started again since it ran in *scope*."""
        own = current_task(self.kernel).scope
        return bool(scope.cancelled) and own is not scope and own.parent is scope.parent

    def launch_of(self, component: str) -> Launch | None:
        """Return the launch settings of *component*, or None."""
        return None if self.launched is None else self.launched.get(component)

    def node_of(self, component: str) -> Node | None:
        """Return the existing node of *component*, or None."""
        return None if self.nodes is None else self.nodes.get(component)


def node_label(name: str) -> str:
    """Return the name of a component or of a file's node in the characters that ROS takes."""
    return re.sub(r"\W", "_", name)


def node_of_file(
    graph: RosGraph,
    component: str,
    own: str,
    launch: Launch | None,
    given: Node | None = None,
    *,
    namespace: str = "",
    first: bool = True,
    anonymous: bool = False,
) -> Node:
    """Return the node that a file creates: *given* if it bears that name, or a new one.

    Its name is the one that the model gives it, or the file's own. Where another node has the file's own, the
    name of the component takes its place, and a warning says so.

    Args:
        graph: Its graph.
        component: The component that runs the file.
        own: The name that the file gives the node.
        launch: Launch settings, None for a file that runs without a model.
        given: A node of the component that exists.
        namespace: Namespace in place of the launch settings'.
        first: It is the first node of the component, which the model's name is for.
        anonymous: The file asks for a name that no other node has; one of the model needs no number.
    """
    settings = launch or Launch()
    where = namespace or settings.namespace
    stated = settings.node_name if first else ""
    name = node_label(stated or own)

    def join(name: str, anonymous: bool = False) -> Node:
        if given is not None and given.name == full_node_name(name, where):
            return given
        return graph.node(name, where, remaps=settings.remaps, anonymous=anonymous)

    try:
        return join(name, anonymous and not stated)
    except NameTakenError:
        other = node_label(component if first else f"{component}_{own}")
        if launch is None or stated or other == name:
            raise
        made = join(other)
        taken = join_names(where, name)
        what = f"another node is named {taken}, so this one is {made.name}; state a `node_name`"
        graph.kernel.record(Text(graph.kernel.now(), component, WARNING, what))
        return made


# -- module objects


SURFACE = "docs/reference/ros-surface.md"
"""The page that lists what there is."""


def library_module(
    name: str, names: Mapping[str, Any], refused: Mapping[str, str] | None = None
) -> ModuleType:
    """Return a module object that says of a missing name what to do instead.

    Args:
        name: Dotted name of the module.
        names: Content of the module.
        refused: Dotted names that are not there on purpose, and their replacement.
    """
    module = ModuleType(name, f"{name.partition('.')[0]} on the embedded graph.")
    module.__path__ = []
    vars(module).update(names)

    def missing(attribute: str) -> NoReturn:
        if attribute.startswith("__"):
            raise AttributeError(attribute)
        full = f"{name}.{attribute}"
        instead = (refused or {}).get(full) or f"{SURFACE} lists what is"
        hint = did_you_mean(attribute, names)
        raise AttributeError(f"{full} is not there on the embedded graph{hint}; {instead}")

    vars(module)["__getattr__"] = missing
    return module


# -- /rosout

ROSOUT = "/rosout"


class Caller(NamedTuple):
    """Source location of a log call: file name, function and line."""

    file: str
    function: str
    line: int


def caller(depth: int) -> Caller:
    """Return the source location *depth* calls above the calling function."""
    frame = sys._getframe(depth + 1)
    return Caller(Path(frame.f_code.co_filename).name, frame.f_code.co_name, frame.f_lineno)


def file_of_user() -> Path:
    """Return the file of the first caller outside the client libraries."""
    frame = sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__name__", "").startswith("volery.ros."):
        frame = frame.f_back
    return Path(frame.f_code.co_filename)


class Rosout:
    """Publishes the log lines of a node as messages of one type.

    On the embedded graph the node joins the topic only if the topic has a subscriber, so that logging costs
    nothing otherwise. Where the topic carries the type of another client library, or the type is not
    installed, log lines are recorded but not published.
    """

    def __init__(self, graph: RosGraph, node: Node, message_type: str, qos: QoS) -> None:
        self._graph, self._node, self._type, self._qos = graph, node, message_type, qos
        self._publisher: Publisher | None = None
        self._closed = False

    def publish(self, fill: Callable[[Any], None]) -> None:
        """Publish a message that *fill* completes, if there is a subscriber. Then an interaction point."""
        if self._closed or self._node.closed:
            return
        if isinstance(self._graph, EmbeddedGraph) and not self._graph.has_subscribers(ROSOUT):
            return
        try:
            if self._publisher is None:
                self._publisher = self._node.advertise(ROSOUT, self._type, self._qos)
            message = message_class(self._type)()
            fill(message)
            self._publisher.publish(message)
        except UsageError:
            self._closed = True
