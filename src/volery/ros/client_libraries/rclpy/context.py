"""What does not depend on a node in rclpy: exceptions, ``Context`` and loggers.

A ``Context`` is the state of one component, its graph nodes, and its shutdown. A logged line is recorded in
the trace under the name of the component.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

from volery.base.errors import UsageError
from volery.base.time import Ns, S, from_seconds
from volery.kernel.waiting import Signal, current_task, poll, read_clock
from volery.ros.client_libraries.library_base import (
    AtEnd,
    Caller,
    Launch,
    LaunchedComponents,
    Rosout,
    caller,
    ignore_end,
    node_of_file,
)
from volery.ros.graph import Node, RosGraph
from volery.trace.events import Text

OK: Ns = 960
READ_CLOCK: Ns = 1700
"""Time of ``rclpy.ok`` and ``Clock.now`` in a loop that polls, ns; of rclpy Jazzy, measured."""


class RCLError(RuntimeError):
    """A failure that rcl reports."""


class NodeNameNonExistentError(RCLError):
    """There is no node of this name."""


class NotInitializedException(Exception):  # noqa: N818 - rclpy's name
    """A call before ``rclpy.init()`` or after ``rclpy.shutdown()``."""

    def __init__(self, *words: Any) -> None:
        super().__init__(*(words or ("rclpy.init() has not been called",)))


class ShutdownException(Exception):  # noqa: N818 - rclpy's name
    """The executor was shut down."""


class ExternalShutdownException(Exception):  # noqa: N818 - rclpy's name
    """The context was shut down while an executor was spinning."""

    def __init__(self) -> None:
        super().__init__("context was shut down")


class TimeoutException(Exception):  # noqa: N818 - rclpy's name
    """Nothing became ready before the time-out."""


class ConditionReachedException(Exception):  # noqa: N818 - rclpy's name
    """What an executor waited for has come true."""


class NoTypeSupportImportedException(Exception):  # noqa: N818 - rclpy's name
    """A class is no message or service class."""


class InvalidHandle(Exception):  # noqa: N818 - rclpy's name
    """A destroyed entity is used."""


class ROSInterruptException(Exception):  # noqa: N818 - rclpy's name
    """The context was shut down while a rate slept."""

    def __init__(self) -> None:
        super().__init__("rclpy has been shut down")


class NameValidationException(Exception):  # noqa: N818 - rclpy's name
    """A name is not a valid ROS name."""


class ParameterException(Exception):  # noqa: N818 - rclpy's name
    """Base class of the errors about parameters."""

    def __init__(self, error_msg: str, parameters: Any) -> None:
        super().__init__(f"{error_msg}: {parameters}")


class ParameterNotDeclaredException(ParameterException):
    """A parameter is not declared."""

    def __init__(self, parameters: Any) -> None:
        super().__init__("Invalid access to undeclared parameter(s)", parameters)


class ParameterAlreadyDeclaredException(ParameterException):
    """A parameter is declared twice."""

    def __init__(self, parameters: Any) -> None:
        super().__init__("Parameter(s) already declared", parameters)


class ParameterImmutableException(ParameterException):
    """A parameter is read-only."""

    def __init__(self, parameter: Any) -> None:
        super().__init__("Attempted to modify read-only parameter", parameter)


class ParameterUninitializedException(ParameterException):
    """A parameter was declared without a value and has none."""

    def __init__(self, parameter: Any) -> None:
        super().__init__(f"The parameter '{parameter}' is not initialized", parameter)


class InvalidParameterException(ParameterException):
    """A name of a parameter is invalid."""

    def __init__(self, parameter: Any) -> None:
        super().__init__("Invalid parameter name", parameter)


class InvalidParameterTypeException(ParameterException):
    """A value has another type than was declared."""

    def __init__(self, desired: Any, current: str) -> None:
        super().__init__(
            f"Trying to set parameter '{desired.name}' to '{desired.value}' of type "
            f"'{desired.type_.name}', expecting type '{current}'",
            desired.name,
        )


class InvalidParameterValueException(ParameterException):
    """A value was refused."""

    def __init__(self, parameter: Any, value: Any, reason: str) -> None:
        super().__init__(f"Invalid parameter value ({value}) for parameter. Reason: {reason}", parameter)


EXCEPTIONS = {
    kind.__name__: kind
    for kind in (
        NotInitializedException,
        NameValidationException,
        NoTypeSupportImportedException,
        InvalidHandle,
        InvalidParameterException,
        InvalidParameterTypeException,
        InvalidParameterValueException,
        ParameterAlreadyDeclaredException,
        ParameterException,
        ParameterImmutableException,
        ParameterNotDeclaredException,
        ParameterUninitializedException,
        ROSInterruptException,
    )
}
"""Content of ``rclpy.exceptions``."""


def private_name(parameter: str) -> str:
    """Return the name on the graph of a node's parameter, whose own name may have any characters."""
    parts = re.split(r"[./]+", parameter.strip("./"))
    return "~" + "/".join(re.sub(r"\W", "_", f"_{part}" if part[:1].isdigit() else part) for part in parts)


