"""Handlers of the requests about topics, services, timers and spinning."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.ros.client_libraries.abi_codec import CppFiber, Reader, Writer
from volery.ros.client_libraries.roscpp.session import RefusedRequestError, Session
from volery.ros.graph import BEST_AVAILABLE, LATCHED, Client, QoS, ServiceError, Timer
from volery.ros.messages import from_cdr, service, to_cdr

# -- topics


def _subscriber_qos(depth: int) -> QoS:
    """Return a QoS that matches every publisher, because ROS 1 has no QoS."""
    return QoS(depth or None, BEST_AVAILABLE, BEST_AVAILABLE)


class _Publisher:
    """A publisher of messages in CDR."""

    def __init__(self, session: Session, arguments: Reader) -> None:
        topic, self._type = arguments.text(), arguments.text()
        depth, latched = arguments.integer(), arguments.flag()
        qos = LATCHED if latched else QoS(depth or None)
        self.made = session.node.advertise(topic, self._type, qos)
        self.close = self.made.close

    def publish(self, data: bytes) -> None:
        """Publish the message that *data* encodes."""
        self.made.publish(from_cdr(self._type, data))


def _publish(session: Session, arguments: Reader) -> None:
    session.find(arguments.integer(), _Publisher).publish(arguments.raw())


def _subscribe(session: Session, arguments: Reader) -> int:
    topic, kind = arguments.text(), arguments.text()
    depth, callback = arguments.integer(), arguments.integer()

    def on_message(message: Any) -> None:
        session.call_back(callback, to_cdr(message))

    return session.keep(session.node.subscribe(topic, kind, on_message, _subscriber_qos(depth)))


def _publisher_count(session: Session, arguments: Reader) -> int:
    count: int = session.entity(arguments.integer()).publishers()
    return count


def _wait_for_message(session: Session, arguments: Reader) -> bytes:
    topic, kind, within = arguments.text(), arguments.text(), _timeout(arguments.integer())
    received: list[Any] = []
    group = session.node.group()
    subscription = session.node.subscribe(topic, kind, received.append, _subscriber_qos(1), group)
    try:
        group.spin_once(within)
    finally:
        subscription.close()
    reply = Writer().flag(bool(received)).done()
    return reply + to_cdr(received[0]) if received else reply


def _timeout(timeout: Ns) -> Ns | None:
    """Return a time-out of roscpp, of which a negative one means none."""
    return None if timeout < 0 else timeout


# -- services


def _serve(session: Session, arguments: Reader) -> int:
    name, request_type, callback = arguments.text(), arguments.text(), arguments.integer()
    kind = service(request_type.removesuffix("_Request"))

    def handler(request: Any) -> Any:
        result = Reader(session.call_back(callback, to_cdr(request)))
        if not result.flag():
            raise RefusedRequestError(name, "its handler returned false")
        return from_cdr(kind.response.__msgtype__, result.raw())

    return session.keep(session.node.serve(name, kind.name, handler))


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
    return session.node.wait_for_service(arguments.text(), _timeout(arguments.integer()))


# -- timers


class _Timer:
    """A ``ros::Timer``, which calls the callable numbered *callback* each *period*, or once."""

    def __init__(self, session: Session, period: Ns, callback: int, *, oneshot: bool) -> None:
        if period <= 0:
            raise UsageError(
                f"{session.component}: a ros::Timer with a period of {period} ns; it must be above 0"
            )
        self._session = session
        self._period = period
        self._callback = callback
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
            self._timer = self._session.node.timer(self._period, self._fire)

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
    timer = _Timer(session, period, arguments.integer(), oneshot=oneshot)
    if autostart:
        timer.start()
    return session.keep(timer)


def _find_timer(session: Session, arguments: Reader) -> _Timer:
    return session.find(arguments.integer(), _Timer)


SIMPLE: dict[str, Callable[[Session, Reader], Any]] = {
    "advertise": lambda session, arguments: session.keep(_Publisher(session, arguments)),
    "publish": _publish,
    "subscribers": lambda session, arguments: session.find(
        arguments.integer(), _Publisher
    ).made.subscribers(),
    "subscribe": _subscribe,
    "publishers": _publisher_count,
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

WITH_FIBER: dict[str, Callable[[Session, CppFiber, Reader], Any]] = {
    "spin_once": lambda session, fiber, arguments: session.spin(fiber, session.node.spin_available),
    "spin": lambda session, fiber, arguments: session.spin(fiber, session.node.spin),
}
