"""The modules of ``rclpy`` for one run, and the message packages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from types import ModuleType
from typing import Any

from volery.ros import messages
from volery.ros.client_libraries.library_base import AtEnd, Launch, ignore_end, library_module
from volery.ros.client_libraries.rclpy import (
    action,
    entities,
    executors,
    lifecycle,
    node_parameters,
    ros_time,
)
from volery.ros.client_libraries.rclpy.context import (
    EXCEPTIONS,
    Context,
    Contexts,
    ExternalShutdownException,
    Logger,
    LoggingSeverity,
    NotInitializedException,
    ShutdownException,
    TimeoutException,
    logging_functions,
)
from volery.ros.client_libraries.rclpy.entities import QOS
from volery.ros.client_libraries.rclpy.executors import Executor, Future
from volery.ros.client_libraries.rclpy.node import Node
from volery.ros.graph import Node as GraphNode
from volery.ros.graph import RosGraph


def modules(
    graph: RosGraph,
    launched: Mapping[str, Launch] | None = None,
    nodes: Mapping[str, GraphNode] | None = None,
    at_end: AtEnd = ignore_end,
) -> dict[str, ModuleType]:
    """Return the modules that files of a run import, by name: ``rclpy``, ``rclpy.node``, ``std_msgs.msg`` ...

    For the arguments see ``rospy.modules``.
    """
    contexts = Contexts(graph, launched, nodes, at_end)
    bound = _bound_classes(contexts)
    parts = _submodules(bound)
    names: dict[str, Any] = {**_functions(contexts, bound), "Parameter": node_parameters.Parameter}
    found = {f"rclpy.{part}": library_module(f"rclpy.{part}", inside) for part, inside in parts.items()}
    rclpy = library_module("rclpy", {**names, **{part: found[f"rclpy.{part}"] for part in parts}})
    return {**messages.modules(), "rclpy": rclpy, **found}


def _bound_classes(contexts: Contexts) -> dict[str, Any]:
    """Return the classes that refer to the contexts of their run."""
    kinds: tuple[type, ...] = (
        executors.MultiThreadedExecutor,
        executors.SingleThreadedExecutor,
        Logger,
        ros_time.Clock,
        ros_time.ROSClock,
    )
    bound: dict[str, Any] = {
        kind.__name__: type(kind.__name__, (kind,), {"contexts": contexts}) for kind in kinds
    }
    members = {"contexts": contexts, "loggers": bound["Logger"], "clocks": bound["Clock"]}
    nodes = {
        "Node": type("Node", (Node,), members),
        "LifecycleNode": type("LifecycleNode", (lifecycle.LifecycleNode,), members),
    }
    return {**bound, **nodes}


def _submodules(bound: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the content of each submodule."""
    duration = {"Duration": ros_time.Duration, "Infinite": ros_time.Infinite}
    return {
        "action": action.ACTION,
        "callback_groups": {
            kind.__name__: kind
            for kind in (
                executors.CallbackGroup,
                executors.MutuallyExclusiveCallbackGroup,
                executors.ReentrantCallbackGroup,
            )
        },
        "client": {"Client": entities.Client},
        "clock": {"ClockType": ros_time.ClockType, "Clock": bound["Clock"], "ROSClock": bound["ROSClock"]},
        "context": {"Context": Context},
        "duration": duration,
        "exceptions": EXCEPTIONS,
        "executors": {
            "Executor": Executor,
            "ExternalShutdownException": ExternalShutdownException,
            "MultiThreadedExecutor": bound["MultiThreadedExecutor"],
            "ShutdownException": ShutdownException,
            "SingleThreadedExecutor": bound["SingleThreadedExecutor"],
            "TimeoutException": TimeoutException,
        },
        "lifecycle": {
            **lifecycle.LIFECYCLE,
            "LifecycleNode": bound["LifecycleNode"],
            "Node": bound["LifecycleNode"],
        },
        "logging": {"LoggingSeverity": LoggingSeverity, **logging_functions(bound["Logger"])},
        "node": {"Node": bound["Node"]},
        "parameter": {"Parameter": node_parameters.Parameter},
        "publisher": {"Publisher": entities.Publisher},
        "qos": {**QOS, **duration},
        "service": {"Service": entities.Service},
        "subscription": {"Subscription": entities.Subscription},
        "task": {"Future": executors.Future, "Task": executors.Task},
        "time": {"Time": ros_time.Time, "Duration": ros_time.Duration, "ClockType": ros_time.ClockType},
        "timer": {"Rate": ros_time.Rate, "Timer": entities.Timer},
    }


def _functions(contexts: Contexts, bound: Mapping[str, Any]) -> dict[str, Callable[..., Any]]:
    """Return the functions of rclpy, bound to one run."""

    def global_executor() -> Executor:
        context = contexts.current()
        if context.executor is None:
            if not context.running:
                raise NotInitializedException()
            context.executor = bound["SingleThreadedExecutor"]()
        used: Executor = context.executor
        return used

    of_contexts: tuple[Any, ...] = (init, shutdown, try_shutdown, ok, get_default_context)
    of_executor: tuple[Any, ...] = (spin, spin_once, spin_until_future_complete, get_global_executor)
    return {
        **{one.__name__: partial(one, contexts) for one in of_contexts},
        **{one.__name__: partial(one, global_executor) for one in of_executor},
        "create_node": bound["Node"],
    }


def init(contexts: Contexts, *, args: Any = None, context: Context | None = None, **options: Any) -> None:
    """Start the context of this component."""
    (context or contexts.current()).init(args, **options)


def shutdown(contexts: Contexts, *, context: Context | None = None, **options: Any) -> None:
    """End the context of this component."""
    (context or contexts.current()).shutdown()


def try_shutdown(contexts: Contexts, *, context: Context | None = None, **options: Any) -> None:
    """End the context of this component, if it runs."""
    (context or contexts.current()).try_shutdown()


def ok(contexts: Contexts, *, context: Context | None = None) -> bool:
    """Return whether the context of this component runs."""
    return (context or contexts.current()).ok()


def get_default_context(contexts: Contexts) -> Context:
    """Return the context of this component."""
    return contexts.current()


GlobalExecutor = Callable[[], Executor]
"""Returns the executor of ``rclpy.spin``, which is created by the first call."""


def get_global_executor(global_executor: GlobalExecutor) -> Executor:
    """Return the executor of ``rclpy.spin``."""
    return global_executor()


def spin(global_executor: GlobalExecutor, node: Node, executor: Executor | None = None) -> None:
    """Run the callbacks of *node* until the context is shut down."""
    used = executor or global_executor()
    added = used.add_node(node)
    try:
        while used.context.ok():
            used.spin_once()
    finally:
        if added:
            used.remove_node(node)


def spin_once(
    global_executor: GlobalExecutor,
    node: Node,
    *,
    executor: Executor | None = None,
    timeout_sec: float | None = None,
) -> None:
    """Wait for a callback of *node* and run it."""
    used = executor or global_executor()
    added = used.add_node(node)
    try:
        used.spin_once(timeout_sec=timeout_sec)
    finally:
        if added:
            used.remove_node(node)


def spin_until_future_complete(
    global_executor: GlobalExecutor,
    node: Node,
    future: Future,
    executor: Executor | None = None,
    timeout_sec: float | None = None,
) -> None:
    """Run the callbacks of *node* until *future* is done."""
    used = executor or global_executor()
    added = used.add_node(node)
    try:
        used.spin_until_future_complete(future, timeout_sec)
    finally:
        if added:
            used.remove_node(node)
