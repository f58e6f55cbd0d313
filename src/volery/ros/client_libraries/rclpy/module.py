"""The modules of ``rclpy`` for one run, and the message packages."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from enum import IntEnum
from functools import partial
from types import ModuleType
from typing import Any

from volery.base.time import S
from volery.kernel.waiting import Signal
from volery.ros import messages
from volery.ros.client_libraries.library_base import AtEnd, Launch, ignore_end, library_module
from volery.ros.client_libraries.rclpy import (
    action,
    endpoint_info,
    entities,
    events,
    executors,
    lifecycle,
    names,
    node_parameters,
    parameter_client,
    qos_overrides,
    ros_time,
)
from volery.ros.client_libraries.rclpy.context import (
    EXCEPTIONS,
    ConditionReachedException,
    Context,
    Contexts,
    ExternalShutdownException,
    Logger,
    LoggingSeverity,
    NodeNameNonExistentError,
    NotInitializedException,
    NoTypeSupportImportedException,
    ShutdownException,
    TimeoutException,
    logging_functions,
)
from volery.ros.client_libraries.rclpy.executors import Executor, Future
from volery.ros.client_libraries.rclpy.node import Node
from volery.ros.client_libraries.rclpy.qos import QOS, graph_qos
from volery.ros.graph import Node as GraphNode
from volery.ros.graph import RosGraph
from volery.ros.messages.client_classes import RCLPY, adopt, library_of, message_of


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
    functions = _functions(contexts, bound)
    parts = {"impl": {}, **_submodules(bound, functions)}
    parts["node"] |= {name: parts[part][name] for part, inside in _OF_NODE.items() for name in inside}
    parts["node"] |= {name: message_of(f"rcl_interfaces/msg/{name}", RCLPY) for name in _MESSAGES_OF_NODE}
    top: dict[str, Any] = {
        **functions,
        "Context": Context,
        "Future": executors.Future,
        "Parameter": node_parameters.Parameter,
        "SignalHandlerOptions": SignalHandlerOptions,
        "get_rmw_implementation_identifier": get_rmw_implementation_identifier,
        "install_signal_handlers": install_signal_handlers,
        "uninstall_signal_handlers": uninstall_signal_handlers,
    }
    found = {"rclpy": library_module("rclpy", top, REFUSED)}
    for part, inside in sorted(parts.items()):  # a package before what is in it
        above, _, last = f"rclpy.{part}".rpartition(".")
        made = found[f"rclpy.{part}"] = library_module(f"rclpy.{part}", inside, REFUSED)
        setattr(found[above], last, made)
    return {**messages.modules(library=RCLPY), **found}


def _bound_classes(contexts: Contexts) -> dict[str, Any]:
    """Return the classes that refer to the contexts of their run."""
    kinds: tuple[type, ...] = (
        executors.Executor,
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


def _submodules(
    bound: Mapping[str, Any], functions: Mapping[str, Callable[..., Any]]
) -> dict[str, dict[str, Any]]:
    """Return the content of each submodule."""
    logging = {"LoggingSeverity": LoggingSeverity, **logging_functions(bound["Logger"])}
    managed = {**lifecycle.LIFECYCLE, "LifecycleNode": bound["LifecycleNode"], "Node": bound["LifecycleNode"]}
    of_run: dict[str, dict[str, Any]] = {
        "clock": _chosen(bound, "Clock", "ROSClock"),
        "executors": _chosen(bound, "Executor", "MultiThreadedExecutor", "SingleThreadedExecutor"),
        "impl.rcutils_logger": {"RcutilsLogger": bound["Logger"]},
        "lifecycle": managed,
        "lifecycle.node": managed,
        "logging": logging,
        "node": _chosen(bound, "Node"),
        "utilities": _chosen(functions, "get_default_context", "ok", "shutdown", "try_shutdown"),
    }
    shared = _submodules_of_all_runs()
    return {part: {**shared.get(part, {}), **of_run.get(part, {})} for part in {**shared, **of_run}}


def _chosen(content: Mapping[str, Any], *names: str) -> dict[str, Any]:
    return {name: content[name] for name in names}


def _named(*members: Any) -> dict[str, Any]:
    return {member.__name__: member for member in members}


def _submodules_of_all_runs() -> dict[str, dict[str, Any]]:
    """Return what refers to no run, of each submodule."""
    clock_type = _named(ros_time.ClockType)
    duration = {**_named(ros_time.Duration), "Infinite": ros_time.Infinite}
    groups = _named(
        executors.CallbackGroup, executors.MutuallyExclusiveCallbackGroup, executors.ReentrantCallbackGroup
    )
    parameter = {**_named(node_parameters.Parameter), **parameter_client.PARAMETER_TEXTS}
    ends = (ConditionReachedException, ExternalShutdownException, ShutdownException, TimeoutException)
    handlers = (install_signal_handlers, uninstall_signal_handlers, get_current_signal_handlers_options)
    middleware = (get_available_rmw_implementations, get_rmw_implementation_identifier)
    return {
        "action": action.ACTION,
        "action.client": action.CLIENT,
        "action.graph": action.GRAPH,
        "action.server": action.SERVER,
        "callback_groups": groups,
        "client": _named(entities.Client),
        "clock": {**ros_time.JUMPS, **clock_type, **duration},
        "clock_type": clock_type,
        "constants": {"S_TO_NS": S},
        "context": _named(Context),
        "duration": duration,
        "event_handler": events.EVENTS,
        "exceptions": {**EXCEPTIONS, **names.NAME_EXCEPTIONS},
        "executors": _named(*ends, executors.await_or_execute),
        "guard_condition": _named(entities.GuardCondition),
        "impl.logging_severity": _named(LoggingSeverity),
        "lifecycle.managed_entity": lifecycle.LIFECYCLE,
        "lifecycle.publisher": _named(lifecycle.LifecyclePublisher),
        "node": {**_named(NodeNameNonExistentError), "HIDDEN_NODE_PREFIX": "_", **parameter, **groups},
        "parameter": parameter,
        "parameter_client": parameter_client.PARAMETER_CLIENT,
        "parameter_event_handler": parameter_client.PARAMETER_EVENTS,
        "publisher": _named(entities.Publisher),
        "qos": {**QOS, **duration},
        "qos_event": events.EVENTS,
        "qos_overriding_options": qos_overrides.OVERRIDES,
        "serialization": _named(serialize_message, deserialize_message),
        "service": _named(entities.Service),
        "service_introspection": _named(ServiceIntrospectionState),
        "signals": _named(SignalHandlerOptions, *handlers),
        "subscription": _named(entities.Subscription),
        "task": _named(executors.Future, executors.Task),
        "time": {**_named(ros_time.Time), **duration, **clock_type},
        "timer": _named(ros_time.Rate, entities.Timer),
        "topic_endpoint_info": endpoint_info.ENDPOINT_INFO,
        "type_hash": _named(endpoint_info.TypeHash),
        "type_support": _named(check_for_type_support, check_is_valid_msg_type, check_is_valid_srv_type),
        "utilities": _named(*middleware, remove_ros_args, timeout_sec_to_nsec),
        "wait_for_message": _named(wait_for_message),
        **names.NAMES,
    }


_OF_NODE: dict[str, tuple[str, ...]] = {
    "client": ("Client",),
    "clock": ("Clock", "ROSClock"),
    "constants": ("S_TO_NS",),
    "context": ("Context",),
    "event_handler": ("PublisherEventCallbacks", "SubscriptionEventCallbacks"),
    "exceptions": (
        *("InvalidParameterTypeException", "InvalidParameterValueException", "InvalidTopicNameException"),
        *("NotInitializedException", "ParameterAlreadyDeclaredException", "ParameterImmutableException"),
        *("ParameterNotDeclaredException", "ParameterUninitializedException"),
    ),
    "executors": ("Executor",),
    "expand_topic_name": ("expand_topic_name",),
    "guard_condition": ("GuardCondition",),
    "logging": ("get_logger",),
    "publisher": ("Publisher",),
    "qos": ("QoSProfile", "qos_profile_parameter_events", "qos_profile_services_default"),
    "qos_overriding_options": ("QoSOverridingOptions",),
    "service": ("Service",),
    "subscription": ("Subscription",),
    "timer": ("Rate", "Timer"),
    "topic_endpoint_info": ("TopicEndpointInfo",),
    "utilities": ("get_default_context",),
}
"""What ``rclpy.node`` imports from other modules, which files import from there."""
_MESSAGES_OF_NODE = (
    *("FloatingPointRange", "IntegerRange", "ListParametersResult", "ParameterDescriptor", "ParameterEvent"),
    *("ParameterType", "ParameterValue", "SetParametersResult"),
)


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
        **{context.__name__: partial(context, contexts) for context in of_contexts},
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


# -- helpers

_NO_C = "there is no library in C behind rclpy's classes here"
_NO_WAIT_SET = "there is no wait set of rcl; use a guard condition, a timer or a subscription"
REFUSED = {
    "rclpy.experimental": "use an executor of rclpy.executors",
    "rclpy.impl.implementation_singleton": _NO_C,
    "rclpy.lifecycle.LifecycleNodeMixin": "derive from LifecycleNode",
    "rclpy.lifecycle.NodeMixin": "derive from LifecycleNode",
    "rclpy.lifecycle.node.LifecycleNodeMixin": "derive from LifecycleNode",
    "rclpy.logging_service": "give the node enable_logger_service=True",
    "rclpy.parameter_service": "nodes serve their parameters themselves",
    "rclpy.time_source": "nodes have ROS time, which is the time of the run",
    "rclpy.type_description_service": "read the definition in the recording of the run",
    **dict.fromkeys(
        (
            *("rclpy.clock.ClockHandle", "rclpy.clock.TimeJumpDictionary", "rclpy.context.ContextHandle"),
            *("rclpy.destroyable", "rclpy.duration.DurationType", "rclpy.time.TimeHandle"),
            *("rclpy.executors.TimeoutObject", "rclpy.task.FutureState"),
            *("rclpy.signals.SignalHandlerGuardCondition", "rclpy.impl.rcutils_logger.CallerId"),
            *("rclpy.impl.rcutils_logger.LoggingFilter", "rclpy.impl.rcutils_logger.Once"),
            *("rclpy.impl.rcutils_logger.SkipFirst", "rclpy.impl.rcutils_logger.Throttle"),
            "rclpy.impl.rcutils_logger.get_filters_from_kwargs",
        ),
        _NO_C,
    ),
    **dict.fromkeys(
        ("rclpy.waitable", "rclpy.event_handler.EventHandler", "rclpy.event_handler.QoSEventHandler"),
        _NO_WAIT_SET,
    ),
}
"""What is refused, and what to do instead."""


class SignalHandlerOptions(IntEnum):
    """Signals that rclpy handles. In a run it handles none: the end of the run shuts contexts down."""

    NO = 0
    SIGINT = 1
    SIGTERM = 2
    ALL = 3


def install_signal_handlers(options: SignalHandlerOptions = SignalHandlerOptions.ALL) -> None:
    """Do nothing: the end of the run shuts contexts down."""


def uninstall_signal_handlers() -> None:
    """Do nothing: there are no signal handlers."""


def get_current_signal_handlers_options() -> SignalHandlerOptions:
    """Return that no signal is handled."""
    return SignalHandlerOptions.NO


class ServiceIntrospectionState(IntEnum):
    """What of a service's calls is published."""

    OFF = 0
    METADATA = 1
    CONTENTS = 2


