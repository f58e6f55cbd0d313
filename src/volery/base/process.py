"""What the operating system does to this process: signals that end it, and output without a reader.

SIGINT and SIGTERM end what flies or serves in order, also in a job that a shell started with ``&`` and
therefore with SIGINT ignored. SIGHUP, the signal of a terminal that was closed, does the same, unless it was
ignored when the program started (``nohup``); it counts once, because a shell passes on what the terminal has
sent already. What is printed after that is dropped.
"""

from __future__ import annotations

import errno
import io
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

Handler = Callable[[int, FrameType | None], object]

_hung_up = threading.Event()
"""Set by the first SIGHUP that ends something; later ones are ignored."""


def ending_signals() -> tuple[signal.Signals, ...]:
    """Return the signals that end a run in order: SIGINT, SIGTERM, and SIGHUP unless it is ignored."""
    hang_up = () if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN else (signal.SIGHUP,)
    return (signal.SIGINT, signal.SIGTERM, *hang_up)


@contextmanager
def on_ending_signals(handler: Handler) -> Iterator[None]:
    """Call *handler* for each signal of ``ending_signals``; change nothing outside of the main thread."""

    def handle(number: int, frame: FrameType | None) -> None:
        _take_hang_up(number)
        handler(number, frame)

    with _handled(dict.fromkeys(ending_signals(), handle)):
        yield


@contextmanager
def interrupted_by_signals() -> Iterator[None]:
    """Let SIGTERM and SIGHUP raise ``KeyboardInterrupt`` as Ctrl-C does, in the main thread.

    A handler that the program has installed itself is kept.
    """

    def interrupt(number: int, frame: FrameType | None) -> None:
        _take_hang_up(number)
        ctrl_c = signal.getsignal(signal.SIGINT)
        if callable(ctrl_c):  # a kernel that runs has its own
            ctrl_c(signal.SIGINT, frame)

    wanted: dict[signal.Signals, Any] = {
        number: interrupt for number in ending_signals() if signal.getsignal(number) is signal.SIG_DFL
    }
    if signal.getsignal(signal.SIGINT) in (signal.SIG_DFL, signal.SIG_IGN):
        wanted[signal.SIGINT] = signal.default_int_handler
    with _handled(wanted):
        yield


@contextmanager
def without_hang_ups() -> Iterator[None]:
    """Ignore SIGHUP: a landing that Ctrl-C has begun goes on when the terminal is closed."""
    with _handled({signal.SIGHUP: signal.SIG_IGN}):
        yield


def _take_hang_up(number: int) -> None:
    if number == signal.SIGHUP:
        _hung_up.set()
        signal.signal(signal.SIGHUP, signal.SIG_IGN)


@contextmanager
def _handled(wanted: Mapping[signal.Signals, Any]) -> Iterator[None]:
    """Install handlers, and restore those before at the end; in the main thread, which alone may do it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, handler) for number, handler in wanted.items()}
    try:
        yield
    finally:
        if threading.current_thread() is threading.main_thread():
            for number, handler in before.items():
                if number != signal.SIGHUP or not _hung_up.is_set():
                    signal.signal(number, handler if handler is not None else signal.SIG_DFL)


class LossyStream(io.FileIO):
    """A standard stream of this process that drops what cannot be written.

    ``problem`` is the first error, unless it says that the reader is gone: a closed terminal or pipe.
    """

    def __init__(self, descriptor: int) -> None:
        super().__init__(descriptor, "w", closefd=False)
        self.problem = ""

    def write(self, data: Any, /) -> int:
        """Write *data*, or drop it, and from then on everything."""
        try:
            return super().write(data) or 0
        except OSError as error:
            if error.errno not in (errno.EIO, errno.EPIPE):
                self.problem = error.strerror or str(error)
            with suppress(OSError):
                null = os.open(os.devnull, os.O_WRONLY)
                os.dup2(null, self.fileno())
                os.close(null)
            return len(data)


def outlive_output() -> LossyStream | None:
    """Let the process go on where its standard output or error cannot be written any more.

    Without it the first line that is printed after a terminal was closed would end a landing.

    Returns:
        What standard output is written to; None if it is no file of this process, as in a test.
    """
    raw = {name: _lossy(name) for name in ("stdout", "stderr")}
    return raw["stdout"]


def _lossy(name: str) -> LossyStream | None:
    stream = getattr(sys, name)
    if stream is not getattr(sys, f"__{name}__") or not isinstance(stream, io.TextIOWrapper):
        return None
    raw = LossyStream(stream.fileno())
    unbuffered = isinstance(stream.buffer, io.RawIOBase)
    replaced = io.TextIOWrapper(
        raw if unbuffered else io.BufferedWriter(raw),  # Python does so with -u
        stream.encoding,
        stream.errors,
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )
    stream.flush()
    setattr(sys, name, replaced)
    return raw
