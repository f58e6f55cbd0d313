"""Handlers of the requests of rclcpp: nodes, topics, services, timers and executors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from volery.base.errors import UsageError
from volery.base.time import MS, Ns
from volery.kernel.waiting import Signal
from volery.ros.client_libraries.abi_codec import CppFiber, Reader, RequestHandler, Writer, pair
from volery.ros.client_libraries.cpp.requests import CdrPublisher, Simple, WithFiber, time_out
from volery.ros.client_libraries.cpp.requests import request_handlers as shared_handlers
from volery.ros.client_libraries.rclcpp.executor import Executor, ExecutorError
from volery.ros.client_libraries.rclcpp.parameters import (
    PARAMETERS,
    PARAMETERS_WITH_FIBER,
    PLAIN_PARAMETERS,
    create_parameters,
    read_parameters,
)
from volery.ros.client_libraries.rclcpp.session import RosNode, Session
from volery.ros.client_libraries.rclpy.context import EXCEPTIONS
from volery.ros.client_libraries.rclpy.events import (
    PublisherEventCallbacks,
    SubscriptionEventCallbacks,
    watch,
)
from volery.ros.client_libraries.rclpy.names import NAME_EXCEPTIONS
from volery.ros.client_libraries.rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    LivelinessPolicy,
    QoSProfile,
    ReliabilityPolicy,
    graph_qos,
)
from volery.ros.client_libraries.rclpy.ros_time import Duration
from volery.ros.graph import Client, EmbeddedGraph, QoS, ReadyCallbacks, Service, ServiceError, Timer, Work
from volery.ros.messages import from_cdr, service, to_cdr

SHORTEST_PERIOD: Ns = MS
"""Period of a timer of 0 s, which rclcpp calls as often as its executor comes round."""

# -- nodes


def _node(session: Session, arguments: Reader) -> RosNode:
    return session.find(arguments.integer(), RosNode)


def _create_node(session: Session, arguments: Reader) -> bytes:
    name, namespace, launched = arguments.text(), arguments.text(), arguments.flag()
    undeclared, automatic, served = arguments.flag(), arguments.flag(), arguments.flag()
    own = [arguments.text() for _ in range(arguments.integer())]
    overrides = read_parameters(arguments)
    launch = session.launch if launched else session.launch._replace(parameters={}, remaps={}, node_name="")
    if own:
        launch = launch.given([*launch.arguments[:1], *own], ros=2)
    node = session.create_node(name, namespace, launch)
    queue = node.add_queue(exclusive=True)
    node.parameters = create_parameters(session, node, overrides, undeclared, served)
    if automatic:
        node.parameters.declare_overrides(session.launched(node))
    reply = Writer().integer(session.keep(node)).text(node.node.name.rpartition("/")[2])
    return reply.text(node.node.namespace).integer(session.keep(queue)).done()


def _create_group(session: Session, arguments: Reader) -> int:
    node, exclusive, automatic = _node(session, arguments), arguments.flag(), arguments.flag()
    return session.keep(node.add_queue(exclusive=exclusive, automatic=automatic))


# -- topics


def _qos(arguments: Reader, *, reads: bool = False) -> QoS:
    history, depth, reliability, durability, liveliness = (arguments.integer() for _ in range(5))
    deadline, lifespan, lease = (Duration(nanoseconds=arguments.integer()) for _ in range(3))
    return graph_qos(
        QoSProfile(
            history=HistoryPolicy(history),
            depth=depth,
            reliability=ReliabilityPolicy(reliability),
            durability=DurabilityPolicy(durability),
            liveliness=LivelinessPolicy(liveliness),
            deadline=deadline,
            lifespan=lifespan,
            liveliness_lease_duration=lease,
        ),
        reads=reads,
    )


def _named(session: Session, entity: object, name: str) -> bytes:
    return Writer().integer(session.keep(entity)).text(name).done()


def _advertise(session: Session, arguments: Reader) -> bytes:
    node, topic, kind = _node(session, arguments), arguments.text(), arguments.text()
    made = node.node.advertise(node.absolute_name(topic), kind, _qos(arguments))
    return _named(session, CdrPublisher(made, kind), made.topic)


def _assert_liveliness(session: Session, arguments: Reader) -> bool:
    made: Any = session.find(arguments.integer(), CdrPublisher).made
    if isinstance(session.graph, EmbeddedGraph):
        kernel = session.kernel
        with kernel.interact():
            made.latest = kernel.now()
    return True


def _subscribe(session: Session, arguments: Reader) -> bytes:
    node, topic, kind = _node(session, arguments), arguments.text(), arguments.text()
    qos, callback = _qos(arguments, reads=True), arguments.integer()
    queue = session.queue(arguments.integer())
    received = 0

    def on_message(message: Any) -> None:
        nonlocal received
        received += 1
        stamp = session.graph.epoch + session.kernel.now()
        session.call_back(callback, pair(stamp, received) + to_cdr(message))

    made = node.node.subscribe(node.absolute_name(topic), kind, on_message, qos, queue.ready)
    return _named(session, made, made.topic)


class _EventCallback:
    """A callback of the code about the counterparts of a publisher or a subscription."""

    def __init__(self, session: Session, callback: int) -> None:
        self._session, self._callback = session, callback
        self._closed = False

    def __call__(self, info: Any) -> None:
        if not self._closed:
            fields = Writer()
            for name in _EVENT_FIELDS:
                fields.integer(int(getattr(info, name, 0)))
            self._session.call_back(self._callback, fields.done())

    def close(self) -> None:
        """Call no more."""
        self._closed = True


_EVENT_FIELDS = (
    *("total_count", "total_count_change", "alive_count", "not_alive_count", "alive_count_change"),
    *("not_alive_count_change", "current_count", "current_count_change", "last_policy_kind"),
)
"""In the order of ``rclcpp::EventInfo``."""


def _watch(session: Session, arguments: Reader) -> int:
    entity, kind, number = session.entity(arguments.integer()), arguments.text(), arguments.integer()
    callback = _EventCallback(session, number)
    callbacks: PublisherEventCallbacks | SubscriptionEventCallbacks = SubscriptionEventCallbacks()
    if isinstance(entity, CdrPublisher):
        entity, callbacks = entity.made, PublisherEventCallbacks()
    setattr(callbacks, kind, callback)
    watch(session, session.graph, entity, callbacks, session.queue(arguments.integer()).ready)
    return session.keep(callback)


def _wait_for_message(session: Session, arguments: Reader) -> bytes:
    node, topic, kind = _node(session, arguments), arguments.text(), arguments.text()
    within = time_out(arguments.integer())
    received: list[Any] = []
    group = node.node.group()
    subscription = node.node.subscribe(node.absolute_name(topic), kind, received.append, group=group)
    try:
        group.spin_once(within)
    finally:
        subscription.close()
    reply = Writer().flag(bool(received)).done()
    return reply + to_cdr(received[0]) if received else reply


# -- services


class _Server:
    """A service whose handler is code. A deferred one is answered by a request of the code."""

    def __init__(self, session: Session, kind: str, callback: int, queue: ReadyCallbacks) -> None:
        self._session, self._callback, self._queue = session, callback, queue
        self._response = service(kind).response.__msgtype__
        self._count = 0
        self._answers: dict[int, Any] = {}
        self._answered = Signal(session.kernel, f"{session.component} (the answer of a service)")
        self.made: Service | None = None

    def _call(self, request: Any) -> bytes:
        self._count += 1
        return self._session.call_back(self._callback, Writer().integer(self._count).done() + to_cdr(request))

    def answer(self, request: Any) -> Any:
        """Return the response of the handler."""
        return from_cdr(self._response, Reader(self._call(request)).raw())

    def defer(self, request: Any) -> Any:
        """Let the executor run the handler; wait for the response in a task beside the executor."""
        started: list[int] = []

        def start() -> None:
            started.append(self._count + 1)
            self._call(request)

        kernel = self._session.kernel
        with kernel.interact():
            self._queue.add(Work(kernel.now(), start))
        self._answered.wait_for(lambda: bool(started) and started[0] in self._answers)
        return self._answers.pop(started[0])

    def respond(self, number: int, response: bytes) -> None:
        """Take the response to a request."""
        self._answers[number] = from_cdr(self._response, response)
        self._answered.notify()

    def close(self) -> None:
        """Stop serving."""
        if self.made is not None:
            self.made.close()


def _serve(session: Session, arguments: Reader) -> bytes:
    node, name, kind = _node(session, arguments), arguments.text(), arguments.text()
    deferred, callback, queue = (
        arguments.flag(),
        arguments.integer(),
        session.queue(arguments.integer()).ready,
    )
    server = _Server(session, kind, callback, queue)
    full = node.absolute_name(name, is_service=True)
    if deferred:
        beside = node.node.group(lambda work: session.spawn(work.run, name))
        server.made = node.node.serve(full, kind, server.defer, beside)
    else:
        server.made = node.node.serve(full, kind, server.answer, queue)
    return _named(session, server, server.made.name)


class _Client:
    """A client whose answers are given to the code by an executor."""

    def __init__(self, session: Session, client: Client) -> None:
        self._session, self._client = session, client
        self._request = service(client.type).request.__msgtype__
        self._count = 0
        self.ready, self.wait = client.ready, client.wait

    def send(self, request: bytes, callback: int, queue: ReadyCallbacks) -> int:
        """Send a request; return its number, with which the response is given to the code."""
        session, message = self._session, from_cdr(self._request, request)
        self._count += 1
        number = self._count

        def call() -> None:
            try:
                answer = Writer().integer(number).done() + to_cdr(self._client.call(message))
            except ServiceError:
                return  # as in ROS 2: there is no answer; what was not served is named after the run

            def give() -> None:
                session.call_back(callback, answer)

            kernel = session.kernel
            with kernel.interact():
                queue.add(Work(kernel.now(), give))

        session.spawn(call, f"call of {self._client.name}")
        return number

    def close(self) -> None:
        """Do nothing: a client has no state on the graph."""


def _create_client(session: Session, arguments: Reader) -> bytes:
    node, name, kind = _node(session, arguments), arguments.text(), arguments.text()
    made = node.node.client(node.absolute_name(name, is_service=True), kind)
    return _named(session, _Client(session, made), made.name)


def _send(session: Session, arguments: Reader) -> int:
    client, request = session.find(arguments.integer(), _Client), arguments.raw()
    return client.send(request, arguments.integer(), session.queue(arguments.integer()).ready)


# -- timers


class _Timer:
    """A timer, which calls the callable numbered *callback* each period."""

    def __init__(
        self, session: Session, node: RosNode, period: Ns, callback: int, group: ReadyCallbacks
    ) -> None:
        self._session, self._node, self._callback, self._group = session, node, callback, group
        self._period = max(period, SHORTEST_PERIOD)
        self._started: Ns = 0
        self._timer: Timer | None = None

    @property
    def cancelled(self) -> bool:
        """Whether the timer does not run."""
        return self._timer is None

    def reset(self) -> None:
        """Start the timer; the first call is one period from now."""
        self.close()
        self._started = self._session.kernel.now()
        self._timer = self._node.node.timer(self._period, self._fire, self._group)

    def close(self) -> None:
        """Stop the timer."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def left(self) -> Ns:
        """Return the time until the next call, ns; the longest there is for a cancelled timer."""
        if self._timer is None:
            return (1 << 63) - 1
        return self._period - (self._session.kernel.now() - self._started) % self._period

    def _fire(self) -> None:
        now = self._session.kernel.now()
        expected = now - (now - self._started) % self._period
        epoch = self._session.graph.epoch
        self._session.call_back(
            self._callback, Writer().integer(epoch + expected).integer(epoch + now).done()
        )


