"""The ``rclpy`` package of one run, and the message packages beside it."""

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
    errors,
    executors,
    lifecycle,
    logging,
    parameters,
    qos,
)
from volery.ros.client_libraries.rclpy import executors as callback_groups
from volery.ros.client_libraries.rclpy import executors as tasks
from volery.ros.client_libraries.rclpy import time as times
from volery.ros.client_libraries.rclpy.context import Context, Contexts
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
    """What the files of a run import: ``rclpy``, ``rclpy.node``, ``std_msgs.msg`` and so on, by name.

    *launched*, *nodes* and *at_end* as in ``faces.rospy.modules``.
    """
    contexts = Contexts(graph, launched, nodes, at_end)
    bound = _bound(contexts)
    parts = _parts(bound)
    names: dict[str, Any] = {**_functions(contexts, bound), "Parameter": parameters.Parameter}
    found = {f"rclpy.{part}": library_module(f"rclpy.{part}", inside) for part, inside in parts.items()}
    rclpy = library_module("rclpy", {**names, **{part: found[f"rclpy.{part}"] for part in parts}})
    return {**messages.modules(), "rclpy": rclpy, **found}


def _bound(contexts: Contexts) -> dict[str, Any]:
    """The classes that know their run."""
    kinds: tuple[type, ...] = (
        executors.MultiThreadedExecutor,
        executors.SingleThreadedExecutor,
        logging.Logger,
        times.Clock,
        times.ROSClock,
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


def _parts(bound: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """What is in each module of the package."""
    timing = {"Duration": times.Duration, "Infinite": times.Infinite}
    return {
        "action": action.ACTION,
        "callback_groups": {
            kind.__name__: kind
            for kind in (
                callback_groups.CallbackGroup,
                callback_groups.MutuallyExclusiveCallbackGroup,
                callback_groups.ReentrantCallbackGroup,
            )
        },
        "client": {"Client": entities.Client},
        "clock": {"ClockType": times.ClockType, "Clock": bound["Clock"], "ROSClock": bound["ROSClock"]},
        "context": {"Context": Context},
        "duration": timing,
        "exceptions": errors.EXCEPTIONS,
        "executors": {
            "Executor": Executor,
            "ExternalShutdownException": errors.ExternalShutdownException,
            "MultiThreadedExecutor": bound["MultiThreadedExecutor"],
            "ShutdownException": errors.ShutdownException,
            "SingleThreadedExecutor": bound["SingleThreadedExecutor"],
            "TimeoutException": errors.TimeoutException,
        },
        "lifecycle": {
            **lifecycle.LIFECYCLE,
            "LifecycleNode": bound["LifecycleNode"],
            "Node": bound["LifecycleNode"],
        },
        "logging": {"LoggingSeverity": logging.LoggingSeverity, **logging.functions(bound["Logger"])},
        "node": {"Node": bound["Node"]},
        "parameter": {"Parameter": parameters.Parameter},
        "publisher": {"Publisher": entities.Publisher},
        "qos": {**qos.QOS, **timing},
        "service": {"Service": entities.Service},
        "subscription": {"Subscription": entities.Subscription},
        "task": {"Future": tasks.Future, "Task": tasks.Task},
        "time": {"Time": times.Time, "Duration": times.Duration, "ClockType": times.ClockType},
        "timer": {"Rate": times.Rate, "Timer": entities.Timer},
    }


def _functions(contexts: Contexts, bound: Mapping[str, Any]) -> dict[str, Callable[..., Any]]:
    """The functions of rclpy, bound to one run."""
    single = bound["SingleThreadedExecutor"]
    found: tuple[Any, ...] = (init, shutdown, try_shutdown, ok, get_default_context)
    spinning: tuple[Any, ...] = (spin, spin_once, spin_until_future_complete, get_global_executor)
    return {
        **{one.__name__: partial(one, contexts) for one in found},
        **{one.__name__: partial(one, lambda: _global(contexts, single)) for one in spinning},
        "create_node": bound["Node"],
    }


def init(contexts: Contexts, *, args: Any = None, context: Context | None = None, **options: Any) -> None:
    """Start the context of this component."""
    (context or contexts.here()).init(args, **options)


def shutdown(contexts: Contexts, *, context: Context | None = None, **options: Any) -> None:
    """End the context of this component."""
    (context or contexts.here()).shutdown()


def try_shutdown(contexts: Contexts, *, context: Context | None = None, **options: Any) -> None:
    """End the context of this component, if it runs."""
    (context or contexts.here()).try_shutdown()


def ok(contexts: Contexts, *, context: Context | None = None) -> bool:
    """Whether the context of this component runs."""
    return (context or contexts.here()).ok()


def get_default_context(contexts: Contexts) -> Context:
    """That of this component."""
    return contexts.here()


def _global(contexts: Contexts, kind: Callable[[], Executor]) -> Executor:
    context = contexts.here()
    if context.executor is None:
        if not context.running:
            raise errors.NotInitializedException()
        context.executor = kind()
    return context.executor


UsualExecutor = Callable[[], Executor]


def get_global_executor(usual: UsualExecutor) -> Executor:
    """The one that ``rclpy.spin`` uses."""
    return usual()


def spin(usual: UsualExecutor, node: Node, executor: Executor | None = None) -> None:
    """Run the callbacks of *node* as they come, until the context is shut down."""
    used = executor or usual()
    added = used.add_node(node)
    try:
        while used.context.ok():
            used.spin_once()
    finally:
        if added:
            used.remove_node(node)


def spin_once(
    usual: UsualExecutor, node: Node, *, executor: Executor | None = None, timeout_sec: float | None = None
) -> None:
    """Wait for a callback of *node* and run it."""
    used = executor or usual()
    added = used.add_node(node)
    try:
        used.spin_once(timeout_sec=timeout_sec)
    finally:
        if added:
            used.remove_node(node)


def spin_until_future_complete(
    usual: UsualExecutor,
    node: Node,
    future: Future,
    executor: Executor | None = None,
    timeout_sec: float | None = None,
) -> None:
    """Run the callbacks of *node* as they come until *future* is done."""
    used = executor or usual()
    added = used.add_node(node)
    try:
        used.spin_until_future_complete(future, timeout_sec)
    finally:
        if added:
            used.remove_node(node)
