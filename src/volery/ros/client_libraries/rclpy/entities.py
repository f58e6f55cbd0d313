"""rclpy's entities of a node: publishers, subscriptions, services, clients, timers and guard conditions."""

from __future__ import annotations

from collections.abc import Callable
from inspect import iscoroutinefunction, signature
from typing import Any, Protocol

from volery.base.errors import UsageError
from volery.base.time import MS, Ns, S, from_seconds
from volery.kernel.waiting import Signal
from volery.ros.client_libraries.library_base import caller
from volery.ros.client_libraries.rclpy.context import Context, InvalidHandle, RCLError
from volery.ros.client_libraries.rclpy.events import (
    PublisherEventCallbacks,
    SubscriptionEventCallbacks,
    watch,
)
from volery.ros.client_libraries.rclpy.executors import CallbackGroup, CallbackQueue, Executor, Future
from volery.ros.client_libraries.rclpy.qos import graph_qos, profile_of
from volery.ros.client_libraries.rclpy.ros_time import Clock
from volery.ros.graph import CallFailedError, EmbeddedGraph, RosGraph, ServiceError, Work
from volery.ros.graph import Node as GraphNode
from volery.ros.messages import RosMessage, from_cdr, to_cdr
from volery.ros.messages.client_classes import (
    Odd,
    adopt,
    beyond_bound,
    bounded_fields,
    library_of,
    odd_values,
    receiving,
    take_odd_values,
)


class EntityNode(Protocol):
    """What entities use of their node."""

    @property
    def graph_node(self) -> GraphNode:
        """The node of the graph behind the node of rclpy."""

    @property
    def context(self) -> Context:
        """Context of the node."""

    @property
    def executor(self) -> Executor | None:
        """Executor that spins the node."""

    @property
    def graph(self) -> RosGraph:
        """Graph of the node."""

    def absolute_name(self, name: str, *, is_service: bool = False) -> str:
        """Return a checked name with its substitutions made."""

    def execute(self, callback: Callable[..., Any], *args: Any) -> Future | None:
        """Run a callback; return the task of one that is a coroutine function."""

    def get_logger(self) -> Any:
        """Return the logger of the node."""


def type_name(caller: str, given: Any) -> str:
    """Return the name of a message class; raise ``TypeError`` in the name of *caller* for anything else."""
    name = getattr(given, "__msgtype__", "")
    if not name:
        raise TypeError(f"{caller}: {given!r} is no message class; import one, as in std_msgs.msg")
    return str(name)


def service_name(caller: str, given: Any) -> str:
    """Return the name of a service class; raise ``TypeError`` in the name of *caller* for anything else."""
    name = getattr(given, "_type", "")
    if not name or not hasattr(given, "Request"):
        raise TypeError(f"{caller}: {given!r} is no service class; import one, as in std_srvs.srv")
    return str(name)


_REMEDY = "convert it to the field's type: float(), bool(), int()"


class Publisher:
    """Publisher returned by ``node.create_publisher``."""

    def __init__(
        self,
        node: EntityNode,
        msg_type: Any,
        topic: str,
        qos: Any,
        events: tuple[PublisherEventCallbacks | None, CallbackQueue] | None = None,
    ) -> None:
        self.msg_type = msg_type
        self.qos_profile = profile_of(qos)
        name = node.absolute_name(topic)
        kind = type_name("create_publisher", msg_type)
        self._node = node
        self._warned: set[str] = set()
        self._bounded = bounded_fields(msg_type)
        self._made = node.graph_node.advertise(name, kind, graph_qos(self.qos_profile))
        self.topic = self.topic_name = self._made.topic
        if events is not None and events[0] is not None:
            watch(node.context, node.graph, self._made, events[0], events[1].ready)

    def publish(self, msg: Any) -> None:
        """Publish a message, or the bytes of one.

        Raises:
            TypeError: It is of another type.
            RCLError: A sequence is longer than its bound.
        """
        if isinstance(msg, bytes):
            msg = adopt(from_cdr(self.msg_type.__msgtype__, msg), library_of(self.msg_type))
        if not isinstance(msg, self.msg_type.of_graph):
            raise TypeError(f"Expected {self.msg_type}, got {type(msg)}")
        if self._bounded:
            wrong = beyond_bound(msg, self._bounded)
            if wrong:
                raise RCLError(f"Failed to publish: cannot publish data: {wrong}")
        self._made.publish(msg)
        if odd_values:
            for value in take_odd_values(msg):
                self._warn(value)

    def _warn(self, odd: Odd) -> None:
        """Log once a source line and field that rclpy sends another value than it is given."""
        where = caller(2)
        text = (
            f"{where.file}:{where.line}: {self.topic_name}: {odd.path} is {odd.given!r}, a "
            f"{type(odd.given).__name__}; rclpy sends {odd.sent!r} ({_REMEDY})"
        )
        if text not in self._warned:
            self._warned.add(text)
            self._node.get_logger().warning(text)

    @property
    def logger_name(self) -> str:
        """Name of the node's logger."""
        return _logger_name(self._node)

    def assert_liveliness(self) -> None:
        """Assert that the publisher is alive, for ``LivelinessPolicy.MANUAL_BY_TOPIC``."""
        if isinstance(self._node.graph, EmbeddedGraph):
            kernel = self._node.context.kernel
            with kernel.interact():
                self._made.latest = kernel.now()  # type: ignore[attr-defined]  # of the embedded graph

    def wait_for_all_acked(self, timeout: Any = None) -> bool:
        """Return True: on the embedded graph a message is on its way when ``publish`` returns."""
        return True

    def get_subscription_count(self) -> int:
        """Return the number of subscriptions to the topic."""
        return self._made.subscribers()

    def destroy(self) -> None:
        """Remove the publisher from the graph."""
        self._made.close()

    def __enter__(self) -> Publisher:
        return self

    def __exit__(self, *_: object) -> None:
        self.destroy()