def _create_timer(session: Session, arguments: Reader) -> int:
    node, period, autostart = _node(session, arguments), arguments.integer(), arguments.flag()
    callback, queue = arguments.integer(), session.queue(arguments.integer())
    timer = _Timer(session, node, period, callback, queue.ready)
    if autostart:
        timer.reset()
    return session.keep(timer)


def _timer(session: Session, arguments: Reader) -> _Timer:
    return session.find(arguments.integer(), _Timer)


# -- executors


def _executor(session: Session, arguments: Reader) -> Executor:
    return session.find(arguments.integer(), Executor)


def _spinning(spin: Callable[[Session, Executor, Reader], None]) -> WithFiber[Session]:
    def handle(session: Session, fiber: CppFiber, arguments: Reader) -> None:
        executor = _executor(session, arguments)
        session.spin(fiber, lambda: spin(session, executor, arguments))

    return handle


def _spin_ready(session: Session, executor: Executor, arguments: Reader) -> None:
    executor.spin_ready(arguments.integer(), until_none=arguments.flag())


# -- the graph


def _wait_for_graph_change(session: Session, arguments: Reader) -> bool:
    within, graph = time_out(arguments.integer()), session.graph
    if not isinstance(graph, EmbeddedGraph):
        raise UsageError("wait_for_graph_change is there on the embedded graph only; sleep on real ROS")

    def state() -> Any:
        return graph.topics(), graph.services(), graph.node_names()

    before = state()
    return graph.changed.wait_for(lambda: state() != before or not session.running, within)


