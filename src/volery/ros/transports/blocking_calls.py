"""Doing what may block outside the house: a thread does it, and the task that asked for it is parked."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial
from typing import TypeVar, cast
from weakref import WeakKeyDictionary

from volery.base.errors import LinkSilent, VoleryError
from volery.base.time import Ns, S, to_seconds
from volery.kernel.api import Kernel
from volery.kernel.waiting import Signal

T = TypeVar("T")
PATIENCE: Ns = 10 * S
_waiting: WeakKeyDictionary[Kernel, list[str]] = WeakKeyDictionary()
"""Names of the tasks that wait for a thread."""
POLL_S = 0.05
"""How long after each look one looks again for what the client library does not announce."""


def run_in_thread(kernel: Kernel, what: str, work: Callable[[], T], within: Ns = PATIENCE) -> T:
    """The result of *work*, which a thread of its own does; what it raises is raised here.

    In house code, which must not block, it is done on the spot. ``LinkSilent`` if it takes longer than
    *within*.
    """
    task = kernel.current()
    if task is None:
        return work()
    ended = Signal(kernel, what)
    outcome: list[tuple[T | None, BaseException | None]] = []

    def finish(value: T | None, error: BaseException | None) -> None:
        outcome.append((value, error))
        ended.notify()

    def run() -> None:
        try:
            value = work()
        except Exception as error:
            kernel.post(partial(finish, None, error))
        else:
            kernel.post(partial(finish, value, None))

    threading.Thread(target=run, name=what, daemon=True).start()
    waiting = _waiting.setdefault(kernel, [])
    waiting.append(task.name)
    try:
        if not ended.wait_for(lambda: outcome, within):
            raise LinkSilent(f"{what}: no answer within {to_seconds(within):g} s")
    finally:
        waiting.remove(task.name)
    value, error = outcome[0]
    if error is not None:
        raise error
    return cast("T", value)


def pending_calls(kernel: Kernel) -> tuple[str, ...]:
    """Return the names of the tasks of *kernel* that wait for a thread."""
    return tuple(_waiting.get(kernel, ()))


def poll_in_thread(kernel: Kernel, what: str, holds: Callable[[], bool], within: Ns | None) -> bool:
    """Block the current task until *holds*, which a thread asks again and again; False after *within*."""
    seen = Signal(kernel, what)
    found: list[bool] = []
    given_up = threading.Event()

    def tell() -> None:
        found.append(True)
        seen.notify()

    def look() -> None:
        while not given_up.is_set():
            if _succeeds(holds):
                kernel.post(tell)
                return
            given_up.wait(POLL_S)

    threading.Thread(target=look, name=what, daemon=True).start()
    try:
        return seen.wait_for(lambda: found, within)
    finally:
        given_up.set()


def _succeeds(holds: Callable[[], bool]) -> bool:
    try:
        return holds()
    except (OSError, VoleryError):
        return False  # whoever would know is away; it may come back
