"""Requests to one autopilot whose answers are awaited.

Each is sent again until its answer arrives, as the protocols ask: messages are lost on radios. The calls
block the calling task. Several tasks may ask at once, because an answer is recognised by its content.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from volery.base.errors import CapabilityError, NotArrived, Refused
from volery.base.time import MS, Ns, S
from volery.kernel.api import Action, Kernel
from volery.kernel.waiting import Signal
from volery.links.frame import Frame

TRIES = 5
AGAIN: Ns = 1500 * MS
"""Time after which a request is sent again: a parameter is read in 0.1 s, a radio delays by a second."""
STALLED: Ns = S
"""Time without a further part of an answer after which the missing ones are requested."""

T = TypeVar("T")


class PendingRequests:
    """The requests to one autopilot that are in progress.

    Args:
        kernel: clock and tasks.
        name: name of the vehicle, for errors.

    Attributes:
        cause: returns what a missing answer is due to, if that is known.
    """

    def __init__(self, kernel: Kernel, name: str) -> None:
        self.cause: Callable[[], str] = str
        self._kernel = kernel
        self._name = name
        self._listeners: list[Callable[[Frame], None]] = []
        self._arrived = Signal(kernel, f"an answer of {name}")

    @property
    def listening(self) -> bool:
        """Whether a request in progress looks at every message."""
        return bool(self._listeners)

    def receive(self, frame: Frame) -> None:
        """Pass a frame of the autopilot to the requests in progress."""
        if self._listeners:
            for listener in tuple(self._listeners):
                listener(frame)
            self._arrived.notify()

    def ask(
        self,
        asked: str,
        send: Action,
        answer: Callable[[Frame], T | None],
        *,
        within: Ns = AGAIN * TRIES,
        again: Ns = AGAIN,
        unanswered: str = "",
    ) -> T:
        """Send a request, again each *again* ns, until *answer* returns something; return that.

        Args:
            asked: the request in words, for errors.
            send: sends it.
            answer: takes each frame, and returns what was asked for once it has arrived.
            within: longest time to wait, ns.
            again: time after which it is sent again, ns.
            unanswered: what a missing answer may mean, for the error.

        Raises:
            NotArrived: there is no answer; what *answer* raises passes.
        """
        found: list[T] = []
        failed: list[Exception] = []

        def listen(frame: Frame) -> None:
            if found or failed:
                return
            try:
                taken = answer(frame)
            except (CapabilityError, Refused) as error:
                failed.append(error)
                return
            if taken is not None:
                found.append(taken)

        with self._kernel.joined(), _Listening(self._kernel, self._listeners, listen):
            until = self._kernel.now() + within
            while self._kernel.now() < until:
                with self._kernel.interact():
                    send()
                wait = min(again, until - self._kernel.now())
                if self._arrived.wait_for(lambda: found or failed, wait, ends_activation=True):
                    if failed:
                        raise failed[0]
                    return found[0]
        raise NotArrived(self._name, asked, self._unanswered(within, unanswered))

    def _unanswered(self, within: Ns, otherwise: str = "") -> str:
        """Return that no answer came, and why: the cause that is known, or what it may mean *otherwise*."""
        cause = self.cause()
        return f"no answer within {within / S:g} s{f'; {cause}' if cause else otherwise}"

    def gather(
        self,
        asked: str,
        send: Action,
        take: Callable[[Frame], None],
        *,
        count: Callable[[], int],
        whole: Callable[[], bool],
        so_far: Callable[[], str],
    ) -> None:
        """Send a request that is answered in parts, again for what is missing whenever no more arrive.

        Args:
            asked: the request in words, for errors.
            send: requests what is missing.
            take: takes each frame.
            count: returns how many parts have arrived.
            whole: returns whether all have.
            so_far: returns what has arrived, for the error.

        Raises:
            NotArrived: nothing more arrives.
        """
        with self._kernel.joined(), _Listening(self._kernel, self._listeners, take):
            stalled = 0
            with self._kernel.interact():
                send()
            while not whole():
                before = count()
                self._arrived.wait_for(whole, STALLED, ends_activation=True)
                if count() > before:
                    stalled = 0
                    continue
                stalled += 1
                if stalled > TRIES:
                    raise NotArrived(self._name, asked, "; ".join(filter(None, (so_far(), self.cause()))))
                if not whole():
                    with self._kernel.interact():
                        send()


class _Listening:
    """Adds a listener while the context lasts."""

    def __init__(
        self, kernel: Kernel, listeners: list[Callable[[Frame], None]], listener: Callable[[Frame], None]
    ) -> None:
        self._kernel, self._listeners, self._listener = kernel, listeners, listener

    def __enter__(self) -> None:
        with self._kernel.guard:
            self._listeners.append(self._listener)

    def __exit__(self, *_error: object) -> None:
        with self._kernel.guard:
            self._listeners.remove(self._listener)