def _texts(names: Sequence[str]) -> bytes:
    reply = Writer().integer(len(names))
    for name in names:
        reply.text(name)
    return reply.done()


def _pairs(pairs: Sequence[tuple[str, str]]) -> bytes:
    reply = Writer().integer(len(pairs))
    for name, kind in pairs:
        reply.text(name).text(kind)
    return reply.done()


def _count(session: Session, arguments: Reader, end: str) -> int:
    node = _node(session, arguments)
    name = node.node.resolve(node.absolute_name(arguments.text()))
    with session.kernel.interact():
        return sum(len(getattr(topic, end)) for topic in session.graph.topics() if topic.name == name)


_EXCEPTIONS = (*EXCEPTIONS.values(), *NAME_EXCEPTIONS.values(), ExecutorError)
"""Errors of the code's making, which are exceptions in C++, too."""


_SUCCESS = Writer().flag(True).done()


def _checked(handle: Callable[..., Any]) -> Callable[..., bytes]:
    """Return a handler that states whether the request succeeded, or which exception it is to throw."""

    def handler(*given: Any) -> bytes:
        try:
            value = handle(*given)
        except _EXCEPTIONS as error:
            return Writer().flag(False).text(type(error).__name__).text(str(error)).done()
        return _SUCCESS + value if value else _SUCCESS

    return handler


