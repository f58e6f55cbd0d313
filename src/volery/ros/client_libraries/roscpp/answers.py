"""What code written for roscpp asks, done on the graph."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.ros.client_libraries.roscpp import calls, values
from volery.ros.client_libraries.roscpp.session import Session
from volery.ros.client_libraries.wire import Answer, CppFlow, Reader, Writer
from volery.trace.events import Text

_SEVERITIES = (7, 6, 4, 3, 2)
"""Of syslog, by roscpp's levels: debug, info, warn, error, fatal."""

Simple = Callable[[Session, Reader], Any]
"""Does something for a session; what it returns is a truth, a number, a text or nothing."""


def answers(session: Session) -> dict[str, Answer]:
    """The answers to the component that *session* belongs to."""
    simple = {**_PROCESS, **_NAMES, **_TIME, **_PARAMETERS, **calls.SIMPLE}
    found: dict[str, Answer] = {name: _plain(session, what) for name, what in simple.items()}
    found.update({name: _with_flow(session, what) for name, what in calls.WITH_FLOW.items()})
    return {f"ros.{name}": answer for name, answer in found.items()}


def _plain(session: Session, what: Simple) -> Answer:
    def answer(flow: CppFlow, asked: Reader) -> bytes:
        return _written(what(session, asked))

    return answer


def _with_flow(session: Session, what: Callable[[Session, CppFlow, Reader], Any]) -> Answer:
    def answer(flow: CppFlow, asked: Reader) -> bytes:
        return _written(what(session, flow, asked))

    return answer


def _written(value: bytes | str | int | None) -> bytes:
    if value is None:
        return b""
    if isinstance(value, bytes):
        return value
    return Writer().text(value).done() if isinstance(value, str) else Writer().integer(value).done()


# -- the process


def _init(session: Session, asked: Reader) -> None:
    session.join(asked.text(), anonymous=asked.flag())


def _log(session: Session, asked: Reader) -> None:
    severity, text = _SEVERITIES[asked.integer()], asked.text()
    with session.kernel as kernel:
        kernel.record(Text(kernel.now(), session.component, severity, text))


_PROCESS: dict[str, Simple] = {
    "init": _init,
    "initialized": lambda session, asked: session.opened is not None,
    "ok": lambda session, asked: session.ok(),
    "shutdown": lambda session, asked: session.end(),
    "wait_for_shutdown": lambda session, asked: session.wait_for_end(),
    "close": lambda session, asked: session.close(asked.integer()),
    "log": _log,
}


# -- names


def _resolve(session: Session, asked: Reader) -> str:
    namespace, name = asked.text(), asked.text()
    if namespace and not name.startswith(("/", "~")):
        name = f"{namespace.rstrip('/')}/{name}"
    return session.node.resolve(name)


def _node_handle(session: Session, asked: Reader) -> str:
    """The namespace of a handle in that of another, as an absolute name."""
    node, parent, namespace = session.node, asked.text() or session.node.namespace, asked.text()
    if namespace.startswith("~"):
        inner = namespace[1:].strip("/")
        return f"{node.name}/{inner}" if inner else node.name
    if namespace.startswith("/"):
        return namespace
    return f"{parent.rstrip('/')}/{namespace}".rstrip("/") or "/"


_NAMES: dict[str, Simple] = {
    "resolve": _resolve,
    "node_handle": _node_handle,
    "name": lambda session, asked: session.node.name,
    "namespace": lambda session, asked: session.node.namespace,
}


# -- time


def _sleep(session: Session, asked: Reader) -> None:
    session.node.sleep(asked.integer())


class _Rate:
    """A loop's rate, and when its present cycle began."""

    def __init__(self, session: Session, period: Ns) -> None:
        if period <= 0:
            raise UsageError(f"{session.component}: ros::Rate with a period of {period} ns; give one above 0")
        self._session = session
        self._rate = session.node.rate(period)
        self._began = session.now()

    def sleep(self) -> Ns:
        """Block until the next release; returns how long the cycle computed."""
        took = self._session.now() - self._began
        self._rate.sleep()
        self._began = self._session.now()
        return took


_TIME: dict[str, Simple] = {
    "now": lambda session, asked: session.now(),
    "sleep": _sleep,
    "rate": lambda session, asked: session.keep(_Rate(session, asked.integer())),
    "rate_sleep": lambda session, asked: session.find(asked.integer(), _Rate).sleep(),
}


# -- parameters


def _param_get(session: Session, asked: Reader) -> bytes:
    name, missing = asked.text(), object()
    value = session.node.get_parameter(name, missing)
    written = Writer().flag(value is not missing)
    if value is not missing:
        values.write(written, value)
    return written.done()


def _param_set(session: Session, asked: Reader) -> None:
    session.node.set_parameter(asked.text(), values.read(asked))


def _param_delete(session: Session, asked: Reader) -> bool:
    name = asked.text()
    there = session.node.has_parameter(name)
    if there:
        session.node.delete_parameter(name)
    return there


def _param_names(session: Session, asked: Reader) -> bytes:
    names = values.names_below(session.node.get_parameter("/", {}))
    written = Writer().integer(len(names))
    for name in names:
        written.text(name)
    return written.done()


_PARAMETERS: dict[str, Simple] = {
    "param_get": _param_get,
    "param_set": _param_set,
    "param_has": lambda session, asked: session.node.has_parameter(asked.text()),
    "param_delete": _param_delete,
    "param_names": _param_names,
}