def serialize_message(message: Any) -> bytes:
    """Return the bytes of a message in CDR."""
    return messages.to_cdr(message)


def deserialize_message(serialized_message: bytes, message_type: Any) -> Any:
    """Return the message in bytes of CDR."""
    kind = entities.type_name("deserialize_message", message_type)
    return adopt(messages.from_cdr(kind, bytes(serialized_message)), library_of(message_type))


def check_is_valid_msg_type(msg_type: Any) -> None:
    """Raise ``RuntimeError`` unless *msg_type* is a message class."""
    if not getattr(msg_type, "__msgtype__", ""):
        raise RuntimeError(f"The message type provided is not valid ({msg_type})")


def check_is_valid_srv_type(srv_type: Any) -> None:
    """Raise ``RuntimeError`` unless *srv_type* is a service class."""
    if not hasattr(srv_type, "Request"):
        raise RuntimeError(f"The service type provided is not valid ({srv_type})")


def check_for_type_support(msg_or_srv_type: Any) -> None:
    """Raise an exception unless the argument is a class of messages, services or actions."""
    if not any(hasattr(msg_or_srv_type, name) for name in ("__msgtype__", "Request", "Goal")):
        raise NoTypeSupportImportedException(f"{msg_or_srv_type!r} is no class of messages or services")