_CHECKED: dict[str, Simple[Session]] = {
    "node": _create_node,
    "advertise": _advertise,
    "subscribe": _subscribe,
    "serve": _serve,
    "client": _create_client,
    "executor_add": lambda session, arguments: _executor(session, arguments).add(_node(session, arguments)),
    "executor_remove": lambda session, arguments: _executor(session, arguments).remove(
        _node(session, arguments)
    ),
    "executor_add_group": lambda session, arguments: _executor(session, arguments).add_queue(
        session.queue(arguments.integer())
    ),
    "executor_remove_group": lambda session, arguments: _executor(session, arguments).remove_queue(
        session.queue(arguments.integer())
    ),
    **PARAMETERS,
}

_PLAIN: dict[str, Simple[Session]] = {
    "init": lambda session, arguments: session.init(),
    "initialized": lambda session, arguments: session.running,
    "ok": lambda session, arguments: session.ok(),
    "shutdown": lambda session, arguments: session.shut_down(),
    "group": _create_group,
    "assert_liveliness": _assert_liveliness,
    "watch": _watch,
    "wait_for_graph_change": _wait_for_graph_change,
    "wait_for_message": _wait_for_message,
    "respond": lambda session, arguments: session.find(arguments.integer(), _Server).respond(
        arguments.integer(), arguments.raw()
    ),
    "send": _send,
    "service_ready": lambda session, arguments: session.find(arguments.integer(), _Client).ready(),
    "wait_for_service": lambda session, arguments: session.find(arguments.integer(), _Client).wait(
        time_out(arguments.integer())
    ),
    "timer": _create_timer,
    "timer_cancel": lambda session, arguments: _timer(session, arguments).close(),
    "timer_reset": lambda session, arguments: _timer(session, arguments).reset(),
    "timer_canceled": lambda session, arguments: _timer(session, arguments).cancelled,
    "timer_left": lambda session, arguments: _timer(session, arguments).left(),
    "executor": lambda session, arguments: session.keep(Executor(session)),
    "executor_cancel": lambda session, arguments: _executor(session, arguments).cancel(),
    "executor_spinning": lambda session, arguments: _executor(session, arguments).spinning,
    "nodes": lambda session, arguments: _texts(sorted(session.graph.node_names())),
    "topics": lambda session, arguments: _pairs(
        [(topic.name, topic.type) for topic in session.graph.topics()]
    ),
    "services": lambda session, arguments: _pairs([(one.name, one.type) for one in session.graph.services()]),
    "count_publishers": lambda session, arguments: _count(session, arguments, "publishers"),
    "count_subscribers": lambda session, arguments: _count(session, arguments, "subscribers"),
    **PLAIN_PARAMETERS,
}

_WITH_FIBER: dict[str, WithFiber[Session]] = {
    "executor_spin": _spinning(lambda session, executor, arguments: executor.spin()),
    "executor_spin_once": _spinning(
        lambda session, executor, arguments: executor.spin_once(time_out(arguments.integer()))
    ),
    "executor_spin_ready": _spinning(_spin_ready),
    **PARAMETERS_WITH_FIBER,
}


def request_handlers(session: Session) -> dict[str, RequestHandler]:
    """Return the handlers of all requests of the component that *session* belongs to, by name."""
    simple = {**_PLAIN, **{name: _checked(one) for name, one in _CHECKED.items()}}
    with_fiber: dict[str, WithFiber[Session]] = {name: _checked(one) for name, one in _WITH_FIBER.items()}
    help_spinning = _spinning(lambda session, executor, arguments: executor.help())
    return shared_handlers(session, simple, {**with_fiber, "executor_help": help_spinning})
