"""The modules of ``rospy`` for one run, rospy's functions, and the message packages.

The functions of parameters work before ``init_node``, as in rospy. A logged line is recorded in the trace
under the name of the component.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from functools import partial
from types import ModuleType
from typing import Any

from volery.base.errors import UsageError
from volery.base.time import Ns, S, from_seconds
from volery.kernel.waiting import poll
from volery.ros import messages
from volery.ros.client_libraries.library_base import AtEnd, Caller, Launch, caller, ignore_end, library_module
from volery.ros.client_libraries.rospy import entities
from volery.ros.client_libraries.rospy.master import (
    NAMES,
    is_legal_name,
    master_names,
    resolved,
    rosgraph_modules,
)
from volery.ros.client_libraries.rospy.session import (
    EXCEPTIONS,
    Duration,
    Rate,
    ROSException,
    Sessions,
    Time,
    Timer,
    TimerEvent,
    as_ns,
)
from volery.ros.graph import EmbeddedGraph, Node, RosGraph
from volery.ros.messages.client_classes import ROSPY, message_of, numpy_class
from volery.trace.events import Text

LEVELS = {"DEBUG": 1, "INFO": 2, "WARN": 4, "ERROR": 8, "FATAL": 16}
_FUNCTIONS = {
    "debug": (1, 7),
    "info": (2, 6),
    "warn": (4, 4),
    "err": (8, 3),
    "error": (8, 3),
    "fatal": (16, 2),
}
"""Level in ROS 1 and severity in syslog by the name of the function."""


class _Log:
    """The log functions of one severity."""

    def __init__(self, sessions: Sessions, level: int, severity: int) -> None:
        self._sessions, self._level, self._severity = sessions, level, severity
        self._last: dict[tuple[str, str], Ns] = {}

    def log(self, msg: Any, *args: Any, **options: Any) -> None:
        """Log ``msg % args``."""
        self._log(msg, args, caller(1))

    def _log(self, msg: Any, args: tuple[Any, ...], where: Caller) -> None:
        text = str(msg) % args if args else str(msg)
        kernel = self._sessions.kernel
        with kernel.interact():
            kernel.record(Text(kernel.now(), self._sessions.component, self._severity, text))
        session = self._sessions.find()
        if session is None or self._level < LEVELS["INFO"]:
            return
        node = session.node

        def fill(message: Any) -> None:
            now = node.now()
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(now, S)
            message.level, message.name, message.msg = self._level, node.name, text
            message.file, message.function, message.line = where

        session.rosout.publish(fill)

    def throttle(self, period: float, msg: Any, *args: Any) -> None:
        """Log the same *msg* at most once each *period* seconds."""
        kernel = self._sessions.kernel
        with kernel.interact():
            key = (self._sessions.component, str(msg))
            last = self._last.get(key)
            if last is not None and kernel.now() - last < from_seconds(period):
                return
            self._last[key] = kernel.now()
        self._log(msg, args, caller(1))

    def once(self, msg: Any, *args: Any) -> None:
        """Log the same *msg* once."""
        key = (self._sessions.component, str(msg))
        if key not in self._last:
            self._last[key] = 0
            self._log(msg, args, caller(1))

    def throttle_identical(self, period: float, msg: Any, *args: Any) -> None:
        """Log the same text at most once each *period* seconds."""
        self.throttle(period, str(msg) % args if args else msg)


def loggers(sessions: Sessions) -> dict[str, Callable[..., None]]:
    """Return ``loginfo``, ``logwarn_throttle`` and so on by name."""
    found: dict[str, Callable[..., None]] = {}
    for name, (level, severity) in _FUNCTIONS.items():
        log = _Log(sessions, level, severity)
        calls: tuple[Callable[..., None], ...] = (log.log, log.throttle, log.throttle_identical, log.once)
        found |= {f"log{name}{ending}": call for ending, call in zip(_ENDINGS, calls, strict=True)}
    return found


_ENDINGS = ("", "_throttle", "_throttle_identical", "_once")
"""Endings of the names of a severity's functions."""


_NO_DEFAULT = object()


def get_param(sessions: Sessions, param_name: str, default: Any = _NO_DEFAULT) -> Any:
    """Return a parameter; raise ``KeyError`` if there is neither the parameter nor a default."""
    node = sessions.joined().node
    if default is not _NO_DEFAULT:
        return node.get_parameter(param_name, default)
    try:
        return node.get_parameter(param_name)
    except UsageError as error:
        raise KeyError(str(error)) from error


def get_param_cached(sessions: Sessions, param_name: str, default: Any = _NO_DEFAULT) -> Any:
    """Return a parameter, as ``get_param``: the embedded graph needs no cache."""
    return get_param(sessions, param_name, default)


