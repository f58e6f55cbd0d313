"""rospy's functions of parameters. They work before ``init_node``, as there.

The ``rospy`` module of one run, and the message packages beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from types import ModuleType
from typing import Any

from volery.base.errors import UsageError
from volery.ros import messages
from volery.ros.client_libraries.library_base import AtEnd, Launch, ignore_end, library_module
from volery.ros.client_libraries.rospy import services, time, topics
from volery.ros.client_libraries.rospy.logging import LEVELS, loggers
from volery.ros.client_libraries.rospy.session import EXCEPTIONS, Sessions
from volery.ros.client_libraries.rospy.topics import AnyMsg
from volery.ros.graph import EmbeddedGraph, Node, RosGraph

_NO_DEFAULT = object()


def get_param(sessions: Sessions, param_name: str, default: Any = _NO_DEFAULT) -> Any:
    """A parameter; ``KeyError`` if there is none and no default."""
    node = sessions.early().node
    if default is not _NO_DEFAULT:
        return node.get_parameter(param_name, default)
    try:
        return node.get_parameter(param_name)
    except UsageError as error:
        raise KeyError(str(error)) from error


def get_param_cached(sessions: Sessions, param_name: str, default: Any = _NO_DEFAULT) -> Any:
    """``get_param``: what was asked for before is not older here."""
    return get_param(sessions, param_name, default)


def set_param(sessions: Sessions, param_name: str, param_value: Any) -> None:
    """Set a parameter."""
    sessions.early().node.set_parameter(param_name, param_value)


def has_param(sessions: Sessions, param_name: str) -> bool:
    """Whether there is such a parameter."""
    return sessions.early().node.has_parameter(param_name)


def delete_param(sessions: Sessions, param_name: str) -> None:
    """Remove a parameter; ``KeyError`` if there is none."""
    try:
        sessions.early().node.delete_parameter(param_name)
    except UsageError as error:
        raise KeyError(str(error)) from error


def get_param_names(sessions: Sessions) -> list[str]:
    """All parameters, where the graph is embedded: what others keep is not listed."""
    graph = sessions.graph
    if not isinstance(graph, EmbeddedGraph):
        raise UsageError("rospy.get_param_names() works on the embedded graph only")
    with sessions.kernel:
        return graph.parameters.names()


def search_param(sessions: Sessions, param_name: str) -> str | None:
    """The full name of the nearest parameter so called: of this node, of its namespace, of those above.

    Of a name with several parts, only the first is looked for. ``None`` if there is none.
    """
    node = sessions.early().node
    if param_name.startswith(("/", "~")):
        full = node.resolve(param_name)
        return full if node.has_parameter(full) else None
    first = param_name.partition("/")[0]
    above = node.name
    while True:
        if node.has_parameter(f"{above}/{first}"):
            return f"{above}/{param_name}"
        if not above:
            return None
        above = above.rpartition("/")[0]


FUNCTIONS = (
    get_param, get_param_cached, set_param, has_param, delete_param, get_param_names, search_param
)  # fmt: skip


_BOUND = (
    topics.Publisher,
    topics.Subscriber,
    services.Service,
    services.ServiceProxy,
    time.Rate,
    time.Timer,
    time.Time,
)


def modules(
    graph: RosGraph,
    launched: Mapping[str, Launch] | None = None,
    nodes: Mapping[str, Node] | None = None,
    at_end: AtEnd = ignore_end,
) -> dict[str, ModuleType]:
    """What the files of a run import: ``rospy``, ``rospy.exceptions``, ``std_msgs.msg`` and so on, by name.

    *launched* says for each component what a launch file would (by the component's name, which names its
    node then). *nodes* holds, by component, nodes that are there already: ``init_node`` finds its own there.
    *at_end* has shutdown hooks called when the run ends.
    """
    sessions = Sessions(graph, launched, nodes, at_end)
    names: dict[str, Any] = {**EXCEPTIONS, **LEVELS, **loggers(sessions), **_functions(sessions)}
    for kind in _BOUND:
        names[kind.__name__] = type(kind.__name__, (kind,), {"__slots__": (), "sessions": sessions})
    names["Duration"] = time.Duration
    names["TimerEvent"] = time.TimerEvent
    names["Header"] = messages.message_class("std_msgs/msg/Header")
    names["Message"] = messages.Message
    names["AnyMsg"] = AnyMsg
    parts: dict[str, Mapping[str, Any]] = {
        "exceptions": EXCEPTIONS,
        "msg": {"AnyMsg": AnyMsg},
        "numpy_msg": {"numpy_msg": numpy_msg},
        "rostime": {one: names[one] for one in ("Duration", "Time", "get_rostime", "get_time")},
    }
    found = {f"rospy.{part}": library_module(f"rospy.{part}", inside) for part, inside in parts.items()}
    rospy = library_module("rospy", {**names, **{part: found[f"rospy.{part}"] for part in parts}})
    return {**messages.modules(), "rospy": rospy, **found}


def numpy_msg(msg_type: Any) -> Any:
    """Messages whose arrays are numpy's: as they are here anyway."""
    return msg_type


