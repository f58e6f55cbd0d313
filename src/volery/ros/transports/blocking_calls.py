"""Calls that may block outside the framework: a thread executes them while the requesting task waits."""

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
"""Period of polling for what a client library does not announce, s."""


def run_in_thread(kernel: Kernel, what: str, work: Callable[[], T], within: Ns = PATIENCE) -> T:
    """Execute `work` in a thread of its own; return its result or raise its exception.

    In a framework callback, which must not block, `work` is executed in place.

    Raises:
        LinkSilent: it takes longer than `within` ns.
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
    """Return the names of the tasks that wait in ``run_in_thread``."""
    return tuple(_waiting.get(kernel, ()))


def poll_in_thread(kernel: Kernel, what: str, holds: Callable[[], bool], within: Ns | None) -> bool:
    """Block the current task until `holds`, which a thread polls; return False if `within` ns pass first."""
    seen = Signal(kernel, what)
    found: list[bool] = []
    given_up = threading.Event()

    def announce() -> None:
        found.append(True)
        seen.notify()

    def poll() -> None:
        while not given_up.is_set():
            if _succeeds(holds):
                kernel.post(announce)
                return
            given_up.wait(POLL_S)

    threading.Thread(target=poll, name=what, daemon=True).start()
    try:
        return seen.wait_for(lambda: found, within)
    finally:
        given_up.set()


def _succeeds(holds: Callable[[], bool]) -> bool:
    try:
        return holds()
    except (OSError, VoleryError):
        return False  # the ROS master cannot be reached; it may come back