def set_param(sessions: Sessions, param_name: str, param_value: Any) -> None:
    """Set a parameter; raise ``TypeError`` or ``OverflowError`` for a value that XML-RPC cannot carry."""
    sessions.joined().node.set_parameter(param_name, _carried(param_value))


_WHOLE = 2**31
_SCALARS = (bool, float, str, bytes, bytearray, datetime)


def _carried(value: Any) -> Any:
    """Return a value as the parameter server of ROS 1 gives it back: XML-RPC carries the exact types only."""
    kind = type(value)
    if kind is int:
        if not -_WHOLE <= value < _WHOLE:
            raise OverflowError(f"int exceeds XML-RPC limits: {value}; a parameter has 32 bits")
        return value
    if kind in _SCALARS:
        return value
    if kind in (list, tuple):
        return [_carried(one) for one in value]
    if kind is dict:
        for key in value:
            if not isinstance(key, str):
                raise TypeError(f"dictionary key must be string, not {key!r}")
        return {key: _carried(one) for key, one in value.items()}
    if value is None:
        raise TypeError("cannot marshal None unless allow_none is enabled: a parameter cannot be None")
    carried = next((one for one in kind.__mro__ if one in (int, *_SCALARS, list, tuple, dict)), None)
    if carried is None and hasattr(value, "__dict__"):
        return {key: _carried(one) for key, one in vars(value).items()}
    as_what = "float(), int(), str() or tolist()" if carried is None else f"{carried.__name__}()"
    raise TypeError(f"cannot marshal {kind} objects; convert the value by {as_what}")


def has_param(sessions: Sessions, param_name: str) -> bool:
    """Return whether a parameter exists."""
    return sessions.joined().node.has_parameter(param_name)


def delete_param(sessions: Sessions, param_name: str) -> None:
    """Remove a parameter; raise ``KeyError`` if there is none."""
    try:
        sessions.joined().node.delete_parameter(param_name)
    except UsageError as error:
        raise KeyError(str(error)) from error


def get_param_names(sessions: Sessions) -> list[str]:
    """Return the names of all parameters. Works on the embedded graph only."""
    graph = sessions.graph
    if not isinstance(graph, EmbeddedGraph):
        raise UsageError("rospy.get_param_names() works on the embedded graph only")
    with sessions.kernel.interact():
        return graph.parameters.names()


def search_param(sessions: Sessions, param_name: str) -> str | None:
    """Return the full name of the nearest parameter called *param_name*, or None.

    The search begins below this node and continues in its namespace and those above. Of a name with several
    parts, only the first is searched for.
    """
    node = sessions.joined().node
    if param_name == "":
        return None
    if param_name.startswith("~"):
        raise ROSException("cannot search for parameter: invalid key: it begins with ~")
    if param_name.startswith("/"):
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


_BOUND: dict[type, str] = {
    entities.Publisher: "topics",
    entities.Subscriber: "topics",
    entities.Service: "impl.tcpros_service",
    entities.ServiceProxy: "impl.tcpros_service",
    Rate: "timer",
    Timer: "timer",
    Time: "rostime",
}
"""Classes with the modules of rospy that have them."""