def _logger_name(node: EntityNode) -> str:
    return node.graph_node.name.strip("/").replace("/", ".")


_CALLBACK = (
    "Subscription.__init__(): callback should be either be callable with one argument"
    "(to get only the message) or two (to get message and message info)"
)


def _wants_info(callback: Any) -> bool:
    """Return whether a callback takes the message and its info; ``RuntimeError`` if it takes neither."""
    if not callable(callback):
        raise RuntimeError(_CALLBACK)
    try:
        signature(callback).bind(object())
    except TypeError:
        try:
            signature(callback).bind(object(), object())
        except TypeError:
            raise RuntimeError(_CALLBACK) from None
        return True
    except ValueError:  # a built-in function has no signature
        pass
    return False


class Subscription:
    """Subscription returned by ``node.create_subscription``."""

    def __init__(
        self,
        node: EntityNode,
        msg_type: Any,
        topic: str,
        callback: Callable[..., Any],
        *,
        qos: Any,
        queue: CallbackQueue,
        events: SubscriptionEventCallbacks | None = None,
        raw: bool = False,
    ) -> None:
        self.msg_type, self.callback, self.qos_profile = msg_type, callback, profile_of(qos)
        self.callback_group: CallbackGroup = queue.group
        self.raw = raw
        kind = type_name("create_subscription", msg_type)
        self._adopt = receiving(msg_type)
        self._node = node
        self._wants_info = _wants_info(callback)
        self._received = 0
        name = node.absolute_name(topic)
        used = graph_qos(self.qos_profile, reads=True)
        self._made = node.graph_node.subscribe(name, kind, self._call, used, queue.ready)
        self.topic = self.topic_name = self._made.topic
        queue.add(self)
        if events is not None:
            watch(node.context, node.graph, self._made, events, queue.ready)

    def _call(self, message: Any) -> None:
        given = to_cdr(message) if self.raw else message
        if self._adopt is not None and not self.raw:
            self._adopt(message)
        if not self._wants_info:
            self._node.execute(self.callback, given)
            return
        self._received += 1
        now = self._node.graph.epoch + self._node.context.kernel.now()
        info = {
            "source_timestamp": now,
            "received_timestamp": now,
            "publication_sequence_number": self._received,
            "reception_sequence_number": self._received,
        }
        self._node.execute(self.callback, given, info)

    @property
    def logger_name(self) -> str:
        """Name of the node's logger."""
        return _logger_name(self._node)

    def get_publisher_count(self) -> int:
        """Return the number of publishers of the topic."""
        return self._made.publishers()

    def destroy(self) -> None:
        """Remove the subscription from the graph."""
        self._made.close()

    def __enter__(self) -> Subscription:
        return self

    def __exit__(self, *_: object) -> None:
        self.destroy()


