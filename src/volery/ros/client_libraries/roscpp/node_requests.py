"""Requests about the process, names, time and parameters; the table of the handlers of all requests."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.ros.client_libraries.abi_codec import CppFiber, Reader, RequestHandler, Writer
from volery.ros.client_libraries.roscpp.connection_requests import SIMPLE, WITH_FIBER
from volery.ros.client_libraries.roscpp.session import Session
from volery.trace.events import Text

_SEVERITIES = (7, 6, 4, 3, 2)
"""Severities of syslog by roscpp's levels: debug, info, warn, error, fatal."""

Simple = Callable[[Session, Reader], Any]
"""Executes a request; returns a boolean, an integer, a text, bytes or nothing."""


def request_handlers(session: Session) -> dict[str, RequestHandler]:
    """Return the handlers of all requests of the component that *session* belongs to, by name."""

    def simple(handle: Simple) -> RequestHandler:
        return lambda fiber, arguments: _encoded(handle(session, arguments))

    def with_fiber(handle: Callable[[Session, CppFiber, Reader], Any]) -> RequestHandler:
        return lambda fiber, arguments: _encoded(handle(session, fiber, arguments))

    handlers = {name: simple(one) for name, one in {**_PROCESS, **_NAMES, **_TIME, **_PARAMETERS}.items()}
    handlers.update({name: simple(one) for name, one in SIMPLE.items()})
    handlers.update({name: with_fiber(one) for name, one in WITH_FIBER.items()})
    return {f"ros.{name}": handler for name, handler in handlers.items()}


def _encoded(value: bytes | str | int | None) -> bytes:
    if value is None:
        return b""
    if isinstance(value, bytes):
        return value
    return Writer().text(value).done() if isinstance(value, str) else Writer().integer(value).done()


# -- the process


def _init(session: Session, arguments: Reader) -> None:
    session.join(arguments.text(), anonymous=arguments.flag())


def _log(session: Session, arguments: Reader) -> None:
    severity, text = _SEVERITIES[arguments.integer()], arguments.text()
    with session.kernel as kernel:
        kernel.record(Text(kernel.now(), session.component, severity, text))


_PROCESS: dict[str, Simple] = {
    "init": _init,
    "initialized": lambda session, arguments: session.opened is not None,
    "ok": lambda session, arguments: session.ok(),
    "shutdown": lambda session, arguments: session.end(),
    "wait_for_shutdown": lambda session, arguments: session.wait_for_end(),
    "close": lambda session, arguments: session.close(arguments.integer()),
    "log": _log,
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


_NAMES: dict[str, Simple] = {
    "resolve": _resolve,
    "node_handle": _node_handle,
    "name": lambda session, arguments: session.node.name,
    "namespace": lambda session, arguments: session.node.namespace,
}


# -- time


class _Rate:
    """A ``ros::Rate``, which measures the execution time of each cycle."""

    def __init__(self, session: Session, period: Ns) -> None:
        if period <= 0:
            raise UsageError(f"{session.component}: ros::Rate with a period of {period} ns; give one above 0")
        self._session = session
        self._rate = session.node.rate(period)
        self._began = session.now()

    def sleep(self) -> Ns:
        """Block until the next release; return the duration of the cycle in ns."""
        took = self._session.now() - self._began
        self._rate.sleep()
        self._began = self._session.now()
        return took


_TIME: dict[str, Simple] = {
    "now": lambda session, arguments: session.now(),
    "sleep": lambda session, arguments: session.node.sleep(arguments.integer()),
    "rate": lambda session, arguments: session.keep(_Rate(session, arguments.integer())),
    "rate_sleep": lambda session, arguments: session.find(arguments.integer(), _Rate).sleep(),
}


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
    names = sorted(_leaf_names(session.node.get_parameter("/", {})))
    reply = Writer().integer(len(names))
    for name in names:
        reply.text(name)
    return reply.done()


_PARAMETERS: dict[str, Simple] = {
    "param_get": _get_parameter,
    "param_set": _set_parameter,
    "param_has": lambda session, arguments: session.node.has_parameter(arguments.text()),
    "param_delete": _delete_parameter,
    "param_names": _parameter_names,
}
