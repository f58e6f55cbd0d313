"""A ``ros::Timer``: calls back while the node spins.

Topics, services, timers and spinning, as code written for roscpp asks for them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.ros.client_libraries.abi_codec import CppFiber, Reader, Writer
from volery.ros.client_libraries.roscpp.session import RefusedRequestError, Session
from volery.ros.graph import BEST_AVAILABLE, LATCHED, Client, QoS, ServiceError, Timer
from volery.ros.messages import from_cdr, service, to_cdr


class CppTimer:
    """Calls the callable numbered *callback* each *period*, or once."""

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
        self._last: tuple[Ns, Ns] = (0, 0)  # when the last call was expected, and when it was
        self._took: Ns = 0

    @property
    def started(self) -> bool:
        """Whether it will call back."""
        return self._timer is not None

    def start(self) -> None:
        """Call back, for the first time after one period. Nothing changes if it does already."""
        if self._timer is None:
            self._expected = self._session.now() + self._period
            self._timer = self._session.node.timer(self._period, self._fire)

    def close(self) -> None:
        """Call back no longer."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def change(self, period: Ns) -> None:
        """Another period, counted from now."""
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


def _listening(depth: int) -> QoS:
    """ROS 1 knows no QoS: a subscriber takes what is offered."""
    return QoS(depth or None, BEST_AVAILABLE, BEST_AVAILABLE)


class _Publisher:
    """A publisher of messages that come as bytes."""

    def __init__(self, session: Session, asked: Reader) -> None:
        topic, self._type = asked.text(), asked.text()
        depth, latched = asked.integer(), asked.flag()
        qos = LATCHED if latched else QoS(depth or None)
        self.made = session.node.advertise(topic, self._type, qos)
        self.close = self.made.close

    def publish(self, data: bytes) -> None:
        """Send the message that these bytes are."""
        self.made.publish(from_cdr(self._type, data))


def _publish(session: Session, asked: Reader) -> None:
    session.find(asked.integer(), _Publisher).publish(asked.raw())


def _subscribers(session: Session, asked: Reader) -> int:
    return session.find(asked.integer(), _Publisher).made.subscribers()


def _subscribe(session: Session, asked: Reader) -> int:
    topic, kind, depth, callback = asked.text(), asked.text(), asked.integer(), asked.integer()

    def received(message: Any) -> None:
        session.call_back(callback, to_cdr(message))

    return session.keep(session.node.subscribe(topic, kind, received, _listening(depth)))


def _publishers(session: Session, asked: Reader) -> int:
    count: int = session.thing(asked.integer()).publishers()
    return count


def _wait_for_message(session: Session, asked: Reader) -> bytes:
    topic, kind, within = asked.text(), asked.text(), _within(asked.integer())
    received: list[Any] = []
    group = session.node.group()
    subscription = session.node.subscribe(topic, kind, received.append, _listening(1), group)
    try:
        group.spin_once(within)
    finally:
        subscription.close()
    written = Writer().flag(bool(received))
    return written.done() + to_cdr(received[0]) if received else written.done()


def _within(timeout: Ns) -> Ns | None:
    """roscpp's time-outs: what is below zero is for ever."""
    return None if timeout < 0 else timeout


# -- services


def _serve(session: Session, asked: Reader) -> int:
    name, request, callback = asked.text(), asked.text(), asked.integer()
    kind = service(request.removesuffix("_Request"))

    def handler(wanted: Any) -> Any:
        said = Reader(session.call_back(callback, to_cdr(wanted)))
        if not said.flag():
            raise RefusedRequestError(name, "its handler returned false")
        return from_cdr(kind.response.__msgtype__, said.raw())

    return session.keep(session.node.serve(name, kind.name, handler))


class _Client:
    """A client of requests that come as bytes."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._request = service(client.type).request.__msgtype__

    def call(self, data: bytes) -> bytes | None:
        """The answer's bytes; ``None`` if there is none."""
        try:
            return to_cdr(self._client.call(from_cdr(self._request, data)))
        except ServiceError:
            return None


def _make_client(session: Session, asked: Reader) -> int:
    return session.keep(_Client(session.node.client(asked.text(), asked.text())))


def _call(session: Session, asked: Reader) -> bytes:
    answer = session.find(asked.integer(), _Client).call(asked.raw())
    return Writer().flag(answer is not None).done() + (answer or b"")


def _wait_for_service(session: Session, asked: Reader) -> bool:
    return session.node.wait_for_service(asked.text(), _within(asked.integer()))


# -- timers and spinning


def _timer(session: Session, asked: Reader) -> int:
    period, oneshot, autostart, callback = asked.integer(), asked.flag(), asked.flag(), asked.integer()
    timer = CppTimer(session, period, callback, oneshot=oneshot)
    if autostart:
        timer.start()
    return session.keep(timer)


def _find_timer(session: Session, asked: Reader) -> CppTimer:
    return session.find(asked.integer(), CppTimer)


def _spin_once(session: Session, flow: CppFiber, asked: Reader) -> None:
    session.spin(flow, session.node.spin_available)


def _spin(session: Session, flow: CppFiber, asked: Reader) -> None:
    session.spin(flow, session.node.spin)


SIMPLE: dict[str, Callable[[Session, Reader], Any]] = {
    "advertise": lambda session, asked: session.keep(_Publisher(session, asked)),
    "publish": _publish,
    "subscribers": _subscribers,
    "subscribe": _subscribe,
    "publishers": _publishers,
    "wait_for_message": _wait_for_message,
    "serve": _serve,
    "client": _make_client,
    "call": _call,
    "wait_for_service": _wait_for_service,
    "timer": _timer,
    "timer_start": lambda session, asked: _find_timer(session, asked).start(),
    "timer_stop": lambda session, asked: _find_timer(session, asked).close(),
    "timer_started": lambda session, asked: _find_timer(session, asked).started,
    "timer_period": lambda session, asked: _find_timer(session, asked).change(asked.integer()),
}

WITH_FLOW: dict[str, Callable[[Session, CppFiber, Reader], Any]] = {
    "spin_once": _spin_once,
    "spin": _spin,
}
