"""rclpy's ``Node``, the base class of users' nodes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from inspect import iscoroutinefunction
from typing import Any, ClassVar

from volery.base.time import MS, S, from_seconds
from volery.ros.client_libraries.library_base import Rosout
from volery.ros.client_libraries.rclpy.context import Context, Contexts, Logger, NodeNameNonExistentError
from volery.ros.client_libraries.rclpy.endpoint_info import TopicEndpointInfo, endpoint_infos
from volery.ros.client_libraries.rclpy.entities import (
    Client,
    GuardCondition,
    Publisher,
    Service,
    Subscription,
    Timer,
    timer_period,
)
from volery.ros.client_libraries.rclpy.events import PublisherEventCallbacks, SubscriptionEventCallbacks
from volery.ros.client_libraries.rclpy.executors import (
    CallbackGroup,
    CallbackQueue,
    Executor,
    MutuallyExclusiveCallbackGroup,
    Task,
)
from volery.ros.client_libraries.rclpy.names import (
    substituted,
    validate_namespace,
    validate_node_name,
    validate_topic_name,
)
from volery.ros.client_libraries.rclpy.node_parameters import (
    DeclaredParameters,
    NodeParameters,
    Parameter,
    serve_parameters,
)
from volery.ros.client_libraries.rclpy.qos import QoSProfile, profile_of
from volery.ros.client_libraries.rclpy.qos_overrides import QoSOverridingOptions, overridden
from volery.ros.client_libraries.rclpy.ros_time import Clock, ClockType, Rate
from volery.ros.graph import RELIABLE, TRANSIENT_LOCAL, EmbeddedGraph, QoS, RosGraph, Work
from volery.ros.messages import message_class, new
from volery.ros.messages.client_classes import service_of

_PARAMETER_EVENTS = "/parameter_events"
_ROSOUT = QoS(1000, RELIABLE, TRANSIENT_LOCAL)
_SERVICES = ("enable_rosout", "start_parameter_services", "enable_logger_service", "use_global_arguments")


class Node(NodeParameters):
    """A node. A ``node_name`` of the model, as a launch file's ``name``, names the component's first."""

    contexts: ClassVar[Contexts]
    loggers: ClassVar[type[Logger]]
    clocks: ClassVar[type[Clock]]
    PARAM_REL_TOL = 1e-6
    """Relative distance within which a double counts as equal to a bound or a step."""

    def __init__(
        self,
        node_name: str,
        *,
        context: Context | None = None,
        cli_args: Sequence[str] | None = None,
        namespace: str | None = None,
        parameter_overrides: Sequence[Parameter] | None = None,
        allow_undeclared_parameters: bool = False,
        automatically_declare_parameters_from_overrides: bool = False,
        **services: Any,
    ) -> None:
        for name in services:
            if name not in _SERVICES:
                raise TypeError(f"Node() has no argument {name!r}")
        self._context = context or self.contexts.current()
        validate_node_name(node_name)
        if namespace:
            validate_namespace(namespace if namespace.startswith("/") else f"/{namespace}")
        self.graph_node = self._context.create_graph_node(node_name, namespace)
        self.queues: list[CallbackQueue] = []
        self._executor: Executor | None = None
        self._default_group = MutuallyExclusiveCallbackGroup()
        self._entities: list[Any] = []
        rosout = Rosout(self.contexts.graph, self.graph_node, "rcl_interfaces/msg/Log", _ROSOUT)
        used_rosout = rosout if services.get("enable_rosout", True) else None
        self._logger = self.loggers(self.graph_node.name.strip("/").replace("/", "."), used_rosout)
        self._clock = self.clocks(clock_type=ClockType.ROS_TIME)
        self._declared = DeclaredParameters(
            self.graph_node, parameter_overrides or (), allow_undeclared_parameters, self._publish_event
        )
        self._events: Publisher | None = None
        self._declared.declare_builtin("use_sim_time", False)
        if automatically_declare_parameters_from_overrides:
            self._declared.declare_overrides(self._context.launched(self.graph_node))
        if services.get("start_parameter_services", True) and isinstance(self.contexts.graph, EmbeddedGraph):
            serve_parameters(self, self.create_service)  # on real ROS the node of the transport serves them

        if services.get("enable_logger_service"):
            for name, kind, handler in (
                ("get_logger_levels", "GetLoggerLevels", self._get_logger_levels),
                ("set_logger_levels", "SetLoggerLevels", self._set_logger_levels),
            ):
                self.create_service(service_of(f"rcl_interfaces/srv/{kind}"), f"~/{name}", handler)

    def _get_logger_levels(self, request: Any, response: Any) -> Any:
        for name in request.names:
            level = self.contexts.levels.get(name, 0)
            response.levels.append(new("rcl_interfaces/msg/LoggerLevel", name=name, level=level))
        return response

    def _set_logger_levels(self, request: Any, response: Any) -> Any:
        for level in request.levels:
            self.contexts.levels[level.name] = level.level
            response.results.append(new("rcl_interfaces/msg/SetLoggerLevelsResult", successful=True))
        return response

    # -- identity

    @property
    def context(self) -> Context:
        """Context of the node."""
        return self._context

    @property
    def graph(self) -> RosGraph:
        """Graph of the node."""
        return self.contexts.graph

    @property
    def default_callback_group(self) -> CallbackGroup:
        """Callback group of entities that are created without one."""
        return self._default_group

    def get_name(self) -> str:
        """Return the name without the namespace."""
        return self.graph_node.name.rpartition("/")[2]

    def get_namespace(self) -> str:
        """Return the namespace."""
        return self.graph_node.namespace

    def get_fully_qualified_name(self) -> str:
        """Return namespace and name."""
        return self.graph_node.name

    def get_logger(self) -> Logger:
        """Return the logger of the node."""
        return self._logger

    def get_clock(self) -> Clock:
        """Return the clock of the node, which shows ROS time."""
        return self._clock

    # -- executor

    @property
    def executor(self) -> Executor | None:
        """Executor that spins the node."""
        return self._executor

    @executor.setter
    def executor(self, executor: Executor) -> None:
        self.attach_executor(executor)

    def attach_executor(self, executor: Executor) -> None:
        """Let *executor* spin the node from now on, instead of the previous one."""
        previous, self._executor = self._executor, executor
        if previous is not None and previous is not executor:
            previous.remove_node(self)
        executor.add_node(self)
        executor.wake()

    def detach_executor(self, executor: Executor) -> None:
        """Stop using *executor*, if it spins the node."""
        if self._executor is executor:
            self._executor = None

    def _wake_executor(self) -> None:
        if self._executor is not None:
            self._executor.wake()

    def _queue(self, group: CallbackGroup | None) -> CallbackQueue:
        wanted = group or self._default_group
        for queue in self.queues:
            if queue.group is wanted:
                return queue
        ready = self.graph_node.group()
        ready.on_ready = self._wake_executor
        made = CallbackQueue(wanted, ready)
        self.queues.append(made)
        return made

    def execute(self, callback: Callable[..., Any], *args: Any) -> Task | None:
        """Run a callback; return the task of a coroutine function, which the executor continues."""
        if self._executor is not None and iscoroutinefunction(callback):
            task = Task(callback, args, self._executor)
            task()
            return task
        callback(*args)
        return None

    def absolute_name(self, name: str, *, is_service: bool = False) -> str:
        """Return a checked name with its substitutions made, for the graph."""
        validate_topic_name(name, is_service=is_service)
        return substituted(name, self.get_name(), self.get_namespace()) if "{" in name else name

    # -- entities

    def _keep(self, made: Any) -> Any:
        self._entities.append(made)
        return made

    def create_publisher(
        self,
        msg_type: Any,
        topic: str,
        qos_profile: Any,
        *,
        callback_group: CallbackGroup | None = None,
        event_callbacks: PublisherEventCallbacks | None = None,
        qos_overriding_options: QoSOverridingOptions | None = None,
        publisher_class: type[Publisher] = Publisher,
    ) -> Any:
        """Create a publisher; *qos_profile* is a profile or a depth."""
        used = self._overridden(qos_profile, topic, "publisher", qos_overriding_options)
        events = (event_callbacks, self._queue(callback_group)) if event_callbacks is not None else None
        return self._keep(publisher_class(self, msg_type, topic, used, events))

    def _overridden(
        self, given: Any, topic: str, entity: str, options: QoSOverridingOptions | None
    ) -> QoSProfile:
        profile = profile_of(given)
        if options is None:
            return profile
        resolved = self.resolve_topic_name(topic)
        return overridden(profile, options, f"qos_overrides.{resolved}.{entity}", self)

    def create_subscription(
        self,
        msg_type: Any,
        topic: str,
        callback: Callable[..., Any],
        qos_profile: Any,
        *,
        callback_group: CallbackGroup | None = None,
        event_callbacks: SubscriptionEventCallbacks | None = None,
        qos_overriding_options: QoSOverridingOptions | None = None,
        raw: bool = False,
    ) -> Subscription:
        """Call *callback* with each message of a topic; *raw* gives its bytes in CDR."""
        used = self._overridden(qos_profile, topic, "subscription", qos_overriding_options)
        made: Subscription = self._keep(
            Subscription(
                self,
                msg_type,
                topic,
                callback,
                qos=used,
                queue=self._queue(callback_group),
                events=event_callbacks,
                raw=raw,
            )
        )
        return made

    def create_guard_condition(
        self, callback: Callable[[], Any], callback_group: CallbackGroup | None = None
    ) -> GuardCondition:
        """Create a condition whose ``trigger`` lets the executor call back."""
        made: GuardCondition = self._keep(GuardCondition(self, callback, self._queue(callback_group)))
        return made

    def create_service(
        self,
        srv_type: Any,
        srv_name: str,
        callback: Callable[[Any, Any], Any],
        *,
        callback_group: CallbackGroup | None = None,
        **options: Any,
    ) -> Service:
        """Handle the requests of a service with *callback*."""
        made: Service = self._keep(Service(self, srv_type, srv_name, callback, self._queue(callback_group)))
        return made

    def create_waiting_service(
        self, srv_type: Any, srv_name: str, callback: Callable[[Any, Any], Any]
    ) -> Service:
        """Create a service whose callback may block: each request runs in a task beside the executor.

        rclpy has no such function; action servers need it.
        """

        def start(work: Work) -> None:
            self._context.spawn(work.run, srv_name)

        queue = CallbackQueue(CallbackGroup(), self.graph_node.group(start))
        made: Service = self._keep(Service(self, srv_type, srv_name, callback, queue))
        return made

    def create_client(
        self, srv_type: Any, srv_name: str, *, callback_group: CallbackGroup | None = None, **options: Any
    ) -> Client:
        """Create a client of a service."""
        made: Client = self._keep(Client(self, srv_type, srv_name, self._queue(callback_group)))
        return made

    def create_timer(
        self,
        timer_period_sec: float,
        callback: Callable[..., Any] | None,
        callback_group: CallbackGroup | None = None,
        clock: Clock | None = None,
        autostart: bool = True,
    ) -> Timer:
        """Call *callback* each period."""
        queue, period = self._queue(callback_group), timer_period(timer_period_sec)
        made: Timer = self._keep(
            Timer(self, period, callback, queue, clock or self._clock, autostart=autostart)
        )
        return made

    def add_waitable(self, waitable: object) -> None:
        """Refuse: the wait set of rcl is not there."""
        raise NotImplementedError(
            "Node.add_waitable is not there on the embedded graph: it has no wait set of rcl; use a "
            "guard condition, a timer or a subscription"
        )

    remove_waitable = add_waitable

    def create_rate(self, frequency: float, clock: Clock | None = None) -> Rate:
        """Create a rate of *frequency* Hz."""
        if frequency <= 0:
            raise ValueError("frequency must be > 0")
        return Rate(self._context, round(S / frequency))

    def _destroy(self, made: Any) -> bool:
        if made not in self._entities:
            return False
        self._entities.remove(made)
        made.destroy()
        return True

    def destroy_publisher(self, publisher: Publisher) -> bool:
        """Destroy a publisher; return False if it is not this node's."""
        return self._destroy(publisher)

    def destroy_subscription(self, subscription: Subscription) -> bool:
        """Destroy a subscription; return False if it is not this node's."""
        return self._destroy(subscription)

    def destroy_service(self, service: Service) -> bool:
        """Destroy a service; return False if it is not this node's."""
        return self._destroy(service)

    def destroy_client(self, client: Client) -> bool:
        """Destroy a client; return False if it is not this node's."""
        return self._destroy(client)

    def destroy_timer(self, timer: Timer) -> bool:
        """Destroy a timer; return False if it is not this node's."""
        return self._destroy(timer)

    def destroy_guard_condition(self, guard: GuardCondition) -> bool:
        """Destroy a guard condition; return False if it is not this node's."""
        return self._destroy(guard)

    def destroy_rate(self, rate: Rate) -> bool:
        """Do nothing: a rate holds no resources."""
        return True

    def destroy_node(self) -> None:
        """Destroy all entities of the node and leave the graph."""
        for entity in tuple(self._entities):
            self._destroy(entity)
        if self._executor is not None:
            self._executor.remove_node(self)
        self._context.close_graph_node(self.graph_node)

    def _entities_of(self, kind: type) -> list[Any]:
        return [entity for entity in self._entities if isinstance(entity, kind)]

    @property
    def publishers(self) -> list[Publisher]:
        """All publishers of the node."""
        return self._entities_of(Publisher)

    @property
    def subscriptions(self) -> list[Subscription]:
        """All subscriptions of the node."""
        return self._entities_of(Subscription)

    @property
    def clients(self) -> list[Client]:
        """All clients of the node."""
        return self._entities_of(Client)

    @property
    def services(self) -> list[Service]:
        """All services of the node."""
        return self._entities_of(Service)

    @property
    def timers(self) -> list[Timer]:
        """All timers of the node."""
        return self._entities_of(Timer)

    @property
    def guards(self) -> list[GuardCondition]:
        """All guard conditions of the node."""
        return self._entities_of(GuardCondition)

    @property
    def waitables(self) -> list[Any]:
        """Nothing: there are no waitables."""
        return []

    # -- parameter events

    def _publish_event(self, changed: list[Parameter], new_names: set[str], deleted: list[Parameter]) -> None:
        """Publish what has changed on ``/parameter_events``, if a node subscribes to it."""
        graph = self.contexts.graph
        if not isinstance(graph, EmbeddedGraph) or not graph.has_subscribers(_PARAMETER_EVENTS):
            return
        kind: Any = message_class("rcl_interfaces/msg/ParameterEvent")
        if self._events is None:
            self._events = self.create_publisher(kind, _PARAMETER_EVENTS, 1000)
        event = kind(node=self.get_fully_qualified_name(), stamp=self._clock.now().to_msg())
        for one in changed:
            into = event.new_parameters if one.name in new_names else event.changed_parameters
            into.append(one.to_parameter_msg())
        event.deleted_parameters = [one.to_parameter_msg() for one in deleted]
        self._events.publish(event)

    # -- the graph

    def resolve_topic_name(self, topic: str, *, only_expand: bool = False) -> str:
        """Return the absolute name of a topic."""
        return self.graph_node.resolve(self.absolute_name(topic))

    def resolve_service_name(self, service: str, *, only_expand: bool = False) -> str:
        """Return the absolute name of a service."""
        return self.graph_node.resolve(self.absolute_name(service, is_service=True))

    def get_topic_names_and_types(self, no_demangle: bool = False) -> list[tuple[str, list[str]]]:
        """Return all topics with a publisher or a subscription."""
        with self._context.kernel.interact():
            return [(topic.name, [topic.type]) for topic in self.contexts.graph.topics()]

    def get_service_names_and_types(self) -> list[tuple[str, list[str]]]:
        """Return all services that have a server."""
        with self._context.kernel.interact():
            return [(service.name, [service.type]) for service in self.contexts.graph.services()]

    def _named(self, node_name: str, node_namespace: str) -> str:
        full = f"{node_namespace.rstrip('/')}/{node_name}"
        if full not in self.contexts.graph.node_names():
            raise NodeNameNonExistentError(f"cannot get names and types for nonexistent node: {full}")
        return full

    def get_publisher_names_and_types_by_node(
        self, node_name: str, node_namespace: str, no_demangle: bool = False
    ) -> list[tuple[str, list[str]]]:
        """Return the topics that a node publishes."""
        with self._context.kernel.interact():
            full = self._named(node_name, node_namespace)
            found = self.contexts.graph.topics()
            return [(one.name, [one.type]) for one in found if full in one.publishers]

    def get_subscriber_names_and_types_by_node(
        self, node_name: str, node_namespace: str, no_demangle: bool = False
    ) -> list[tuple[str, list[str]]]:
        """Return the topics that a node subscribes to."""
        with self._context.kernel.interact():
            full = self._named(node_name, node_namespace)
            found = self.contexts.graph.topics()
            return [(one.name, [one.type]) for one in found if full in one.subscribers]

    def get_service_names_and_types_by_node(
        self, node_name: str, node_namespace: str
    ) -> list[tuple[str, list[str]]]:
        """Return the services that a node serves."""
        with self._context.kernel.interact():
            full = self._named(node_name, node_namespace)
            return [
                (service.name, [service.type])
                for service in self.contexts.graph.services()
                if service.server == full
            ]

    def get_client_names_and_types_by_node(self, node_name: str, node_namespace: str) -> Any:
        """Refuse: the embedded graph does not keep clients."""
        raise NotImplementedError(
            "Node.get_client_names_and_types_by_node is not there on the embedded graph, which does not keep "
            "clients; use get_service_names_and_types_by_node of their servers"
        )

    def get_node_names(self) -> list[str]:
        """Return the names of all nodes without their namespaces."""
        return [name for name, _ in self.get_node_names_and_namespaces()]

    def get_fully_qualified_node_names(self) -> list[str]:
        """Return the names of all nodes."""
        with self._context.kernel.interact():
            return self.contexts.graph.node_names()

    def get_node_names_and_namespaces(self) -> list[tuple[str, str]]:
        """Return the names of all nodes and their namespaces."""
        parts = (full.rpartition("/") for full in self.get_fully_qualified_node_names())
        return [(name, above or "/") for above, _, name in parts]

    def get_node_names_and_namespaces_with_enclaves(self) -> list[tuple[str, str, str]]:
        """Return the names of all nodes, their namespaces and enclaves."""
        return [(name, above, "/") for name, above in self.get_node_names_and_namespaces()]

    def get_publishers_info_by_topic(
        self, topic_name: str, no_mangle: bool = False
    ) -> list[TopicEndpointInfo]:
        """Return node and quality of service of each publisher of a topic."""
        with self._context.kernel.interact():
            return endpoint_infos(self.contexts.graph, self.resolve_topic_name(topic_name), publishers=True)

    def get_subscriptions_info_by_topic(
        self, topic_name: str, no_mangle: bool = False
    ) -> list[TopicEndpointInfo]:
        """Return node and quality of service of each subscription to a topic."""
        with self._context.kernel.interact():
            return endpoint_infos(self.contexts.graph, self.resolve_topic_name(topic_name), publishers=False)

    def count_publishers(self, topic_name: str) -> int:
        """Return the number of publishers of a topic."""
        return self._count(topic_name, "publishers")

    def count_subscribers(self, topic_name: str) -> int:
        """Return the number of subscriptions to a topic."""
        return self._count(topic_name, "subscribers")

    def count_services(self, service_name: str) -> int:
        """Return the number of servers of a service."""
        full = self.resolve_service_name(service_name)
        with self._context.kernel.interact():
            return sum(1 for service in self.contexts.graph.services() if service.name == full)

    def count_clients(self, service_name: str) -> int:
        """Refuse: the embedded graph does not keep clients."""
        raise NotImplementedError(
            "Node.count_clients is not there on the embedded graph, which does not keep clients"
        )

    def _count(self, topic_name: str, side: str) -> int:
        full = self.resolve_topic_name(topic_name)
        with self._context.kernel.interact():
            return sum(
                len(getattr(topic, side)) for topic in self.contexts.graph.topics() if topic.name == full
            )

    def wait_for_node(self, fully_qualified_node_name: str, timeout: float) -> bool:
        """Block until there is a node of this name; return False after *timeout* s."""
        graph = self.contexts.graph
        until = self._context.kernel.now() + from_seconds(timeout)
        while fully_qualified_node_name not in self.get_fully_qualified_node_names():
            left = until - self._context.kernel.now()
            if left <= 0:
                return False
            if isinstance(graph, EmbeddedGraph):
                graph.changed.wait_for(lambda: fully_qualified_node_name in graph.node_names(), left)
            else:
                self._context.sleep(min(left, 100 * MS))
        return True

    def __enter__(self) -> Node:
        return self

    def __exit__(self, *_: object) -> None:
        self.destroy_node()
