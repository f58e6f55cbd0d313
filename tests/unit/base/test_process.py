"""Signals that end a program, and output whose reader is gone."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from typing import Any

import pytest

from volery.base import process
from volery.base.process import (
    LossyStream,
    ending_signals,
    interrupted_by_signals,
    on_ending_signals,
    without_hang_ups,
)

INT, TERM, HUP = signal.SIGINT, signal.SIGTERM, signal.SIGHUP


@pytest.fixture(autouse=True)
def as_a_program_starts(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(process, "_hung_up", threading.Event())
    before = {number: signal.getsignal(number) for number in (INT, TERM, HUP)}
    signal.signal(INT, signal.default_int_handler)
    signal.signal(TERM, signal.SIG_DFL)
    signal.signal(HUP, signal.SIG_DFL)
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def interrupts(number: signal.Signals) -> bool:
    try:
        os.kill(os.getpid(), number)
    except KeyboardInterrupt:
        return True
    return False


def test_sigterm_and_a_closed_terminal_interrupt_as_ctrl_c_does() -> None:
    with interrupted_by_signals():
        assert interrupts(INT)
        assert interrupts(TERM)
        assert interrupts(HUP)
        assert interrupts(TERM)
        assert not interrupts(HUP)  # a shell passes on what the terminal has sent already
    assert signal.getsignal(TERM) is signal.SIG_DFL
    assert not interrupts(HUP)


def test_a_program_under_nohup_is_not_ended_by_a_closed_terminal() -> None:
    signal.signal(HUP, signal.SIG_IGN)
    assert ending_signals() == (INT, TERM)
    with interrupted_by_signals():
        assert not interrupts(HUP)
        assert interrupts(TERM)


def test_a_background_job_of_a_script_is_ended_though_it_ignores_sigint() -> None:
    signal.signal(INT, signal.SIG_IGN)
    with interrupted_by_signals():
        assert interrupts(TERM)
    assert signal.getsignal(INT) is signal.SIG_IGN


def test_a_handler_of_the_program_is_kept() -> None:
    called: list[int] = []
    signal.signal(TERM, lambda number, frame: called.append(number))
    with interrupted_by_signals():
        assert not interrupts(TERM)
    assert called == [TERM]


def test_a_handler_is_called_for_each_signal_but_once_for_a_closed_terminal() -> None:
    called: list[int] = []
    with on_ending_signals(lambda number, frame: called.append(number)):
        for number in (HUP, HUP, TERM, INT, TERM):
            os.kill(os.getpid(), number)
    assert called == [HUP, TERM, INT, TERM]


def test_a_landing_after_ctrl_c_does_not_notice_a_closed_terminal() -> None:
    with interrupted_by_signals():
        with without_hang_ups():
            assert not interrupts(HUP)
        assert interrupts(HUP)


def test_another_thread_changes_nothing() -> None:
    seen: list[Any] = []

    def body() -> None:
        with interrupted_by_signals():
            seen.append(signal.getsignal(TERM))

    thread = threading.Thread(target=body)
    thread.start()
    thread.join()
    assert seen == [signal.SIG_DFL]


def test_output_without_a_reader_is_dropped() -> None:
    reader, writer = os.pipe()
    stream = LossyStream(writer)
    stream.write(b"heard")
    assert os.read(reader, 9) == b"heard"
    os.close(reader)
    assert stream.write(b"nobody") == 6
    assert stream.write(b"nobody") == 6
    assert not stream.problem
    os.close(writer)


def test_output_into_a_terminal_that_was_closed_is_dropped() -> None:
    master, line = os.openpty()
    stream = LossyStream(line)
    os.close(master)
    assert stream.write(b"nobody") == 6
    assert not stream.problem
    os.close(line)


def test_output_onto_a_full_disk_is_dropped_and_said() -> None:
    full = os.open("/dev/full", os.O_WRONLY)
    stream = LossyStream(full)
    assert stream.write(b"lost") == 4
    assert stream.problem == "No space left on device"
    os.close(full)
