"""rclpy's ``Node``, which users' classes derive from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from inspect import iscoroutinefunction
from typing import Any, ClassVar

from volery.base.time import S
from volery.ros.client_libraries.library_base import Rosout
from volery.ros.client_libraries.rclpy.context import Context, Contexts
from volery.ros.client_libraries.rclpy.entities import (
    Client,
    Publisher,
    Service,
    Subscription,
    Timer,
    period_of,
)
from volery.ros.client_libraries.rclpy.executors import (
    CallbackGroup,
    Executor,
    MutuallyExclusiveCallbackGroup,
    Queue,
    Task,
)
from volery.ros.client_libraries.rclpy.logging import Logger
from volery.ros.client_libraries.rclpy.parameters import (
    DeclaredParameters,
    NodeParameters,
    Parameter,
    serve_parameters,
)
from volery.ros.client_libraries.rclpy.time import Clock, ClockType, Rate
from volery.ros.graph import RELIABLE, TRANSIENT_LOCAL, EmbeddedGraph, QoS
from volery.ros.graph.callbacks import Work

_ROSOUT = QoS(1000, RELIABLE, TRANSIENT_LOCAL)
_SERVICES = ("enable_rosout", "start_parameter_services", "enable_logger_service", "use_global_arguments")


class Node(NodeParameters):
    """A node. As a launch file does, the component's name names its first node."""

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
        self._context = context or self.contexts.here()
        self.graph_node = self._context.join(node_name, namespace)
        self.queues: list[Queue] = []
        self._executor: Executor | None = None
        self._default_group = MutuallyExclusiveCallbackGroup()
        self._made: list[Any] = []
        rosout = Rosout(self.contexts.graph, self.graph_node, "rcl_interfaces/msg/Log", _ROSOUT)
        told = rosout if services.get("enable_rosout", True) else None
        self._logger = self.loggers(self.graph_node.name.strip("/").replace("/", "."), told)
        self._clock = self.clocks(clock_type=ClockType.ROS_TIME)
        self._declared = DeclaredParameters(
            self.graph_node, parameter_overrides or (), allow_undeclared_parameters
        )
        if automatically_declare_parameters_from_overrides:
            for override in parameter_overrides or ():
                self._declared.declare(override.name, override.value)
        if services.get("start_parameter_services", True) and isinstance(self.contexts.graph, EmbeddedGraph):
            serve_parameters(self)  # elsewhere the transport's own node does

    # -- who it is

    @property
    def context(self) -> Context:
        """The context that it belongs to."""
        return self._context

    @property
    def default_callback_group(self) -> CallbackGroup:
        """For what is made without one."""
        return self._default_group

    def get_name(self) -> str:
        """Its name without the namespace."""
        return self.graph_node.name.rpartition("/")[2]

    def get_namespace(self) -> str:
        """Its namespace."""
        return self.graph_node.namespace

    def get_fully_qualified_name(self) -> str:
        """Namespace and name."""
        return self.graph_node.name

    def get_logger(self) -> Logger:
        """Its logger."""
        return self._logger

    def get_clock(self) -> Clock:
        """Its clock: ROS time."""
        return self._clock

    # -- who spins it

    @property
    def executor(self) -> Executor | None:
        """Who spins it."""
        return self._executor

    @executor.setter
    def executor(self, executor: Executor) -> None:
        previous, self._executor = self._executor, executor
        if previous is not None and previous is not executor:
            previous.remove_node(self)
        executor.add_node(self)
        executor.wake()

    def drop_executor(self, executor: Executor) -> None:
        """*executor* spins it no longer."""
        if self._executor is executor:
            self._executor = None

    def _filled(self) -> None:
        if self._executor is not None:
            self._executor.wake()

    def _queue(self, group: CallbackGroup | None) -> Queue:
        wanted = group or self._default_group
        for queue in self.queues:
            if queue.group is wanted:
                return queue
        ready = self.graph_node.group()
        ready.on_ready = self._filled
        made = Queue(wanted, ready)
        self.queues.append(made)
        return made

    def execute(self, callback: Callable[..., Any], *args: Any) -> None:
        """Run a callback; a coroutine is carried on by the executor."""
        if self._executor is not None and iscoroutinefunction(callback):
            Task(callback, args, self._executor)()
        else:
            callback(*args)

    # -- what it makes

    def _keep(self, made: Any) -> Any:
        self._made.append(made)
        return made

    def create_publisher(self, msg_type: Any, topic: str, qos_profile: Any, **options: Any) -> Publisher:
        """Publish to a topic; *qos_profile* is a profile or a depth."""
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
        """Call back with each message of a topic."""
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
        """Answer requests."""
        made: Service = self._keep(Service(self, srv_type, srv_name, callback, self._queue(callback_group)))
        return made

    def create_waiting_service(
        self, srv_type: Any, srv_name: str, callback: Callable[[Any, Any], Any]
    ) -> Service:
        """A service whose callback may wait: each request has a task of its own, beside the executor.

        rclpy has none; its action servers need one.
        """

        def start(work: Work) -> None:
            self._context.spawn(work.run, srv_name)

        queue = Queue(CallbackGroup(), self.graph_node.group(start))
        made: Service = self._keep(Service(self, srv_type, srv_name, callback, queue))
        return made

    def create_client(
        self, srv_type: Any, srv_name: str, *, callback_group: CallbackGroup | None = None, **options: Any
    ) -> Client:
        """Call a service."""
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
        """Call back each period."""
        queue = self._queue(callback_group)
        made: Timer = self._keep(
            Timer(self, period_of(timer_period_sec), callback, queue, autostart=autostart)
        )
        return made

    def create_rate(self, frequency: float, clock: Clock | None = None) -> Rate:
        """Keep a loop at *frequency* in Hz."""
        if frequency <= 0:
            raise ValueError("frequency must be > 0")
        return Rate(self._context, round(S / frequency))

    def _destroy(self, made: Any) -> bool:
        if made not in self._made:
            return False
        self._made.remove(made)
        made.destroy()
        return True

    def destroy_publisher(self, publisher: Publisher) -> bool:
        """Take it away; False if it is not this node's."""
        return self._destroy(publisher)

    def destroy_subscription(self, subscription: Subscription) -> bool:
        """Take it away; False if it is not this node's."""
        return self._destroy(subscription)

    def destroy_service(self, service: Service) -> bool:
        """Take it away; False if it is not this node's."""
        return self._destroy(service)

    def destroy_client(self, client: Client) -> bool:
        """Take it away; False if it is not this node's."""
        return self._destroy(client)

    def destroy_timer(self, timer: Timer) -> bool:
        """Take it away; False if it is not this node's."""
        return self._destroy(timer)

    def destroy_rate(self, rate: Rate) -> bool:
        """Nothing to let go of."""
        return True

    def destroy_node(self) -> None:
        """Leave the graph, and with it all that this node has made."""
        for made in tuple(self._made):
            self._destroy(made)
        if self._executor is not None:
            self._executor.remove_node(self)
        self._context.leave(self.graph_node)

    def _of(self, kind: type) -> list[Any]:
        return [made for made in self._made if isinstance(made, kind)]

    @property
    def publishers(self) -> list[Publisher]:
        """All of them."""
        return self._of(Publisher)

    @property
    def subscriptions(self) -> list[Subscription]:
        """All of them."""
        return self._of(Subscription)

    @property
    def clients(self) -> list[Client]:
        """All of them."""
        return self._of(Client)

    @property
    def services(self) -> list[Service]:
        """All of them."""
        return self._of(Service)

    @property
    def timers(self) -> list[Timer]:
        """All of them."""
        return self._of(Timer)

    # -- the graph

    def resolve_topic_name(self, topic: str, *, only_expand: bool = False) -> str:
        """The absolute name."""
        return self.graph_node.resolve(topic)

    resolve_service_name = resolve_topic_name

    def get_topic_names_and_types(self, no_demangle: bool = False) -> list[tuple[str, list[str]]]:
        """The topics that somebody publishes or listens to."""
        with self._context.kernel:
            return [(one.name, [one.type]) for one in self.contexts.graph.topics()]

    def get_service_names_and_types(self) -> list[tuple[str, list[str]]]:
        """The services that somebody serves."""
        with self._context.kernel:
            return [(one.name, [one.type]) for one in self.contexts.graph.services()]

    def get_node_names(self) -> list[str]:
        """The nodes' names without their namespaces."""
        with self._context.kernel:
            return [name.rpartition("/")[2] for name in self.contexts.graph.node_names()]

    def count_publishers(self, topic_name: str) -> int:
        """How many publish it."""
        return self._count(topic_name, "publishers")

    def count_subscribers(self, topic_name: str) -> int:
        """How many listen to it."""
        return self._count(topic_name, "subscribers")

    def _count(self, topic_name: str, side: str) -> int:
        full = self.graph_node.resolve(topic_name)
        with self._context.kernel:
            return sum(len(getattr(one, side)) for one in self.contexts.graph.topics() if one.name == full)

    def __enter__(self) -> Node:
        return self

    def __exit__(self, *_: object) -> None:
        self.destroy_node()
