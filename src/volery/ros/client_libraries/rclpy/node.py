"""rclpy's ``Node``, the base class of users' nodes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from inspect import iscoroutinefunction
from typing import Any, ClassVar

from volery.base.time import S
from volery.ros.client_libraries.library_base import Rosout
from volery.ros.client_libraries.rclpy.context import Context, Contexts, Logger
from volery.ros.client_libraries.rclpy.entities import (
    Client,
    Publisher,
    Service,
    Subscription,
    Timer,
    timer_period,
)
from volery.ros.client_libraries.rclpy.executors import (
    CallbackGroup,
    CallbackQueue,
    Executor,
    MutuallyExclusiveCallbackGroup,
    Task,
)
from volery.ros.client_libraries.rclpy.node_parameters import (
    DeclaredParameters,
    NodeParameters,
    Parameter,
    serve_parameters,
)
from volery.ros.client_libraries.rclpy.ros_time import Clock, ClockType, Rate
from volery.ros.graph import RELIABLE, TRANSIENT_LOCAL, EmbeddedGraph, QoS, Work

_ROSOUT = QoS(1000, RELIABLE, TRANSIENT_LOCAL)
_SERVICES = ("enable_rosout", "start_parameter_services", "enable_logger_service", "use_global_arguments")


class Node(NodeParameters):
    """A node. As in a launch file, the name of the component names its first node."""

    contexts: ClassVar[Contexts]
    loggers: ClassVar[type[Logger]]
    clocks: ClassVar[type[Clock]]

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
            self.graph_node, parameter_overrides or (), allow_undeclared_parameters
        )
        if automatically_declare_parameters_from_overrides:
            for override in parameter_overrides or ():
                self._declared.declare(override.name, override.value)
        if services.get("start_parameter_services", True) and isinstance(self.contexts.graph, EmbeddedGraph):
            serve_parameters(self, self.create_service)  # on real ROS the node of the transport serves them

    # -- identity

    @property
    def context(self) -> Context:
        """Context of the node."""
        return self._context

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

    def execute(self, callback: Callable[..., Any], *args: Any) -> None:
        """Run a callback; a coroutine is continued by the executor."""
        if self._executor is not None and iscoroutinefunction(callback):
            Task(callback, args, self._executor)()
        else:
            callback(*args)

    # -- entities

    def _keep(self, made: Any) -> Any:
        self._entities.append(made)
        return made

    def create_publisher(self, msg_type: Any, topic: str, qos_profile: Any, **options: Any) -> Publisher:
        """Create a publisher; *qos_profile* is a profile or a depth."""
        made: Publisher = self._keep(Publisher(self, msg_type, topic, qos_profile))
        return made

    def create_subscription(
        self,
        msg_type: Any,
        topic: str,
        callback: Callable[[Any], Any],
        qos_profile: Any,
        *,
        callback_group: CallbackGroup | None = None,
        raw: bool = False,
        **options: Any,
    ) -> Subscription:
        """Call *callback* with each message of a topic."""
        if raw:
            raise NotImplementedError("create_subscription(raw=True) is not there on the embedded graph")
        queue = self._queue(callback_group)
        made: Subscription = self._keep(
            Subscription(self, msg_type, topic, callback, qos=qos_profile, queue=queue)
        )
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
        callback: Callable[..., Any],
        callback_group: CallbackGroup | None = None,
        clock: Clock | None = None,
        *,
        autostart: bool = True,
    ) -> Timer:
        """Call *callback* each period."""
        queue = self._queue(callback_group)
        made: Timer = self._keep(
            Timer(self, timer_period(timer_period_sec), callback, queue, autostart=autostart)
        )
        return made

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

    def destroy_rate(self, rate: Rate) -> bool:
        """Do nothing: a rate holds no resources."""
        return True

    def destroy_node(self) -> None:
        """Destroy all entities of the node and leave the graph."""
        for made in tuple(self._entities):
            self._destroy(made)
        if self._executor is not None:
            self._executor.remove_node(self)
        self._context.close_graph_node(self.graph_node)

    def _entities_of(self, kind: type) -> list[Any]:
        return [made for made in self._entities if isinstance(made, kind)]

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

    # -- the graph

    def resolve_topic_name(self, topic: str, *, only_expand: bool = False) -> str:
        """Return the absolute name of a topic."""
        return self.graph_node.resolve(topic)

    resolve_service_name = resolve_topic_name

    def get_topic_names_and_types(self, no_demangle: bool = False) -> list[tuple[str, list[str]]]:
        """Return all topics with a publisher or a subscription."""
        with self._context.kernel:
            return [(one.name, [one.type]) for one in self.contexts.graph.topics()]

    def get_service_names_and_types(self) -> list[tuple[str, list[str]]]:
        """Return all services that have a server."""
        with self._context.kernel:
            return [(one.name, [one.type]) for one in self.contexts.graph.services()]

    def get_node_names(self) -> list[str]:
        """Return the names of all nodes without their namespaces."""
        with self._context.kernel:
            return [name.rpartition("/")[2] for name in self.contexts.graph.node_names()]

    def count_publishers(self, topic_name: str) -> int:
        """Return the number of publishers of a topic."""
        return self._count(topic_name, "publishers")

    def count_subscribers(self, topic_name: str) -> int:
        """Return the number of subscriptions to a topic."""
        return self._count(topic_name, "subscribers")

    def _count(self, topic_name: str, side: str) -> int:
        full = self.graph_node.resolve(topic_name)
        with self._context.kernel:
            return sum(len(getattr(one, side)) for one in self.contexts.graph.topics() if one.name == full)

    def __enter__(self) -> Node:
        return self

    def __exit__(self, *_: object) -> None:
        self.destroy_node()