class Context:
    """State of one component. ``rclpy.init()`` starts it, ``rclpy.shutdown()`` ends it; it can be restarted.

    A ``node_name`` of the model, as a launch file's ``name``, names its first node; further nodes keep
    their own names.
    """

    def __init__(self, graph: RosGraph, component: str, launch: Launch | None, node: Node | None) -> None:
        self._graph = graph
        self._component = component
        self._launch = launch
        self._given = node
        self._nodes: list[Node] = []
        self._started = self._end_requested = False
        self.at_end: AtEnd = ignore_end
        self._hooks: list[Callable[[], Any]] = []
        self.kernel = graph.kernel
        self.changed = Signal(graph.kernel, f"{component} (rclpy)")
        self.executor: Any = None
        """The ``Executor`` of ``rclpy.spin``, or None. It is untyped because executors depend on contexts."""
        self.task = current_task(graph.kernel)

    def init(self, args: Any = None, **options: Any) -> None:
        """Start the context. Options about signals and domains are accepted without effect."""
        if self._started:
            raise RuntimeError("Context.init() must only be called once")
        self._started = True

    def ok(self) -> bool:
        """Return whether the context runs. An interaction point, as every call is."""
        if not poll(self.kernel, OK):
            self.kernel.interact()
        return self._started

    @property
    def running(self) -> bool:
        """Whether the context runs; unlike ``ok``, no interaction point."""
        return self._started

    @property
    def handle(self) -> Context:
        """The context itself: it has no handle in C."""
        return self

    def get_domain_id(self) -> int:
        """Return the ROS domain of the environment, which the embedded graph does not use."""
        return int(os.environ.get("ROS_DOMAIN_ID") or 0)

    def on_shutdown(self, callback: Callable[[], Any]) -> None:
        """Call *callback* at shutdown or at the end of the run."""
        if not self._end_requested:
            self._end_requested = True
            self.at_end(self.task.context, self.try_shutdown)
        self.on_end(callback)

    def on_end(self, action: Callable[[], Any]) -> None:
        """Call *action* at shutdown, but not at the end of the run, which it must not delay."""
        self._hooks.append(action)

    def shutdown(self) -> None:
        """End the context: ``spin`` returns. Nodes exist until they are destroyed, but are not spun."""
        if not self._started:
            raise RuntimeError("rcl_shutdown already called on the given context")
        if self.executor is not None:
            self.executor.shutdown()  # so ``rclpy.spin`` returns, where another executor's raises
        self.try_shutdown()

    def try_shutdown(self) -> None:
        """End the context, if it runs."""
        if self._started:
            self._started = False
            for hook in self._hooks:
                hook()
            self._hooks.clear()
            self.executor = None
            self.changed.notify()

    def destroy(self) -> None:
        """Do nothing: a context holds no resources in C."""

    def __enter__(self) -> Context:
        self.init()
        return self

    def __exit__(self, *_: object) -> None:
        self.try_shutdown()

    # -- nodes

    def create_graph_node(self, name: str, namespace: str | None) -> Node:
        """Return a new node of the graph."""
        if not self._started:
            raise NotInitializedException("cannot create node: rclpy.init() has not been called")
        first = not self._nodes and self._launch is not None
        launch = self._launch or Launch()
        where = namespace if namespace is not None and launch.namespace == "/" else launch.namespace
        where = where if where.startswith("/") else f"/{where}"
        given = self._given if first else None
        made = node_of_file(
            self._graph, self._component, name, self._launch, given, namespace=where, first=first
        )
        if first:
            for key, value in launch.parameters.items():
                made.set_parameter(private_name(key), value)
        self._nodes.append(made)
        return made

    def launched(self, node: Node) -> Mapping[str, Any]:
        """Return the parameters that a node was launched with."""
        return self._launch.parameters if self._launch is not None and node is self._nodes[0] else {}

    def first_node(self) -> Node:
        """Return the first node, which is charged for calls that name no node."""
        if not self._nodes:
            raise UsageError(f"{self._component}: create a node first")
        return self._nodes[0]

    def close_graph_node(self, node: Node) -> None:
        """Remove a destroyed node from the graph."""
        node.close()
        self.changed.notify()

    def sleep(self, duration: Ns) -> None:
        """Block the current task."""
        self.first_node().sleep(duration)

    def spawn(self, body: Callable[[], None], label: str) -> None:
        """Run *body* in a helper task of this component."""
        context = replace(self.task.context, deadline=None, period=None, on_release=None)
        self.kernel.spawn(body, f"{self._component} ({label})", context, self.task.scope)

    def log(self, severity: int, text: str) -> None:
        """Record a log line. An interaction point."""
        kernel = self.kernel
        with kernel.interact():
            kernel.record(Text(kernel.now(), self._component, severity, text))