def modules(
    graph: RosGraph,
    launched: Mapping[str, Launch] | None = None,
    nodes: Mapping[str, Node] | None = None,
    at_end: AtEnd = ignore_end,
) -> dict[str, ModuleType]:
    """Return the modules that files of a run import, by name: ``rospy``, ``std_msgs.msg`` and so on.

    Args:
        graph: The graph of the run.
        launched: Launch settings by component.
        nodes: Existing nodes by component, which ``init_node`` uses.
        at_end: Registers shutdown hooks for the end of the run.
    """
    sessions = Sessions(graph, launched, nodes, at_end)
    names: dict[str, Any] = {**EXCEPTIONS, **LEVELS, **loggers(sessions), **_functions(sessions)}
    for kind, module in _BOUND.items():
        members = {"__slots__": (), "__module__": f"rospy.{module}", "sessions": sessions}
        names[kind.__name__] = type(kind.__name__, (kind,), members)
    names["Duration"] = Duration
    names["TimerEvent"] = TimerEvent
    names["Header"] = message_of("std_msgs/msg/Header", ROSPY)
    names["Message"] = messages.RosMessage
    names["AnyMsg"] = entities.AnyMsg
    names["SubscribeListener"] = entities.SubscribeListener
    masters = master_names(sessions)
    master = masters.pop("Master")
    names |= masters
    parts: dict[str, dict[str, Any]] = {
        **{part: {one: names[one] for one in inside} for part, inside in _PARTS.items()},
        "names": {
            **{one: NAMES[one] for one in _NAMES_OF_ROSPY},
            **{one: names[one] for one in _NAMES_OF_NODE},
            "TOPIC_ANYTYPE": "*",
            "SERVICE_ANYTYPE": "*",
            "get_ros_namespace": lambda env=None, argv=None: names["get_namespace"](),
        },
        "exceptions": EXCEPTIONS,
        "msg": {"AnyMsg": entities.AnyMsg, "args_kwds_to_message": entities.args_kwds_to_message},
        "numpy_msg": {"numpy_msg": numpy_class},
        "rostime": {
            **{one: names[one] for one in ("Duration", "Time", "get_rostime", "get_time")},
            "is_rostime_initialized": names["is_initialized"],
            "is_wallclock": names.pop("is_wallclock"),
            "wallsleep": names["sleep"],
        },
    }
    core = parts["core"] = {**parts["core"], "is_shutdown_requested": names["is_shutdown"]}
    core["add_client_shutdown_hook"] = names["on_shutdown"]
    core["add_shutdown_hook"] = core["add_preshutdown_hook"] = names.pop("add_preshutdown_hook")
    found = {f"rospy.{part}": library_module(f"rospy.{part}", inside) for part, inside in parts.items()}
    names.pop("is_initialized")  # rospy has it in core alone
    inside = {**names, **{part: found[f"rospy.{part}"] for part in parts if part != "numpy_msg"}}
    rospy = library_module("rospy", inside, REFUSED)
    return {**messages.modules(library=ROSPY), "rospy": rospy, **found, **rosgraph_modules(master, names)}


_NO_ADDRESSES = "nodes of a simulated graph have no addresses"
REFUSED = {
    "rospy.get_node_uri": _NO_ADDRESSES,
    "rospy.parse_rosrpc_uri": _NO_ADDRESSES,
    "rospy.get_ros_root": "rospkg.RosPack finds packages",
    "rospy.impl": "its content is rospy's own; there are no connections",
    "rospy.numpy_msg": "import rospy.numpy_msg, as on a real graph",
    "rospy.logout": "the log is the topic /rosout",
}
"""Names that are not there on purpose, and what to do instead."""
_LOGS = tuple(f"log{name}{ending}" for name in _FUNCTIONS if name != "error" for ending in _ENDINGS)
_NAMES_OF_NODE = ("get_caller_id", "get_name", "get_namespace", "remap_name", "resolve_name")
_NAMES_OF_ROSPY = (
    *("ANYTYPE", "GLOBALNS", "PRIV_NAME", "REMAP", "SEP", "canonicalize_name", "global_name"),
    *("is_global", "is_private", "make_global_ns", "namespace", "ns_join", "scoped_name"),
)
_PARTS: dict[str, tuple[str, ...]] = {
    "client": (
        *("delete_param", "get_master", "get_param", "get_param_cached", "get_param_names", "has_param"),
        *("get_published_topics", "init_node", "myargv", "on_shutdown", "search_param", "set_param", "spin"),
        *("logdebug", "logerr", "loginfo", "logwarn", "wait_for_message"),
    ),
    "core": (*_LOGS, *_NAMES_OF_NODE, "is_shutdown", "signal_shutdown", "is_initialized", "ROSException"),
    "msproxy": ("MasterProxy",),
    "service": ("ServiceException",),
    "timer": ("Rate", "Timer", "TimerEvent", "sleep"),
    "topics": ("Publisher", "SubscribeListener", "Subscriber"),
}
"""Names of rospy's modules that files import from them."""


def _functions(sessions: Sessions) -> dict[str, Callable[..., Any]]:
    """Return the functions of rospy, bound to the sessions of one run."""
    found: tuple[Any, ...] = (
        init_node, is_shutdown, signal_shutdown, on_shutdown, spin, sleep, wait_for_message, wait_for_service,
        get_name, get_namespace, get_time, get_rostime, resolve_name, get_published_topics, myargv,
        is_initialized, remap_name, add_preshutdown_hook, is_wallclock,
        *FUNCTIONS,
    )  # fmt: skip
    bound: dict[str, Callable[..., Any]] = {one.__name__: partial(one, sessions) for one in found}
    return {**bound, "get_caller_id": bound["get_name"]}


def init_node(
    sessions: Sessions, name: str, argv: Any = None, anonymous: bool = False, **options: Any
) -> None:
    """Join the graph. Options about signals, logging and ports are accepted without effect.

    Raises:
        ValueError: the name is empty or has a namespace.
        ROSException: it was called before with other arguments.
    """
    if not name:
        raise ValueError("name must not be empty")
    if "/" in name:
        raise ValueError(
            f"namespaces are not allowed in node names: {name!r}; a launch file or model sets one"
        )
    sessions.join(name, anonymous, *(options.get(one) for one in ("log_level", "disable_rostime")))


