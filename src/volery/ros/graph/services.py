"""Services of the embedded graph: a client blocks while the server's own task answers."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from volery.base.errors import UsageError, VoleryError, choices, did_you_mean
from volery.base.time import Ns, to_seconds
from volery.kernel.waiting import Signal
from volery.ros.graph.callbacks import CallbackGroup
from volery.ros.graph.graph_context import NodeContext, ServiceEnd
from volery.ros.graph.interface import Handler, Work
from volery.ros.messages import cdr_size, service
from volery.trace.events import Call

HANDLER_FAILED = "its handler "
"""Beginning of the problem of a call that the server has failed."""
ROSPY_FAILED = "responded with an error"
"""Part of the same problem in the words of rospy's client."""


class CallFailedError(Exception):
    """Raised by a handler to fail the call, as a handler of roscpp that returns false; nothing else fails."""


class ServiceError(VoleryError):
    """A service call failed: there is no server, its handler raised, or no answer came in time.

    Attributes:
        service: Name of the service.
        what: What happened.
        by_server: Whether the server itself has ended the call with an error.
    """

    def __init__(self, name: str, what: str) -> None:
        self.service, self.what = name, what
        self.by_server = what.startswith(HANDLER_FAILED) or ROSPY_FAILED in what
        super().__init__(f"service {name}: {what}")


def failure_text(error: Exception) -> str:
    """Return the problem of a call whose handler has raised *error*."""
    if isinstance(error, CallFailedError):
        return f"{HANDLER_FAILED}failed the call: {error}"
    return f"{HANDLER_FAILED}raised {type(error).__name__}: {error}"


class Exchange:
    """A request and its answer, in transit."""

    __slots__ = ("answer", "answered", "caller", "problem", "request")

    def __init__(self, caller: NodeContext, request: Any, name: str) -> None:
        self.caller, self.request = caller, request
        self.answer: Any = None
        self.problem = ""
        self.answered = Signal(caller.kernel, f"service {name} (answer)")

    def done(self) -> bool:
        """Return whether the call has ended, with an answer or a problem."""
        return self.answer is not None or bool(self.problem)

    def succeed(self, answer: Any) -> None:
        """End the call with an answer. A framework callback."""
        self.answer = answer
        self.answered.notify()

    def fail(self, problem: str) -> None:
        """End the call without an answer. A framework callback."""
        self.problem = self.problem or problem
        self.answered.notify()


class EmbeddedService:
    """See ``volery.ros.graph.interface.Service``."""

    def __init__(
        self, node: NodeContext, name: str, service_type: str, handler: Handler, group: CallbackGroup
    ) -> None:
        kind = service(service_type)
        other = node.graph.services.get(name)
        if other is not None:
            raise UsageError(f"node {node.name}: service {name} is served by {other.node.name} already")
        self.node = node
        self.name, self.type = name, kind.name
        self._kind = kind
        self._handler, self._group = handler, group
        self._pending: list[Exchange] = []
        node.graph.services[name] = self

    def arrive(self, exchange: Exchange) -> None:
        """Queue a request that has arrived. A framework callback."""
        if self.node.graph.services.get(self.name) is not self:
            self._send_back(exchange, exchange.fail, "its server has gone", 0)
            return
        self._pending.append(exchange)
        self._group.add(Work(self.node.kernel.now(), partial(self.answer, exchange)))

    def answer(self, exchange: Exchange) -> None:
        """Run the handler and send the answer; an exception is reported to the caller and raised again."""
        if exchange not in self._pending:
            return
        with self.node.kernel:
            self.node.consume_if_priced("serve")
        try:
            answer = self._handler(exchange.request)
            if not isinstance(answer, self._kind.response):
                raise UsageError(
                    f"the handler of {self.name} returned {answer!r}, not a {self.type} response"
                )
        except Exception as error:
            with self.node.kernel:
                self._pending.remove(exchange)
                self._send_back(exchange, exchange.fail, failure_text(error), 0)
            if not isinstance(error, CallFailedError):
                raise
            return
        with self.node.kernel:
            self._pending.remove(exchange)
            content = self.node.graph.copy(answer)
            self._send_back(exchange, exchange.succeed, content, cdr_size(content))

    def _send_back(self, exchange: Exchange, end: Callable[[Any], None], content: Any, size: int) -> None:
        lost = partial(exchange.fail, "the answer was lost on the way")
        self.node.graph.carry(self.node, exchange.caller, size, partial(end, content), lost)

    def close(self) -> None:
        """Stop serving; pending calls fail."""
        graph = self.node.graph
        with graph.kernel.guard:
            if graph.services.get(self.name) is self:
                del graph.services[self.name]
                for exchange in self._pending:
                    exchange.fail("its server has gone")
                self._pending.clear()
                graph.changed.notify()


class EmbeddedClient:
    """See ``interface.Client``. The wait for the answer belongs to the caller's activation."""

    def __init__(self, node: NodeContext, name: str, service_type: str) -> None:
        self.name = name
        self._kind = service(service_type)
        self.type = self._kind.name
        self._node = node

    def call(self, request: Any, within: Ns | None = None) -> Any:
        """Block until the answer has arrived; raise ``ServiceError`` if there is none."""
        node = self._node
        with node.kernel as kernel:
            start = kernel.now()
            server = self._server(request)
            node.consume_if_priced("call_service")
            exchange = Exchange(node, node.graph.copy(request), self.name)
            node.graph.carry(
                node,
                server.node,
                cdr_size(exchange.request),
                partial(server.arrive, exchange),
                partial(exchange.fail, "the request was lost on the way"),
            )
            if not exchange.answered.wait_for(exchange.done, within):
                exchange.fail(f"no answer within {to_seconds(within or 0):g} s")
            callee, caller = server.node.id.component, node.id.component
            outcome = "ServiceError" if exchange.problem else "ok"
            kernel.record(Call(start, kernel.now(), caller, callee, self.name, outcome))
        if exchange.problem:
            raise ServiceError(self.name, exchange.problem)
        return exchange.answer

    def _server(self, request: Any) -> ServiceEnd:
        if not isinstance(request, self._kind.request):
            raise UsageError(f"service {self.name} takes a {self._kind.request.__msgtype__}, not {request!r}")
        services = self._node.graph.services
        server = services.get(self.name)
        if server is None:
            hint = did_you_mean(self.name, services)
            raise ServiceError(self.name, f"no node serves it{hint}; there is {choices(services)}")
        if server.type != self.type:
            raise ServiceError(self.name, f"{server.node.name} serves it as {server.type}, not {self.type}")
        return server

    def wait(self, within: Ns | None = None) -> bool:
        """Block until a node serves it; return False if `within` ns have passed first."""
        return self._node.graph.changed.wait_for(self.ready_now, within)

    def ready(self) -> bool:
        """Return whether a node serves it now."""
        with self._node.kernel:
            return self.ready_now()

    def ready_now(self) -> bool:
        """Return whether a node serves it now, without being an interaction point."""
        return self.name in self._node.graph.services