class Service:
    """Service of node.create_service. The callback gets request and response; it returns one."""

    def __init__(
        self,
        node: EntityNode,
        srv_type: Any,
        name: str,
        callback: Callable[[Any, Any], Any],
        queue: CallbackQueue,
    ) -> None:
        self.srv_type, self.callback = srv_type, callback
        self.callback_group: CallbackGroup = queue.group
        kind = service_name("create_service", srv_type)
        self._node, self._queue = node, queue
        self._answered = Signal(node.context.kernel, f"{name} (a coroutine's response)")
        full = node.absolute_name(name, is_service=True)
        if iscoroutinefunction(callback):
            beside = node.graph_node.group(lambda work: node.context.spawn(work.run, name))
            self._made = node.graph_node.serve(full, kind, self._await_response, beside)
        else:
            self._made = node.graph_node.serve(full, kind, self._handle, queue.ready)
        self.srv_name = self.service_name = self._made.name
        queue.add(self)

    def _handle(self, request: Any) -> Any:
        adopt(request, library_of(self.srv_type.Request))
        return self._checked(self.callback(request, self.srv_type.Response()))

    def _checked(self, response: Any) -> Any:
        if not isinstance(response, RosMessage):
            raise TypeError(f"service {self.srv_name}: its callback returned {response!r}, not a response")
        return response

    @property
    def logger_name(self) -> str:
        """Name of the node's logger."""
        return _logger_name(self._node)

    def _await_response(self, request: Any) -> Any:
        """Let the executor run the coroutine; wait for its result in a task beside the executor."""
        adopt(request, library_of(self.srv_type.Request))
        started: list[Future] = []

        def start() -> None:
            made = self._node.execute(self.callback, request, self.srv_type.Response())
            if made is None:  # the node has left its executor
                raise UsageError(f"service {self.srv_name}: no executor spins its node")
            started.append(made)
            made.on_done(self._answered.notify)

        kernel = self._node.context.kernel
        with kernel.guard:
            self._queue.ready.add(Work(kernel.now(), start))
        self._answered.wait_for(lambda: started and started[0].done())
        if started[0].exception() is not None:  # the executor has raised it
            raise CallFailedError(str(started[0].exception()))
        return self._checked(started[0].result())

    def configure_introspection(
        self, clock: Any, service_event_qos_profile: Any, introspection_state: Any
    ) -> None:
        """Refuse all but ``OFF``: calls of services are in the trace."""
        _refuse_introspection(introspection_state)

    def destroy(self) -> None:
        """Remove the service from the graph."""
        self._made.close()


class Client:
    """Client returned by ``node.create_client``. Responses are processed when the executor spins."""

    def __init__(self, node: EntityNode, srv_type: Any, name: str, queue: CallbackQueue) -> None:
        self.srv_type = srv_type
        self.callback_group: CallbackGroup = queue.group
        self._node, self._queue = node, queue
        full = node.absolute_name(name, is_service=True)
        self._made = node.graph_node.client(full, service_name("create_client", srv_type))
        self.srv_name = self.service_name = self._made.name
        self._destroyed = False
        self._pending: list[Future] = []
        queue.add(self)

    def remove_pending_request(self, future: Future) -> None:
        """Forget a request, whose future will not be completed."""
        if future in self._pending:
            self._pending.remove(future)
            future.abandon()

    def configure_introspection(
        self, clock: Any, service_event_qos_profile: Any, introspection_state: Any
    ) -> None:
        """Refuse all but ``OFF``: calls of services are in the trace."""
        _refuse_introspection(introspection_state)

    @property
    def logger_name(self) -> str:
        """Name of the node's logger."""
        return _logger_name(self._node)

    def service_is_ready(self) -> bool:
        """Return whether the service is available."""
        return self._made.ready()

    def wait_for_service(self, timeout_sec: float | None = None) -> bool:
        """Block until the service is available; return False after a time-out."""
        return self._made.wait(None if timeout_sec is None or timeout_sec < 0 else from_seconds(timeout_sec))

    def call_async(self, request: Any) -> Future:
        """Send a request; return the future of its response, which never comes if there is no server."""
        return self._send(request, self._node.executor)

    def _send(self, request: Any, executor: Executor | None) -> Future:
        if self._destroyed:
            raise InvalidHandle("the client was destroyed")
        if not isinstance(request, self.srv_type.Request.of_graph):
            raise TypeError(f"Expected {self.srv_type.Request}, got {type(request)}")
        future = Future(executor=executor)
        self._pending.append(future)
        future.on_done(lambda: self._pending.remove(future) if future in self._pending else None)
        sent = request.copy()
        context = self._node.context

        def call() -> None:
            try:
                response = self._made.call(sent)
            except ServiceError as error:
                if error.no_server:
                    return  # as in ROS 2: the request is lost, and what was not served is named after the run
                failure = error
                self._enqueue(lambda: future.set_exception(failure))
            else:
                adopt(response, library_of(self.srv_type.Response))
                self._enqueue(lambda: future.set_result(response))

        context.spawn(call, f"call of {self.srv_name}")
        return future

    def _enqueue(self, action: Callable[[], None]) -> None:
        kernel = self._node.context.kernel
        with kernel.guard:
            self._queue.ready.add(Work(kernel.now(), action))

    def call(self, request: Any, timeout_sec: float | None = None) -> Any:
        """Send a request and block until an executor in another task has processed the response.

        Raises:
            TimeoutError: No response was processed in time.
        """
        future = self._send(request, None)  # without an executor the waiting task is notified at once
        answered = Signal(
            self._node.context.kernel, f"{self.srv_name} (an answer, which an executor takes in)"
        )
        future.add_done_callback(lambda _: answered.notify())
        within = None if timeout_sec is None or timeout_sec < 0 else from_seconds(timeout_sec)
        if not answered.wait_for(future.done, within):
            raise TimeoutError(f"no answer from {self.srv_name} within {timeout_sec} s")
        return future.result()

    def destroy(self) -> None:
        """Refuse further calls."""
        self._destroyed = True