def _functions(sessions: Sessions) -> dict[str, Callable[..., Any]]:
    """The functions of rospy, bound to the sessions of one run."""
    found: tuple[Any, ...] = (
        init_node, is_shutdown, signal_shutdown, on_shutdown, spin, sleep, wait_for_message, wait_for_service,
        get_name, get_namespace, get_time, get_rostime, resolve_name, get_published_topics,
        *FUNCTIONS,
    )  # fmt: skip
    bound: dict[str, Callable[..., Any]] = {one.__name__: partial(one, sessions) for one in found}
    return {
        **bound,
        "get_caller_id": bound["get_name"],
        "remap_name": bound["resolve_name"],
        "myargv": myargv,
    }


def init_node(
    sessions: Sessions, name: str, argv: Any = None, anonymous: bool = False, **options: Any
) -> None:
    """Join the graph. Options about signals, logging and ports are accepted and mean nothing here."""
    sessions.join(name, anonymous)


def is_shutdown(sessions: Sessions) -> bool:
    """Whether this node is shutting down. An interaction point, as every call is."""
    with sessions.kernel:
        session = sessions.find()
        return session is not None and bool(session.shutdown)


def signal_shutdown(sessions: Sessions, reason: str = "") -> None:
    """Shut this node down."""
    sessions.here().end(reason)


def on_shutdown(sessions: Sessions, h: Callable[[], Any]) -> None:
    """Call *h* when this node shuts down, or the run ends."""
    sessions.early().on_shutdown(h)


def spin(sessions: Sessions) -> None:
    """Block until this node shuts down."""
    services.spin(sessions.here())


def sleep(sessions: Sessions, duration: Any) -> None:
    """Block for a number of seconds or a ``Duration``."""
    time.sleep(sessions.here(), duration)


def _within(timeout: Any) -> int | None:
    return None if timeout is None else time.as_ns(timeout)


def wait_for_message(sessions: Sessions, topic: str, topic_type: Any, timeout: Any = None) -> Any:
    """The next message of a topic."""
    return topics.wait_for_message(sessions.early(), topic, topic_type, _within(timeout))


def wait_for_service(sessions: Sessions, service: str, timeout: Any = None) -> None:
    """Block until somebody serves it."""
    services.wait_for_service(sessions.early(), service, _within(timeout))


def get_name(sessions: Sessions) -> str:
    """The full name of this node."""
    return sessions.early().node.name


def get_namespace(sessions: Sessions) -> str:
    """This node's namespace, with a slash at its end."""
    return f"{sessions.early().node.namespace.rstrip('/')}/"


def get_time(sessions: Sessions) -> float:
    """ROS time in seconds."""
    return float(get_rostime(sessions).to_sec())


def get_rostime(sessions: Sessions) -> time.Time:
    """ROS time."""
    return time.Time(0, sessions.now())


def resolve_name(sessions: Sessions, name: str) -> str:
    """The absolute name, remappings applied."""
    return sessions.early().node.resolve(name)


def get_published_topics(sessions: Sessions, namespace: str = "/") -> list[list[str]]:
    """Topics that somebody publishes below *namespace*, with their types in ROS 1's spelling."""
    with sessions.kernel:
        states = [one for one in sessions.graph.topics() if one.publishers]
    below = namespace.rstrip("/") + "/"
    return [[one.name, one.type.replace("/msg/", "/")] for one in states if one.name.startswith(below)]


def myargv(argv: list[str] | None = None) -> list[str]:
    """The command line without ROS's own arguments; components have none."""
    return [one for one in argv or [] if ":=" not in one]
