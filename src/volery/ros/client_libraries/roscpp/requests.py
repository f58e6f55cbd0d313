"""Handlers of the requests of C++ code: topics, services, timers, spinning, names, time and parameters."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.ros.client_libraries.abi_codec import CppFiber, Reader, RequestHandler, Writer
from volery.ros.client_libraries.cpp.requests import CdrPublisher, Simple, WithFiber, time_out
from volery.ros.client_libraries.cpp.requests import request_handlers as shared_handlers
from volery.ros.client_libraries.cpp.session import RefusedRequestError
from volery.ros.client_libraries.roscpp.session import Session
from volery.ros.graph import BEST_AVAILABLE, LATCHED, Client, QoS, ReadyCallbacks, ServiceError, Timer
from volery.ros.graph.endpoints import Connection, EmbeddedPublisher
from volery.ros.graph.work import Work
from volery.ros.messages import from_cdr, service, to_cdr

# -- topics


def _subscriber_qos(depth: int) -> QoS:
    """Return a QoS that matches every publisher, because ROS 1 has no QoS."""
    return QoS(depth or None, BEST_AVAILABLE, BEST_AVAILABLE)


def _advertise(session: Session, arguments: Reader) -> int:
    topic, kind = arguments.text(), arguments.text()
    depth, latched = arguments.integer(), arguments.flag()
    qos = LATCHED if latched else QoS(depth or None)
    return session.keep(CdrPublisher(session.node.advertise(topic, kind, qos), kind))


def _watch(session: Session, arguments: Reader) -> None:
    """Call back for each subscription that is connected to a publisher, or disconnected from it."""
    publisher = session.find(arguments.integer(), CdrPublisher).made
    callback, group = arguments.integer(), session.group(arguments.integer())
    if not isinstance(publisher, EmbeddedPublisher):
        raise UsageError(
            f"{session.component}: advertise() with callbacks of connections needs a simulated graph"
        )

    def on_change(connection: Connection, connected: bool) -> None:
        event = Writer().flag(connected).integer(session.keep(connection) if connected else -1)
        event.text(publisher.topic).text(connection.to.node.name)

        def tell() -> None:
            session.call_back(callback, event.done())

        group.add(Work(session.kernel.now(), tell))

    publisher.watch(on_change)


def _publish_to(session: Session, arguments: Reader) -> None:
    publisher, connection = session.find(arguments.integer(), CdrPublisher), arguments.integer()
    publisher.publish_to(session.find(connection, Connection), arguments.raw())


def _subscribe(session: Session, arguments: Reader) -> int:
    topic, kind = arguments.text(), arguments.text()
    depth, callback, group = arguments.integer(), arguments.integer(), session.group(arguments.integer())

    def on_message(message: Any) -> None:
        session.call_back(callback, to_cdr(message))

    return session.keep(session.node.subscribe(topic, kind, on_message, _subscriber_qos(depth), group))


def _wait_for_message(session: Session, arguments: Reader) -> bytes:
    topic, kind, within = arguments.text(), arguments.text(), time_out(arguments.integer())
    received: list[Any] = []
    group = session.node.group()
    subscription = session.node.subscribe(topic, kind, received.append, _subscriber_qos(1), group)
    try:
        group.spin_once(within)
    finally:
        subscription.close()
    reply = Writer().flag(bool(received)).done()
    return reply + to_cdr(received[0]) if received else reply


# -- services


def _serve(session: Session, arguments: Reader) -> int:
    name, request_type, callback = arguments.text(), arguments.text(), arguments.integer()
    group = session.group(arguments.integer())
    kind = service(request_type.removesuffix("_Request"))

    def handler(request: Any) -> Any:
        result = Reader(session.call_back(callback, to_cdr(request)))
        if not result.flag():
            raise RefusedRequestError(name, "its handler returned false")
        return from_cdr(kind.response.__msgtype__, result.raw())

    return session.keep(session.node.serve(name, kind.name, handler, group))


class _Client:
    """A client of a service whose requests and responses are in CDR."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._request = service(client.type).request.__msgtype__

    def call(self, data: bytes) -> bytes | None:
        """Return the encoded response, or None if the call fails."""
        try:
            return to_cdr(self._client.call(from_cdr(self._request, data)))
        except ServiceError:
            return None


def _create_client(session: Session, arguments: Reader) -> int:
    return session.keep(_Client(session.node.client(arguments.text(), arguments.text())))


def _call(session: Session, arguments: Reader) -> bytes:
    response = session.find(arguments.integer(), _Client).call(arguments.raw())
    return Writer().flag(response is not None).done() + (response or b"")


def _wait_for_service(session: Session, arguments: Reader) -> bool:
    return session.node.wait_for_service(arguments.text(), time_out(arguments.integer()))


# -- timers