def get_rmw_implementation_identifier() -> str:
    """Return the name of what carries messages."""
    return "volery"


def get_available_rmw_implementations() -> set[str]:
    """Return the names of what can carry messages."""
    return {get_rmw_implementation_identifier()}


def remove_ros_args(args: Sequence[str] | None = None) -> list[str]:
    """Return the arguments of a program without those of ROS.

    A section of them is from ``--ros-args`` to ``--`` or the end; old remappings stand alone.
    """
    kept, inside = [], False
    for arg in args if args is not None else sys.argv:
        if inside:
            inside = arg != "--"
        elif arg == "--ros-args":
            inside = True
        elif ":=" not in arg:
            kept.append(arg)
    return kept


def timeout_sec_to_nsec(timeout_sec: float | None) -> int:
    """Return a time-out in ns; -1 for None and negative ones."""
    return -1 if timeout_sec is None or timeout_sec < 0 else int(float(timeout_sec) * S)


def wait_for_message(
    msg_type: Any, node: Node, topic: str, *, qos_profile: Any = 1, time_to_wait: Any = -1
) -> tuple[bool, Any]:
    """Block until a message of a topic has arrived; return (False, None) after *time_to_wait* s."""
    received: list[Any] = []
    arrived = Signal(node.context.kernel, f"wait_for_message of {topic}")

    def keep(message: Any) -> None:
        received.append(message)
        arrived.notify()

    at_once = node.graph_node.group(lambda work: work.run())
    name, kind = node.absolute_name(topic), entities.type_name("wait_for_message", msg_type)
    subscription = node.graph_node.subscribe(name, kind, keep, graph_qos(qos_profile, reads=True), at_once)
    try:
        longest = timeout_sec_to_nsec(time_to_wait)
        arrived.wait_for(lambda: received, None if longest < 0 else longest, ends_activation=True)
    finally:
        subscription.close()
    return (True, received[0]) if received else (False, None)


# -- spinning

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
