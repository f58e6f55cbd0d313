"""Setting the event from anywhere ends a wait, and a signal does not make it endless."""

from __future__ import annotations

import signal
from threading import Timer
from time import monotonic_ns

from volery.base.time import MS
from volery.kernel.auto_reset_event import AutoResetEvent


def test_setting_it_twice_ends_one_wait() -> None:
    event = AutoResetEvent()
    event.set()
    event.set()
    event.wait(1e6)  # ended by the calls before
    event.wait(0.0)
    Timer(0.01, event.set).start()
    event.wait(1e6)


def test_a_wait_whose_time_passes_while_a_signal_is_handled_ends() -> None:
    event, rescued = AutoResetEvent(), []

    def handle(*_signal: object) -> None:
        until = monotonic_ns() + 100 * MS  # longer than the wait
        while monotonic_ns() < until:
            pass

    def rescue() -> None:
        rescued.append(True)
        event.set()

    before = signal.signal(signal.SIGALRM, handle)
    timer = Timer(20.0, rescue)
    timer.start()
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.01)
        event.wait(0.05)
    finally:
        timer.cancel()
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert not rescued
