"""Services: a client blocks while the server's own task answers."""

from __future__ import annotations

from functools import partial
from typing import Any

from volery.base.errors import UsageError, VoleryError, choices, did_you_mean
from volery.base.time import Ns, to_seconds
from volery.kernel.waiting import Signal
from volery.ros.graph.callbacks import CallbackGroup, Work
from volery.ros.graph.graph_context import NodeContext
from volery.ros.graph.interface import Handler
from volery.ros.messages import cdr_size, service
from volery.trace.events import Call


class ServiceError(VoleryError):
    """A service call did not succeed: nobody serves it, its handler failed, or no answer came in time."""

    def __init__(self, name: str, what: str) -> None:
        self.service, self.what = name, what
        super().__init__(f"service {name}: {what}")


class Exchange:
    """A request on its way there and the answer on its way back."""

    __slots__ = ("answer", "answered", "caller", "problem", "request")

    def __init__(self, caller: NodeContext, request: Any, name: str) -> None:
        self.caller, self.request = caller, request
        self.answer: Any = None
        self.problem = ""
        self.answered = Signal(caller.context.kernel, f"service {name} (answer)")

    def done(self) -> bool:
        """Whether it has ended, one way or the other."""
        return self.answer is not None or bool(self.problem)

    def succeed(self, answer: Any) -> None:
        """The answer is there. House code."""
        self.answer = answer
        self.answered.notify()

    def fail(self, problem: str) -> None:
        """It will not be answered. House code."""
        self.problem = self.problem or problem
        self.answered.notify()


class EmbeddedService:
    """See ``volery.ros.graph.interface.Service``."""

    member: NodeContext

    def __init__(
        self, member: NodeContext, name: str, service_type: str, handler: Handler, group: CallbackGroup
    ) -> None:
        kind = service(service_type)
        other = member.context.services.get(name)
        if other is not None:
            raise UsageError(f"node {member.name}: service {name} is served by {other.member.name} already")
        self.member = member
        self.name, self.type = name, kind.name
        self._kind = kind
        self._handler, self._group = handler, group
        self._pending: list[Exchange] = []
        member.context.services[name] = self

    def arrive(self, exchange: Exchange) -> None:
        """A request is there. House code."""
        if self.member.context.services.get(self.name) is not self:
            self._send_back(exchange, exchange.fail, "its server has gone", 0)
            return
        self._pending.append(exchange)
        self._group.add(Work(self.member.context.kernel.now(), partial(self.answer, exchange)))

    def answer(self, exchange: Exchange) -> None:
        """Have the handler answer. What it raises goes to the caller in words, and comes out here."""
        if exchange not in self._pending:
            return
        try:
            answer = self._handler(exchange.request)
            if not isinstance(answer, self._kind.response):
                raise UsageError(
                    f"the handler of {self.name} returned {answer!r}, not a {self.type} response"
                )
        except Exception as error:
            with self.member.context.kernel:
                self._pending.remove(exchange)
                self._send_back(
                    exchange, exchange.fail, f"its handler raised {type(error).__name__}: {error}", 0
                )
            raise
        with self.member.context.kernel:
            self._pending.remove(exchange)
            content = self.member.context.sent(answer)
            self._send_back(exchange, exchange.succeed, content, cdr_size(content))

    def _send_back(self, exchange: Exchange, end: Any, content: Any, size: int) -> None:
        lost = partial(exchange.fail, "the answer was lost on the way")
        self.member.context.bring(self.member, exchange.caller, size, partial(end, content), lost)

    def close(self) -> None:
        """Answer no longer; who waits is told."""
        context = self.member.context
        with context.kernel.guard:
            if context.services.get(self.name) is self:
                del context.services[self.name]
                for exchange in self._pending:
                    exchange.fail("its server has gone")
                self._pending.clear()
                context.changed.notify()


class EmbeddedClient:
    """See ``volery.ros.graph.interface.Client``. Waiting for the answer belongs to the caller's activation."""

    def __init__(self, member: NodeContext, name: str, service_type: str) -> None:
        self._kind = service(service_type)
        self.name, self.type = name, self._kind.name
        self._member = member

    def call(self, request: Any, within: Ns | None = None) -> Any:
        """Block until the answer is there; ``ServiceError`` if none comes."""
        context = self._member.context
        with context.kernel as kernel:
            start = kernel.now()
            server = self._server(request)
            exchange = Exchange(self._member, context.sent(request), self.name)
            context.bring(
                self._member,
                server.member,
                cdr_size(exchange.request),
                partial(server.arrive, exchange),
                partial(exchange.fail, "the request was lost on the way"),
            )
            if not exchange.answered.wait_for(exchange.done, within):
                exchange.fail(f"no answer within {to_seconds(within or 0):g} s")
            callee, caller = server.member.id.component, self._member.id.component
            outcome = "ServiceError" if exchange.problem else "ok"
            kernel.record(Call(start, kernel.now(), caller, callee, self.name, outcome))
        if exchange.problem:
            raise ServiceError(self.name, exchange.problem)
        return exchange.answer

    def _server(self, request: Any) -> EmbeddedService:
        if not isinstance(request, self._kind.request):
            raise UsageError(f"service {self.name} takes a {self._kind.request.__msgtype__}, not {request!r}")
        services = self._member.context.services
        server = services.get(self.name)
        if server is None:
            hint = did_you_mean(self.name, services)
            raise ServiceError(self.name, f"nobody serves it{hint}; there is {choices(services)}")
        if server.type != self.type:
            raise ServiceError(self.name, f"{server.member.name} serves it as {server.type}, not {self.type}")
        return server

    def wait(self, within: Ns | None = None) -> bool:
        """Block until somebody serves it."""
        return self._member.context.changed.wait_for(self.ready_now, within)

    def ready(self) -> bool:
        """Whether somebody serves it now."""
        with self._member.context.kernel:
            return self.ready_now()

    def ready_now(self) -> bool:
        """``ready`` without being an interaction point."""
        return self.name in self._member.context.services
