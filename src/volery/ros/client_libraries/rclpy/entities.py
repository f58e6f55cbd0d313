"""What an rclpy node makes: publishers, subscriptions, services, clients and timers."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from volery.base.time import Ns, S, from_seconds
from volery.kernel.waiting import Signal
from volery.ros.client_libraries.rclpy.errors import InvalidHandle
from volery.ros.client_libraries.rclpy.executors import Future
from volery.ros.client_libraries.rclpy.qos import graph_qos
from volery.ros.graph import ServiceError
from volery.ros.graph.callbacks import Work
from volery.ros.messages import Message

if TYPE_CHECKING:
    from volery.ros.client_libraries.rclpy.executors import CallbackGroup, Executor, Queue
    from volery.ros.client_libraries.rclpy.node import Node


def type_name(what: str, given: Any) -> str:
    """The name of a message type that is given as its class."""
    name = getattr(given, "__msgtype__", "")
    if not name:
        raise TypeError(f"{what}: {given!r} is no message class; import one, as in std_msgs.msg")
    return str(name)


def service_name(what: str, given: Any) -> str:
    """The name of a service type that is given as its class."""
    name = getattr(given, "_type", "")
    if not name or not hasattr(given, "Request"):
        raise TypeError(f"{what}: {given!r} is no service class; import one, as in std_srvs.srv")
    return str(name)


class Publisher:
    """``node.create_publisher``."""

    def __init__(self, node: Node, msg_type: Any, topic: str, qos: Any) -> None:
        self.msg_type = msg_type
        self.qos_profile = qos
        self._made = node.graph_node.advertise(topic, type_name("create_publisher", msg_type), graph_qos(qos))
        self.topic = self.topic_name = self._made.topic

    def publish(self, msg: Any) -> None:
        """Send a message; ``TypeError`` if it is of another type."""
        if not isinstance(msg, self.msg_type):
            raise TypeError(f"Expected {self.msg_type}, got {type(msg)}")
        self._made.publish(msg)

    def get_subscription_count(self) -> int:
        """How many listen."""
        return self._made.subscribers()

    def destroy(self) -> None:
        """Publish no longer."""
        self._made.close()


class Subscription:
    """``node.create_subscription``."""

    def __init__(
        self, node: Node, msg_type: Any, topic: str, callback: Callable[[Any], Any], *, qos: Any, queue: Queue
    ) -> None:
        self.msg_type, self.callback, self.qos_profile = msg_type, callback, qos
        self.callback_group: CallbackGroup = queue.group
        kind = type_name("create_subscription", msg_type)
        self._node = node
        self._made = node.graph_node.subscribe(topic, kind, self._call, graph_qos(qos), queue.ready)
        self.topic = self.topic_name = self._made.topic

    def _call(self, message: Any) -> None:
        self._node.execute(self.callback, message)

    def get_publisher_count(self) -> int:
        """How many it hears."""
        return self._made.publishers()

    def destroy(self) -> None:
        """Receive no longer."""
        self._made.close()


class Service:
    """``node.create_service``: the callback gets the request and an empty response, and returns one."""

    def __init__(
        self, node: Node, srv_type: Any, name: str, callback: Callable[[Any, Any], Any], queue: Queue
    ) -> None:
        self.srv_type, self.callback = srv_type, callback
        self.callback_group: CallbackGroup = queue.group
        kind = service_name("create_service", srv_type)
        self._made = node.graph_node.serve(name, kind, self._answer, queue.ready)
        self.srv_name = self.service_name = self._made.name

    def _answer(self, request: Any) -> Any:
        response = self.callback(request, self.srv_type.Response())
        if not isinstance(response, Message):
            close = getattr(response, "close", None)
            if close is not None:
                close()
                raise TypeError(f"service {self.srv_name}: a coroutine cannot answer on the embedded graph")
            raise TypeError(f"service {self.srv_name}: its callback returned {response!r}, not a response")
        return response

    def destroy(self) -> None:
        """Answer no longer."""
        self._made.close()


class Client:
    """``node.create_client``. An answer is taken in when the executor spins."""

    def __init__(self, node: Node, srv_type: Any, name: str, queue: Queue) -> None:
        self.srv_type = srv_type
        self.callback_group: CallbackGroup = queue.group
        self._node, self._queue = node, queue
        self._made = node.graph_node.client(name, service_name("create_client", srv_type))
        self.srv_name = self.service_name = self._made.name
        self._destroyed = False

    def service_is_ready(self) -> bool:
        """Whether somebody serves it."""
        return self._made.ready()

    def wait_for_service(self, timeout_sec: float | None = None) -> bool:
        """Block until somebody serves it; False if nobody does in time."""
        return self._made.wait(None if timeout_sec is None or timeout_sec < 0 else from_seconds(timeout_sec))

    def call_async(self, request: Any) -> Future:
        """Ask; the answer comes later."""
        return self._ask(request, self._node.executor)

    def _ask(self, request: Any, executor: Executor | None) -> Future:
        if self._destroyed:
            raise InvalidHandle("the client was destroyed")
        if not isinstance(request, self.srv_type.Request):
            raise TypeError(f"Expected {self.srv_type.Request}, got {type(request)}")
        future = Future(executor=executor)
        asked = request.copy()
        context = self._node.context

        def ask() -> None:
            try:
                answer = self._made.call(asked)
            except ServiceError as error:
                failure = error
                self._later(lambda: future.set_exception(failure))
            else:
                self._later(lambda: future.set_result(answer))

        context.spawn(ask, f"call of {self.srv_name}")
        return future

    def _later(self, action: Callable[[], None]) -> None:
        kernel = self._node.context.kernel
        with kernel.guard:
            self._queue.ready.add(Work(kernel.now(), action))

    def call(self, request: Any, timeout_sec: float | None = None) -> Any:
        """Ask and block until the answer is taken in: somebody else must spin meanwhile, as in rclpy.

        ``TimeoutError`` if it does not come in time.
        """
        future = self._ask(request, None)  # whoever waits here is told at once
        answered = Signal(
            self._node.context.kernel, f"{self.srv_name} (an answer, which an executor takes in)"
        )
        future.add_done_callback(lambda _: answered.notify())
        within = None if timeout_sec is None or timeout_sec < 0 else from_seconds(timeout_sec)
        if not answered.wait_for(future.done, within):
            raise TimeoutError(f"no answer from {self.srv_name} within {timeout_sec} s")
        return future.result()

    def destroy(self) -> None:
        """Ask no more."""
        self._destroyed = True


class Timer:
    """``node.create_timer``."""

    def __init__(
        self, node: Node, period: Ns, callback: Callable[..., Any], queue: Queue, *, autostart: bool = True
    ) -> None:
        self.callback = callback
        self.callback_group: CallbackGroup = queue.group
        self.timer_period_ns = period
        self._node, self._queue = node, queue
        self._made: Any = None
        self._started: Ns = 0
        if autostart:
            self.reset()

    def _fire(self) -> None:
        self._node.execute(self.callback)

    def cancel(self) -> None:
        """Call back no longer, until it is reset."""
        if self._made is not None:
            self._made.cancel()
            self._made = None

    def is_canceled(self) -> bool:
        """Whether it is cancelled."""
        return self._made is None

    def reset(self) -> None:
        """Begin anew: the next call comes one period from now."""
        self.cancel()
        self._started = self._node.context.kernel.now()
        self._made = self._node.graph_node.timer(self.timer_period_ns, self._fire, self._queue.ready)

    def time_until_next_call(self) -> Ns | None:
        """Nanoseconds; ``None`` when it is cancelled."""
        if self._made is None:
            return None
        since = self._node.context.kernel.now() - self._started
        return self.timer_period_ns - since % self.timer_period_ns

    def destroy(self) -> None:
        """Call back no longer."""
        self.cancel()


def period_of(seconds: float) -> Ns:
    """A timer's period; rclpy takes it in seconds."""
    if seconds <= 0:
        raise ValueError("timer period must be above 0 s")
    return round(seconds * S)