def _refuse_introspection(state: Any) -> None:
    if int(state):
        raise UsageError(
            "service introspection is not there on the embedded graph: calls are in the trace (`volery "
            "timeline`); configure ServiceIntrospectionState.OFF"
        )


class Timer:
    """Timer returned by ``node.create_timer``. One of 0 s calls each ``SHORTEST_PERIOD``."""

    def __init__(
        self,
        node: EntityNode,
        period: Ns,
        callback: Callable[..., Any] | None,
        queue: CallbackQueue,
        clock: Clock,
        *,
        autostart: bool = True,
    ) -> None:
        self.callback = callback
        self.callback_group: CallbackGroup = queue.group
        self.timer_period_ns = period
        self.clock = clock
        self._node, self._queue = node, queue
        self._made: Any = None
        self._started: Ns = 0
        self._called: Ns | None = None
        queue.add(self)
        if autostart:
            self.reset()

    def _fire(self) -> None:
        self._called = self._node.context.kernel.now()
        if self.callback is not None:
            self._node.execute(self.callback)

    def cancel(self) -> None:
        """Stop the timer until it is reset."""
        if self._made is not None:
            self._made.cancel()
            self._made = None

    def is_canceled(self) -> bool:
        """Return whether the timer is cancelled."""
        return self._made is None

    def is_ready(self) -> bool:
        """Return whether the timer's callback waits for the executor."""
        left = self.time_until_next_call()
        return left is not None and left <= 0

    def reset(self) -> None:
        """Restart the timer; the next call is one period from now."""
        self.cancel()
        self._started = self._node.context.kernel.now()
        period = max(self.timer_period_ns, SHORTEST_PERIOD)
        self._made = self._node.graph_node.timer(period, self._fire, self._queue.ready)

    def time_until_next_call(self) -> Ns | None:
        """Return the time until the next call in ns, or None if the timer is cancelled."""
        if self._made is None:
            return None
        since = self._node.context.kernel.now() - self._started
        period = max(self.timer_period_ns, SHORTEST_PERIOD)
        return period - since % period

    def time_since_last_call(self) -> Ns:
        """Return the time since the last call, or since the start, in ns."""
        last = self._started if self._called is None else self._called
        return self._node.context.kernel.now() - last

    def destroy(self) -> None:
        """Stop the timer."""
        self.cancel()


SHORTEST_PERIOD: Ns = MS
"""Period of a timer of 0 s, which rclpy calls as often as its executor comes round."""


class GuardCondition:
    """Guard condition of ``node.create_guard_condition``: a callback that ``trigger`` makes ready."""

    def __init__(self, node: EntityNode, callback: Callable[[], Any], queue: CallbackQueue) -> None:
        self.callback = callback
        self.callback_group: CallbackGroup = queue.group
        self._node, self._queue = node, queue
        self._destroyed = self._ready = False
        queue.add(self)

    def trigger(self) -> None:
        """Let the executor call back, once for all triggers before it does."""
        if self._destroyed:
            raise InvalidHandle("cannot use Destroyable because destruction was requested")
        if not self._ready:
            self._ready = True
            kernel = self._node.context.kernel
            with kernel.interact():
                self._queue.ready.add(Work(kernel.now(), self._run))

    def _run(self) -> None:
        self._ready = False
        if not self._destroyed and self.callback is not None:
            self._node.execute(self.callback)

    def destroy(self) -> None:
        """Refuse further triggers."""
        self._destroyed = True


def timer_period(seconds: float) -> Ns:
    """Return the period of a timer in ns; raise ``RCLError`` if it is negative."""
    if seconds < 0:
        raise RCLError("failed to create timer: timer period must be non-negative")
    return int(float(seconds) * S)