class _Timer:
    """A ``ros::Timer``, which calls the callable numbered *callback* each *period*, or once."""

    def __init__(
        self, session: Session, period: Ns, callback: int, group: ReadyCallbacks, *, oneshot: bool
    ) -> None:
        if period <= 0:
            raise UsageError(
                f"{session.component}: a ros::Timer with a period of {period} ns; it must be above 0"
            )
        self._session = session
        self._period = period
        self._callback = callback
        self._group = group
        self._oneshot = oneshot
        self._timer: Timer | None = None
        self._expected: Ns = 0
        self._last: tuple[Ns, Ns] = (0, 0)  # expected and actual time of the last call
        self._took: Ns = 0

    @property
    def started(self) -> bool:
        """Whether the timer runs."""
        return self._timer is not None

    def start(self) -> None:
        """Start the timer; the first call is one period from now. A running timer is not changed."""
        if self._timer is None:
            self._expected = self._session.now() + self._period
            self._timer = self._session.node.timer(self._period, self._fire, self._group)

    def close(self) -> None:
        """Stop the timer."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def set_period(self, period: Ns) -> None:
        """Set another period, which begins now."""
        self._period = period
        if self.started:
            self.close()
            self.start()

    def _fire(self) -> None:
        now, expected = self._session.now(), self._expected
        event = Writer()
        for moment in (*self._last, expected, now, self._took):
            event.integer(moment)
        self._last = expected, now
        self._expected += self._period * max(1, (now - expected) // self._period + 1)
        if self._oneshot:
            self.close()
        self._session.call_back(self._callback, event.done())
        self._took = self._session.now() - now


def _create_timer(session: Session, arguments: Reader) -> int:
    period, oneshot, autostart = arguments.integer(), arguments.flag(), arguments.flag()
    callback, group = arguments.integer(), session.group(arguments.integer())
    timer = _Timer(session, period, callback, group, oneshot=oneshot)
    if autostart:
        timer.start()
    return session.keep(timer)


def _find_timer(session: Session, arguments: Reader) -> _Timer:
    return session.find(arguments.integer(), _Timer)


# -- queues of callbacks, and tasks beside the one of main()


class _Spinner:
    """Tasks that run the callbacks of a queue until they are stopped or the node shuts down."""

    def __init__(self, session: Session, group: ReadyCallbacks) -> None:
        self._session, self._group = session, group
        self._spinning = 0
        self._stopped = False

    def spin(self) -> None:
        """Run callbacks in the current task."""
        self._spinning += 1
        while not (self._stopped or self._session.node.closed):
            self._group.spin_once()

    def stop(self) -> None:
        """Let the tasks end: work that does nothing wakes each of them."""
        self._stopped = True
        for _ in range(self._spinning):
            self._group.add(Work(self._session.kernel.now(), lambda: None))


def _call_available(group: ReadyCallbacks, timeout: Ns) -> bool:
    """Run all callbacks that are ready, the first of which is awaited."""
    if timeout <= 0 or group.oldest is not None or group.spin_once(timeout):
        group.spin_available()
    return True


def _queue_call(how: Callable[[ReadyCallbacks, Ns], bool]) -> Callable[[Session, CppFiber, Reader], bool]:
    def handle(session: Session, fiber: CppFiber, arguments: Reader) -> bool:
        group, timeout = session.group(arguments.integer()), arguments.integer()
        called: list[bool] = []
        session.spin(fiber, lambda: called.append(how(group, timeout)))
        return called[-1]

    return handle


def _queue_clear(session: Session, arguments: Reader) -> None:
    group = session.group(arguments.integer())
    while group.oldest is not None:
        group.take()


def _spin_spinner(session: Session, fiber: CppFiber, arguments: Reader) -> None:
    session.spin(fiber, session.find(arguments.integer(), _Spinner).spin)


_ENTITIES: dict[str, Simple[Session]] = {
    "advertise": _advertise,
    "watch": _watch,
    "publish_to": _publish_to,
    "queue": lambda session, arguments: session.keep(session.node.group()),
    "queue_length": lambda session, arguments: len(session.group(arguments.integer())),
    "queue_clear": _queue_clear,
    "spinner": lambda session, arguments: session.keep(_Spinner(session, session.group(arguments.integer()))),
    "spinner_stop": lambda session, arguments: session.find(arguments.integer(), _Spinner).stop(),
    "subscribe": _subscribe,
    "wait_for_message": _wait_for_message,
    "serve": _serve,
    "client": _create_client,
    "call": _call,
    "wait_for_service": _wait_for_service,
    "timer": _create_timer,
    "timer_start": lambda session, arguments: _find_timer(session, arguments).start(),
    "timer_stop": lambda session, arguments: _find_timer(session, arguments).close(),
    "timer_started": lambda session, arguments: _find_timer(session, arguments).started,
    "timer_period": lambda session, arguments: _find_timer(session, arguments).set_period(
        arguments.integer()
    ),
}

_WITH_FIBER: dict[str, WithFiber[Session]] = {
    "spin_once": lambda session, fiber, arguments: session.spin(fiber, session.node.spin_available),
    "spin": lambda session, fiber, arguments: session.spin(fiber, session.node.spin),
    "queue_call_one": _queue_call(lambda group, timeout: group.spin_once(max(timeout, 0))),
    "queue_call_available": _queue_call(_call_available),
    "spinner_spin": _spin_spinner,
}


# -- the process


def _init(session: Session, arguments: Reader) -> None:
    session.join(arguments.text(), anonymous=arguments.flag())


_PROCESS: dict[str, Simple[Session]] = {
    "init": _init,
    "initialized": lambda session, arguments: session.opened is not None,
    "ok": lambda session, arguments: session.ok(),
    "wait_for_shutdown": lambda session, arguments: session.wait_for_end(),
}


# -- names


def _resolve(session: Session, arguments: Reader) -> str:
    namespace, name = arguments.text(), arguments.text()
    if namespace and not name.startswith(("/", "~")):
        name = f"{namespace.rstrip('/')}/{name}"
    return session.node.resolve(name)


def _node_handle(session: Session, arguments: Reader) -> str:
    """Return the absolute namespace of a handle that was created in the namespace of another."""
    node, parent, namespace = session.node, arguments.text() or session.node.namespace, arguments.text()
    if namespace.startswith("~"):
        inner = namespace[1:].strip("/")
        return f"{node.name}/{inner}" if inner else node.name
    if namespace.startswith("/"):
        return namespace
    return f"{parent.rstrip('/')}/{namespace}".rstrip("/") or "/"


_NAMES: dict[str, Simple[Session]] = {
    "resolve": _resolve,
    "node_handle": _node_handle,
    "name": lambda session, arguments: session.node.name,
    "namespace": lambda session, arguments: session.node.namespace,
    "nodes": lambda session, arguments: _texts(sorted(session.graph.node_names())),
}


# -- time


# -- parameters, whose values are encoded as a letter for the kind and the value


def write_parameter(writer: Writer, value: Any) -> None:
    """Append a value. A value of a kind that C++ does not know is written as its text."""
    if isinstance(value, bool):
        writer.text("b").flag(value)
    elif isinstance(value, int):
        writer.text("i").integer(value)
    elif isinstance(value, float):
        writer.text("d").real(value)
    elif isinstance(value, (list, tuple)):
        writer.text("l").integer(len(value))
        for item in value:
            write_parameter(writer, item)
    elif isinstance(value, dict):
        writer.text("m").integer(len(value))
        for name, item in value.items():
            write_parameter(writer.text(name), item)
    else:
        writer.text("s").text(str(value))


def read_parameter(reader: Reader) -> Any:
    """Read a value."""
    kind = reader.text()
    if kind == "l":
        return [read_parameter(reader) for _ in range(reader.integer())]
    if kind == "m":
        return {reader.text(): read_parameter(reader) for _ in range(reader.integer())}
    return {"b": reader.flag, "i": reader.integer, "d": reader.real, "s": reader.text}[kind]()


def _leaf_names(tree: Any, prefix: str = "") -> Iterable[str]:
    if not isinstance(tree, dict):
        yield prefix
        return
    for name, inner in tree.items():
        yield from _leaf_names(inner, f"{prefix}/{name}")


def _get_parameter(session: Session, arguments: Reader) -> bytes:
    name, missing = arguments.text(), object()
    value = session.node.get_parameter(name, missing)
    reply = Writer().flag(value is not missing)
    if value is not missing:
        write_parameter(reply, value)
    return reply.done()


def _set_parameter(session: Session, arguments: Reader) -> None:
    session.node.set_parameter(arguments.text(), read_parameter(arguments))


def _delete_parameter(session: Session, arguments: Reader) -> bool:
    name = arguments.text()
    exists = session.node.has_parameter(name)
    if exists:
        session.node.delete_parameter(name)
    return exists


def _parameter_names(session: Session, arguments: Reader) -> bytes:
    return _texts(sorted(_leaf_names(session.node.get_parameter("/", {}))))


def _texts(names: Sequence[str]) -> bytes:
    reply = Writer().integer(len(names))
    for name in names:
        reply.text(name)
    return reply.done()


def _search_parameter(session: Session, arguments: Reader) -> str:
    """Return the full name of the parameter that is found first from a namespace upwards, or ``""``."""
    namespace, key = arguments.text() or session.node.name, arguments.text()
    if key.startswith(("/", "~")):
        return session.node.resolve(key) if session.node.has_parameter(key) else ""
    first = key.partition("/")[0]
    above = [part for part in namespace.split("/") if part]
    for length in range(len(above), -1, -1):
        place = "/".join(("", *above[:length]))
        if session.node.has_parameter(f"{place}/{first}"):
            return f"{place}/{key}"
    return ""


_PARAMETERS: dict[str, Simple[Session]] = {
    "param_get": _get_parameter,
    "param_set": _set_parameter,
    "param_has": lambda session, arguments: session.node.has_parameter(arguments.text()),
    "param_delete": _delete_parameter,
    "param_names": _parameter_names,
    "param_search": _search_parameter,
}


def request_handlers(session: Session) -> dict[str, RequestHandler]:
    """Return the handlers of all requests of the component that *session* belongs to, by name."""
    own = {**_ENTITIES, **_PROCESS, **_NAMES, **_PARAMETERS}
    return shared_handlers(session, own, _WITH_FIBER)