@dataclass(eq=False)
class Contexts(LaunchedComponents):
    """Contexts of all components of one run that import rclpy."""

    levels: dict[str, int] = field(default_factory=dict, init=False)
    """Log levels by logger name."""
    _contexts: dict[str, Context] = field(default_factory=dict, init=False)

    def current(self) -> Context:
        """Return the context of the component that the current task belongs to."""
        component = self.component
        found = self._contexts.get(component)
        if found is None or self.started_again(found.task.scope):
            launch, node = self.launch_of(component), self.node_of(component)
            found = self._contexts[component] = Context(self.graph, component, launch, node)
            found.at_end = self.at_end
        return found

    def now(self) -> Ns:
        """Return ROS time. An interaction point."""
        polling = poll(self.kernel, READ_CLOCK)
        return self.graph.epoch + (self.kernel.now() if polling else read_clock(self.kernel))


class LoggingSeverity(IntEnum):
    """Log levels of rclpy."""

    UNSET = 0
    DEBUG = 10
    INFO = 20
    WARN = 30
    ERROR = 40
    FATAL = 50


_SYSLOG = {
    LoggingSeverity.DEBUG: 7,
    LoggingSeverity.INFO: 6,
    LoggingSeverity.WARN: 4,
    LoggingSeverity.ERROR: 3,
    LoggingSeverity.FATAL: 2,
}


_FILTERS = ("throttle_duration_sec", "throttle_time_source_type", "skip_first", "once")


@dataclass
class _Place:
    """A call of a logger in a file."""

    level: LoggingSeverity
    filters: tuple[str, ...]
    seen: bool = False
    logged: bool = False
    latest: Ns | None = None

    def allows(self, now: Callable[[], Ns], options: dict[str, Any]) -> bool:
        """Return whether the filters let a line pass now."""
        seen, self.seen = self.seen, True
        if (options.get("once") and self.logged) or (options.get("skip_first") and not seen):
            return False
        period = options.get("throttle_duration_sec")
        if period is not None:
            at = now()
            if self.latest is not None and at - self.latest < from_seconds(period):
                return False
            self.latest = at
        self.logged = True
        return True


