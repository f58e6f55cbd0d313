"""Values of parameters on their way over the border: a letter for the kind, then the value.

What code written for roscpp asks, done on the graph.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.ros.client_libraries.abi_codec import CppFiber, Reader, RequestHandler, Writer
from volery.ros.client_libraries.roscpp.connection_requests import SIMPLE, WITH_FLOW
from volery.ros.client_libraries.roscpp.session import Session
from volery.trace.events import Text


def write_parameter(writer: Writer, value: Any) -> None:
    """Append *value*; what C++ has no kind for is written as its text."""
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
    """The next value."""
    kind = reader.text()
    if kind == "l":
        return [read_parameter(reader) for _ in range(reader.integer())]
    if kind == "m":
        return {reader.text(): read_parameter(reader) for _ in range(reader.integer())}
    return {"b": reader.flag, "i": reader.integer, "d": reader.real, "s": reader.text}[kind]()


def names_below(tree: Any, prefix: str = "") -> list[str]:
    """The absolute names of all parameters in a tree, sorted."""
    return sorted(_leaves(tree, prefix))


def _leaves(tree: Any, prefix: str) -> Iterable[str]:
    if not isinstance(tree, dict):
        yield prefix
        return
    for name, inner in tree.items():
        yield from _leaves(inner, f"{prefix}/{name}")


_SEVERITIES = (7, 6, 4, 3, 2)
"""Of syslog, by roscpp's levels: debug, info, warn, error, fatal."""

Simple = Callable[[Session, Reader], Any]
"""Does something for a session; what it returns is a truth, a number, a text or nothing."""


def request_handlers(session: Session) -> dict[str, RequestHandler]:
    """The answers to the component that *session* belongs to."""
    simple = {**_PROCESS, **_NAMES, **_TIME, **_PARAMETERS, **SIMPLE}
    found: dict[str, RequestHandler] = {name: _plain(session, what) for name, what in simple.items()}
    found.update({name: _with_flow(session, what) for name, what in WITH_FLOW.items()})
    return {f"ros.{name}": answer for name, answer in found.items()}


def _plain(session: Session, what: Simple) -> RequestHandler:
    def answer(flow: CppFiber, asked: Reader) -> bytes:
        return _written(what(session, asked))

    return answer


def _with_flow(session: Session, what: Callable[[Session, CppFiber, Reader], Any]) -> RequestHandler:
    def answer(flow: CppFiber, asked: Reader) -> bytes:
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
        write_parameter(written, value)
    return written.done()


def _param_set(session: Session, asked: Reader) -> None:
    session.node.set_parameter(asked.text(), read_parameter(asked))


def _param_delete(session: Session, asked: Reader) -> bool:
    name = asked.text()
    there = session.node.has_parameter(name)
    if there:
        session.node.delete_parameter(name)
    return there


def _param_names(session: Session, asked: Reader) -> bytes:
    names = names_below(session.node.get_parameter("/", {}))
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
