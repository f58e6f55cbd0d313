"""Services and clients of a transport."""

from __future__ import annotations

from functools import partial
from typing import Any

from volery.base.errors import UsageError
from volery.base.time import Ns, to_seconds
from volery.kernel.waiting import Signal
from volery.ros.graph.context import Member
from volery.ros.graph.group import CallbackGroup, Work
from volery.ros.graph.node import Handler
from volery.ros.graph.services import ServiceError
from volery.ros.messages import Message, ServiceType
from volery.ros.transports.abroad import abroad, until
from volery.ros.transports.wire import Caller, Done, Served
from volery.trace.events import Call


class TransportService:
    """See ``volery.ros.graph.node.Service``."""

    served: Served

    def __init__(
        self, member: Member, name: str, kind: ServiceType, handler: Handler, group: CallbackGroup
    ) -> None:
        self.member = member
        self.name, self.type = name, kind.name
        self._kind = kind
        self._handler, self._group = handler, group
        self._pending: list[Done] = []
        self._open = True

    def ask(self, request: Message, done: Done) -> None:
        """A request is there. Called by a thread of the client library."""
        self.member.context.kernel.post(partial(self._queue, request, done))

    def _queue(self, request: Message, done: Done) -> None:
        if not self._open:
            done(None, "its server has gone")
            return
        self._pending.append(done)
        self._group.add(Work(self.member.context.kernel.now(), partial(self._answer, request, done)))

    def _answer(self, request: Message, done: Done) -> None:
        if done not in self._pending:
            return
        try:
            answer = self._handler(request)
            if not isinstance(answer, self._kind.response):
                raise UsageError(
                    f"the handler of {self.name} returned {answer!r}, not a {self.type} response"
                )
            content = answer.copy()
        except Exception as error:
            self._end(done, None, f"its handler raised {type(error).__name__}: {error}")
            raise
        self._end(done, content, "")

    def _end(self, done: Done, answer: Message | None, problem: str) -> None:
        with self.member.context.kernel.guard:
            if done in self._pending:
                self._pending.remove(done)
                done(answer, problem)

    def close(self) -> None:
        """Answer no longer; who waits is told."""
        if self._open:
            self._open = False
            self.served.close()
            for done in list(self._pending):
                self._end(done, None, "its server has gone")


class TransportClient:
    """See ``volery.ros.graph.node.Client``."""

    def __init__(self, member: Member, name: str, kind: ServiceType, caller: Caller) -> None:
        self.name, self.type = name, kind.name
        self._kind = kind
        self._member = member
        self._caller = caller

    def call(self, request: Any, within: Ns | None = None) -> Any:
        """Block until the answer is there; ``ServiceError`` if none comes."""
        kernel = self._member.context.kernel
        self._member.check_open()
        if not isinstance(request, self._kind.request):
            raise UsageError(f"service {self.name} takes a {self._kind.request.__msgtype__}, not {request!r}")
        outcome: list[tuple[Message | None, str]] = []
        answered = Signal(kernel, f"service {self.name} (answer)")

        def arrive(answer: Message | None, problem: str) -> None:
            outcome.append((answer, problem))
            answered.notify()

        with kernel:
            start = kernel.now()
            give_up = self._caller.call(request.copy(), lambda *end: kernel.post(partial(arrive, *end)))
            if not answered.wait_for(lambda: outcome, within):
                give_up()
                arrive(None, f"no answer within {to_seconds(within or 0):g} s")
            answer, problem = outcome[0]
            who, end = self._member.id.component, "ServiceError" if problem else "ok"
            kernel.record(Call(start, kernel.now(), who, "", self.name, end))
        if problem:
            raise ServiceError(self.name, problem)
        return answer

    def wait(self, within: Ns | None = None) -> bool:
        """Block until somebody serves it."""
        return until(self._member.context.kernel, f"service {self.name}", self._caller.ready, within)

    def ready(self) -> bool:
        """Whether somebody serves it now."""
        return abroad(self._member.context.kernel, f"service {self.name}", self._caller.ready)

    def close(self) -> None:
        """Call no more."""
        self._caller.close()