class Logger:
    """Logger of node.get_logger(). What it remembers of a call belongs to the call's place in the file."""

    contexts: ClassVar[Contexts]

    def __init__(self, name: str, rosout: Rosout | None = None) -> None:
        self.name = name
        self._rosout = rosout
        self._places: dict[tuple[Any, ...], _Place] = {}

    def get_child(self, name: str) -> Logger:
        """Return a logger below this one."""
        return type(self)(f"{self.name}.{name}", self._rosout)

    def set_level(self, level: int) -> None:
        """Set the lowest severity that this logger and the loggers below it log."""
        self.contexts.levels[self.name] = int(level)

    def get_effective_level(self) -> LoggingSeverity:
        """Return the level of this logger, or that of the nearest logger above that has one."""
        name = self.name
        while name and name not in self.contexts.levels:
            name = name.rpartition(".")[0]
        return LoggingSeverity(self.contexts.levels.get(name, LoggingSeverity.INFO))

    def is_enabled_for(self, severity: int) -> bool:
        """Return whether a line of this severity would be logged."""
        return severity >= self.get_effective_level()

    def log(self, message: Any, severity: int, **options: Any) -> bool:
        """Log a line; return False if it was suppressed."""
        return self._log(message, LoggingSeverity(severity), caller(1), options)

    def _log(self, message: Any, level: LoggingSeverity, where: Caller, options: dict[str, Any]) -> bool:
        unknown = sorted(options.keys() - _FILTERS)
        if unknown:
            text = f"parameter {unknown[0]!r} is not one of the recognized logging options {list(_FILTERS)}"
            raise TypeError(text)
        if level < self.get_effective_level() or not self._place(level, options).allows(
            self.contexts.now, options
        ):
            return False
        if not isinstance(message, str):
            raise TypeError(f"a log line is a str, not {message!r}; use str() or an f-string")
        self.contexts.current().log(_SYSLOG[level], message)
        if self._rosout is not None:
            self._rosout.publish(partial(self._fill, level, message, where))
        return True

    def _place(self, level: LoggingSeverity, options: dict[str, Any]) -> _Place:
        """Return what is remembered of a call's place; ``ValueError`` if it was called otherwise before."""
        frame = sys._getframe(3)
        code = frame.f_code
        key = (code.co_filename, code.co_name, frame.f_lineno, frame.f_lasti)
        filters = tuple(sorted(name for name in options if options[name]))
        known = self._places.setdefault(key, _Place(level, filters))
        if known.level != level:
            raise ValueError("Logger severity cannot be changed between calls.")
        if known.filters != filters:
            raise ValueError("Requested logging filters cannot be changed between calls.")
        return known

    def _fill(self, level: int, text: str, where: Caller, message: Any) -> None:
        message.stamp.sec, message.stamp.nanosec = divmod(self.contexts.now(), S)
        message.level, message.name, message.msg = int(level), self.name, text
        message.file, message.function, message.line = where

    def debug(self, message: Any, **options: Any) -> bool:
        """Log a line for developers."""
        return self._log(message, LoggingSeverity.DEBUG, caller(1), options)

    def info(self, message: Any, **options: Any) -> bool:
        """Log information."""
        return self._log(message, LoggingSeverity.INFO, caller(1), options)

    def warning(self, message: Any, **options: Any) -> bool:
        """Log a warning."""
        return self._log(message, LoggingSeverity.WARN, caller(1), options)

    warn = warning

    def error(self, message: Any, **options: Any) -> bool:
        """Log an error."""
        return self._log(message, LoggingSeverity.ERROR, caller(1), options)

    def fatal(self, message: Any, **options: Any) -> bool:
        """Log a fatal error."""
        return self._log(message, LoggingSeverity.FATAL, caller(1), options)


def initialize() -> None:
    """Do nothing: logging needs no preparation."""


def shutdown() -> None:
    """Do nothing: log lines are written at once."""


def clear_config() -> None:
    """Do nothing: there is no configuration of logging."""


def get_logging_directory() -> Path:
    """Return the folder of ROS's logs by the environment; lines of a run are in its trace."""
    return Path(os.environ.get("ROS_LOG_DIR") or Path.home() / ".ros" / "log")


_ROUTINES: tuple[Any, ...] = (initialize, shutdown, clear_config, get_logging_directory)


def logging_functions(loggers: type[Logger]) -> dict[str, Callable[..., Any]]:
    """Return the functions of ``rclpy.logging`` by name."""

    def set_logger_level(name: str, level: int, detailed_error: bool = False) -> None:
        loggers(name).set_level(level)

    def get_logger_effective_level(name: str) -> LoggingSeverity:
        return loggers(name).get_effective_level()

    def get_logger_level(name: str) -> LoggingSeverity:
        return LoggingSeverity(loggers.contexts.levels.get(name, LoggingSeverity.UNSET))

    def get_logging_severity_from_string(log_severity: str) -> LoggingSeverity:
        return LoggingSeverity[log_severity.upper()]

    found: tuple[Any, ...] = (
        set_logger_level,
        get_logger_effective_level,
        get_logger_level,
        get_logging_severity_from_string,
    )
    return {"get_logger": loggers, **{one.__name__: one for one in (*found, *_ROUTINES)}}