IS_SHUTDOWN: Ns = 30
"""Time of ``is_shutdown`` in a loop that polls, ns; of rospy 1.15, measured."""


def is_shutdown(sessions: Sessions) -> bool:
    """Return whether this node is shutting down. An interaction point, as every call is."""
    if not poll(sessions.kernel, IS_SHUTDOWN):
        sessions.kernel.interact()
    session = sessions.find()
    return session is not None and bool(session.shutdown)


def is_initialized(sessions: Sessions) -> bool:
    """Return whether ``init_node`` was called."""
    session = sessions.find()
    return session is not None and session.initialised


def signal_shutdown(sessions: Sessions, reason: str = "") -> None:
    """Shut this node down."""
    sessions.initialised().end(reason)


def on_shutdown(sessions: Sessions, h: Callable[[], Any]) -> None:
    """Call *h* when this node shuts down, or the run ends."""
    sessions.joined().on_shutdown(_hook(h))


def add_preshutdown_hook(sessions: Sessions, h: Callable[[str], Any]) -> None:
    """Call *h* with the reason when this node shuts down, or the run ends."""
    session = sessions.joined()
    hook = _hook(h)
    session.on_shutdown(lambda: hook(session.shutdown))


def _hook(given: Any) -> Any:
    if not callable(given):
        raise TypeError(f"shutdown hook [{given}] must be a function or callable object: {type(given)}")
    return given


def spin(sessions: Sessions) -> None:
    """Block until this node shuts down."""
    sessions.initialised().wait_for_end()


def sleep(sessions: Sessions, duration: Any) -> None:
    """Block for a number of seconds or a ``Duration``; raise ``ROSInterruptException`` at shutdown."""
    session = sessions.initialised()
    if not session.shutdown:
        session.node.sleep(as_ns(duration))
    if session.shutdown:
        session.check()


def _within(timeout: Any) -> int | None:
    return None if timeout is None else as_ns(timeout)


def wait_for_message(sessions: Sessions, topic: str, topic_type: Any, timeout: Any = None) -> Any:
    """Return the next message of a topic."""
    return entities.wait_for_message(sessions.joined(), topic, topic_type, _within(timeout))


def wait_for_service(sessions: Sessions, service: str, timeout: Any = None) -> None:
    """Block until a service is available."""
    entities.wait_for_service(sessions.joined(), service, _within(timeout))


def get_name(sessions: Sessions) -> str:
    """Return the full name of this node."""
    return sessions.joined().node.name


def get_namespace(sessions: Sessions) -> str:
    """Return the namespace of this node with a trailing slash."""
    return f"{sessions.joined().node.namespace.rstrip('/')}/"


def get_time(sessions: Sessions) -> float:
    """Return ROS time in seconds."""
    return float(get_rostime(sessions).to_sec())


def get_rostime(sessions: Sessions) -> Time:
    """Return ROS time."""
    return Time(0, sessions.now())


def resolve_name(sessions: Sessions, name: str, caller_id: str | None = None) -> str:
    """Return the absolute name with remappings applied, optionally as another node sees it."""
    node = sessions.joined().node
    full = resolved(name, caller_id or node.name)
    return node.resolve(full) if full[1:] and is_legal_name(full) else full


def remap_name(sessions: Sessions, name: str) -> str:
    """Return what a name is remapped to, or the name."""
    full = resolved(name, sessions.joined().node.name)
    found = resolve_name(sessions, name)
    return name if found == full else found


def is_wallclock(sessions: Sessions) -> bool:
    """Return whether the parameter ``/use_sim_time`` is not set."""
    return not get_param(sessions, "/use_sim_time", False)


def get_published_topics(sessions: Sessions, namespace: str = "/") -> list[list[str]]:
    """Return the published topics below *namespace* with their types as spelled in ROS 1."""
    with sessions.kernel.interact():
        states = [topic for topic in sessions.graph.topics() if topic.publishers]
    below = namespace.rstrip("/") + "/"
    return [
        [state.name, state.type.replace("/msg/", "/")] for state in states if state.name.startswith(below)
    ]


def myargv(sessions: Sessions, argv: Sequence[str] | None = None) -> list[str]:
    """Return the command line, by default that of this component, without the arguments of ROS."""
    launch = sessions.launch_of(sessions.component)
    given = launch.arguments if argv is None and launch is not None else argv or ()
    return [one for one in given if ":=" not in one]
