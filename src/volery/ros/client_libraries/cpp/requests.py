"""Handlers of the requests that the client libraries in C++ share: publishing, tasks, time and log."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.kernel.waiting import Rate, sleep
from volery.ros.client_libraries.abi_codec import CppFiber, Reader, RequestHandler, Writer
from volery.ros.client_libraries.cpp.session import CppSession
from volery.ros.client_libraries.cpp.transforms import TRANSFORMS
from volery.ros.graph import Publisher
from volery.ros.graph.endpoints import Connection, EmbeddedPublisher
from volery.ros.messages import from_cdr
from volery.trace.events import Text

_Session = TypeVar("_Session", bound=CppSession)

Simple = Callable[[_Session, Reader], Any]
"""Executes a request; returns a boolean, an integer, a text, bytes or nothing."""

WithFiber = Callable[[_Session, CppFiber, Reader], Any]
"""The same for requests that run code on the stack of the fiber."""


def request_handlers(
    session: _Session,
    simple: Mapping[str, Simple[_Session]],
    with_fiber: Mapping[str, WithFiber[_Session]],
) -> dict[str, RequestHandler]:
    """Return handlers by name: those that are shared, and those of one library.

    Args:
        session: What the handlers belong to.
        simple: Handlers of the library.
        with_fiber: Handlers of the library that run code on the stack of the fiber.
    """

    def handler(handle: Simple[_Session]) -> RequestHandler:
        return lambda fiber, arguments: _encoded(handle(session, arguments))

    def handler_with_fiber(handle: WithFiber[_Session]) -> RequestHandler:
        return lambda fiber, arguments: _encoded(handle(session, fiber, arguments))

    handlers = {name: handler(one) for name, one in {**_SHARED, **TRANSFORMS, **simple}.items()}
    handlers.update({name: handler_with_fiber(one) for name, one in {"spawn": _spawn, **with_fiber}.items()})
    return {f"ros.{name}": handler for name, handler in handlers.items()}


def _encoded(value: bytes | str | int | None) -> bytes:
    if value is None:
        return b""
    if isinstance(value, bytes):
        return value
    return Writer().text(value).done() if isinstance(value, str) else Writer().integer(value).done()


# -- topics


class CdrPublisher:
    """Publishes messages that are given in CDR."""

    def __init__(self, made: Publisher, kind: str) -> None:
        self.made, self._type = made, kind
        self.close = made.close

    def publish(self, data: bytes) -> None:
        """Publish the message that *data* encodes."""
        self.made.publish(from_cdr(self._type, data))

    def publish_to(self, connection: Connection, data: bytes) -> None:
        """Publish to one subscription."""
        assert isinstance(self.made, EmbeddedPublisher)
        self.made.publish_to(connection, from_cdr(self._type, data))


def _publish(session: CppSession, arguments: Reader) -> None:
    session.find(arguments.integer(), CdrPublisher).publish(arguments.raw())


def _subscriber_count(session: CppSession, arguments: Reader) -> int:
    return session.find(arguments.integer(), CdrPublisher).made.subscribers()


def _publisher_count(session: CppSession, arguments: Reader) -> int:
    count: int = session.entity(arguments.integer()).publishers()
    return count


# -- tasks beside the one of main()


def time_out(timeout: Ns) -> Ns | None:
    """Return a time-out of the code, of which a negative one means none."""
    return None if timeout < 0 else timeout


def _spawn(session: CppSession, fiber: CppFiber, arguments: Reader) -> None:
    number, label = arguments.integer(), arguments.text()
    session.spawn(lambda: fiber.call_beside(number), label)


class _Event:
    """Wakes tasks that wait until another one has changed something."""

    def __init__(self, session: CppSession) -> None:
        self._session = session
        self._count = 0

    def notify(self) -> None:
        """Wake those who wait."""
        self._count += 1
        self._session.changed.notify()

    def wait(self, seen: int, timeout: Ns, until_end: bool) -> None:
        """Block until more than *seen* notifications, the time-out, or *until_end* the end of the node."""
        session = self._session
        session.changed.wait_for(
            lambda: self._count > seen or (until_end and session.finished),
            time_out(timeout),
            ends_activation=True,
        )


def _wait_for_event(session: CppSession, arguments: Reader) -> None:
    event = session.find(arguments.integer(), _Event)
    event.wait(arguments.integer(), arguments.integer(), arguments.flag())


# -- time


class _Rate:
    """Keeps a loop at a period and measures the execution time of each cycle."""

    def __init__(self, session: CppSession, period: Ns) -> None:
        if period <= 0:
            raise UsageError(f"{session.component}: a rate with a period of {period} ns; give one above 0")
        self._session = session
        self._rate = session.node.rate(period) if session.opened else Rate(session.kernel, period)
        self._began = session.now()

    def sleep(self) -> Ns:
        """Block until the next release; return the duration of the cycle in ns."""
        took = self._session.now() - self._began
        self._rate.sleep()
        self._began = self._session.now()
        return took


def _sleep(session: CppSession, arguments: Reader) -> None:
    """Sleep; without a node there is nothing that the call is charged to."""
    if session.opened is None:
        sleep(session.kernel, arguments.integer())
    else:
        session.opened.sleep(arguments.integer())


# -- log

_SEVERITIES = (7, 6, 4, 3, 2)
"""Severities of syslog by the levels of ROS: debug, info, warn, error, fatal."""


def _log(session: CppSession, arguments: Reader) -> None:
    severity, text = _SEVERITIES[arguments.integer()], arguments.text()
    kernel = session.kernel
    with kernel.interact():
        kernel.record(Text(kernel.now(), session.component, severity, text))


_SHARED: dict[str, Simple[Any]] = {
    "publish": _publish,
    "subscribers": _subscriber_count,
    "publishers": _publisher_count,
    "close": lambda session, arguments: session.close(arguments.integer()),
    "event": lambda session, arguments: session.keep(_Event(session)),
    "event_notify": lambda session, arguments: session.find(arguments.integer(), _Event).notify(),
    "event_wait": _wait_for_event,
    "now": lambda session, arguments: session.now(),
    "sleep": _sleep,
    "rate": lambda session, arguments: session.keep(_Rate(session, arguments.integer())),
    "rate_sleep": lambda session, arguments: session.find(arguments.integer(), _Rate).sleep(),
    "shutdown": lambda session, arguments: session.end(),
    "log": _log,
}
