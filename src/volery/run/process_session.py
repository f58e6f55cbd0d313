"""A run of a model in a process of its own, watched and steered from this one.

A program that shows a run is then no part of it: it cannot hold virtual time, and code of a component that
crashes its process ends the run and nothing else. The process is started anew and not forked, for the program
may have threads. It is in no terminal, so Ctrl-C reaches it once, through this process.

Events wait in the process of the run until this one takes them. When too many wait, the oldest are dropped
and counted, unless the session is lossless. The record in the run folder is complete in any case.
"""

from __future__ import annotations

import gc
import os
import pickle
import signal
import socket
import subprocess
import sys
import traceback
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from multiprocessing.connection import Connection, wait
from pathlib import Path
from queue import SimpleQueue
from threading import Condition, Event, Lock, RLock, Thread
from types import FrameType
from typing import Any, Self, get_args

from volery.base.errors import UsageError, VoleryError, choices
from volery.base.garbage import seldom_collected
from volery.base.process import interrupted_by_signals, on_ending_signals, outlive_output
from volery.base.time import Ns, clock
from volery.components.cpp.framework import Crash, read_crash
from volery.kernel.virtual import Pacer
from volery.model.builder import ModelBuilder
from volery.model.system import System
from volery.run.ending import FOREVER
from volery.run.result import DEFAULT_OPTIONS, Options, Run, RunProgress, VehicleProgress
from volery.run.run_session import RunSession, check_fidelity, check_step, read_system
from volery.run.supervision import how_ended, recover_by, recover_run, supervision_of
from volery.trace.events import Event as TraceEvent
from volery.trace.events import Published, Record

BATCH = 256
"""Events that go to the other process at a time."""

LARGE = 4096
"""Bytes of a message's content, such as an image, from which on it goes alone."""

WAITING_BYTES = 4_000_000
"""Size of the events that may wait in the process of a run, pickled: tens of thousands of small ones."""

LOOK_S = 1.0
"""Wall seconds between two looks whether a process lives whose link is silent."""

EXIT_S = 30.0
"""Wall seconds that a process may take to exit when all is done, or when it crashes and writes a core."""

KINDS: tuple[type[Any], ...] = get_args(TraceEvent)


class ProcessRunSession:
    """One run of a model in virtual time, in a process of its own; used as a ``RunSession``.

    Several may run at once. The trace is that of a ``RunSession``, byte for byte. Listeners are called in the
    thread that steps or runs; ``pause``, ``resume``, ``pace``, ``progress`` and ``stop`` are for all threads.
    If the process dies, the run has failed: its ``error`` says how and when, and the run folder has what was
    recorded. If this program ends first, the run is stopped in order.

    Args:
        model: As of ``simulate``, and so are the other arguments.
        options: Options of the run.
        scenario: Scenario of a model that is read from a file.
        allocation: Allocation of a model that is read from a file; None for its first.
        overrides: Changes ``path=value`` of a model that is read from a file.
        lossless: Virtual time waits for listeners that are slow, and none misses an event.

    Raises:
        ModelError: The model is wrong; nothing has started.
        UsageError: An option is wrong; nothing has started.
        CapabilityError: The fidelity is not there; nothing has started.
        VoleryError: The process died before the run began.

    Example::

        with volery.ProcessRunSession("model.yaml", volery.Options(pace=1.0)) as session:
            session.tap(show, VehicleState)
            Thread(target=session.run).start()
            ask_user()
            session.stop()
    """

    def __init__(
        self,
        model: System | ModelBuilder | str | Path,
        options: Options = DEFAULT_OPTIONS,
        *,
        scenario: str | None = None,
        allocation: str | None = None,
        overrides: Iterable[str] = (),
        lossless: bool = False,
    ) -> None:
        check_fidelity(options.fidelity)
        self._system = read_system(model, scenario, allocation, overrides)
        self._options = options
        self._pace = options.pace
        self._now: Ns = 0
        self._vehicles: tuple[VehicleProgress, ...] = ()
        self._dropped = 0
        self._prepared = False
        self._result: Run | None = None
        self._libraries: dict[str, Path] = {}
        self._listeners: dict[type[Any], tuple[Record, ...]] = {}
        if options.show is not None:
            self._listeners[RunProgress] = (options.show,)
        if options.tell is not None:
            self._listeners[str] = (options.tell,)
        self._tapping = Lock()
        self._passing = RLock()
        self._passes = False
        self._child = _Child()
        try:
            shown, tells = options.show is not None, options.tell is not None
            sent = replace(options, show=None, tell=None)
            self._child.send(_BEGIN, (self._system, sent, shown, tells, lossless))
            while not self._take():
                pass
            self._prepared = True
        except BaseException:
            self._child.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        if self._result is None:
            self.stop("its session was left")

    # -- watching

    @property
    def now(self) -> Ns:
        """Virtual time, ns, as last reported: each tenth of a second on the wall, and after each step."""
        return self._now

    @property
    def running(self) -> bool:
        """Whether the run has not ended; it may not have begun."""
        return self._result is None

    @property
    def result(self) -> Run:
        """The run, once it has ended. Raises ``UsageError`` before."""
        if self._result is None:
            raise UsageError("the run has not ended: step until step() is False, or call run() or stop()")
        return self._result

    @property
    def dropped(self) -> int:
        """Number of events that no listener got, for those before them took too long."""
        return self._dropped

    def progress(self) -> tuple[VehicleProgress, ...]:
        """Return the state of each vehicle at ``now``. It does not wait."""
        return self._vehicles

    def tap(self, listener: Record, *kinds: type[Any]) -> None:
        """Call *listener* with each event of some kinds (of ``volery.trace.events``), in the order of record.

        Without *kinds* it gets every event. It may take its time, see ``dropped``; what it raises ends the
        run. It is called in the thread that steps or runs.

        Raises:
            UsageError: One of *kinds* is no kind of event.
        """
        for kind in kinds:
            if kind not in KINDS:
                known = choices(one.__name__ for one in KINDS)
                raise UsageError(f"{kind!r} is no kind of event; there is {known}")
        with self._tapping:
            wanted = dict.fromkeys(kinds or KINDS)
            new = tuple(kind for kind in wanted if kind not in self._listeners)
            for kind in wanted:
                self._listeners[kind] = (*self._listeners.get(kind, ()), listener)
            if new:
                self._child.send(_TAP, new)

    # -- steering

    @property
    def pace(self) -> float | None:
        """Simulated seconds per wall second; ``None``: as fast as possible. It may be set at any time."""
        return self._pace

    @pace.setter
    def pace(self, pace: float | None) -> None:
        if pace is not None:
            Pacer(pace)  # raises if it cannot be one
        self._pace = pace
        self._child.send(_PACE, pace)

    def step(self, duration: Ns) -> bool:
        """Let virtual time pass, at most *duration* ns; return whether the run goes on after it.

        Raises:
            UsageError: *duration* is not a whole number above 0, or another thread steps or runs.
        """
        check_step(duration)
        return self._pass_time(duration)

    def run(self) -> Run:
        """Let time pass to the end of the run and return it. ``pause`` holds it, from another thread.

        Raises:
            UsageError: Another thread steps or runs.
        """
        self._pass_time(None)
        return self.result

    def pause(self) -> None:
        """Hold ``run``, from any thread: virtual time stands still until ``resume``."""
        self._child.send(_PAUSE)

    def resume(self) -> None:
        """Let a held ``run`` go on."""
        self._child.send(_RESUME)

    def stop(self, reason: str = "stopped") -> Run:
        """End the run in order: components are cancelled, vehicles brought to rest. Return the run.

        Another thread that steps or runs returns, too.
        """
        self._child.send(_STOP, reason)
        with self._passing, on_ending_signals(self._child.signal):
            while self._result is None:
                self._take()
        return self.result

    # -- parts

    def _pass_time(self, duration: Ns | None) -> bool:
        """Let time pass, to the end without *duration*, and call listeners; return if the run goes on."""
        with self._alone():
            if self.running:
                self._child.send(_PASS, duration)
            try:
                with on_ending_signals(self._child.signal):
                    while self.running and not self._take():
                        pass
            except BaseException as fault:
                if self.running:  # a listener has raised it
                    self._listeners = {}
                    self.stop(f"{type(fault).__name__}: {fault}")
                raise
            return self.running

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Raise ``UsageError`` if time passes already."""
        if not self._passing.acquire(blocking=False):
            raise UsageError("another thread steps or runs this session; pause() and stop() are for all")
        try:
            if self._passes:
                raise UsageError("a listener cannot step or run the session that calls it")
            self._passes = True
            try:
                yield
            finally:
                self._passes = False
        finally:
            self._passing.release()

    def _take(self) -> bool:
        """Take one message of the process; return whether it says that what was asked for is done."""
        message = self._child.receive()
        if message is None:
            self._recover()
            return False
        what, content = message
        if what == _STATE:
            self._now, self._vehicles = content
        elif what == _EVENTS:
            events, self._dropped = content
            for event in pickle.loads(events):
                for listener in self._listeners.get(event.__class__, ()):
                    listener(event)
        elif what == _LIBRARIES:
            self._libraries = content
        elif what == _ENDED:
            self._result, error = content
            self._child.close()
            if error is not None:
                raise error
        return bool(what == _DONE)

    def _recover(self) -> None:
        """Finish the record of a run whose process died, or raise if it had not begun."""
        crash = self._child.crash(self._libraries)
        self._child.close()
        if not self._prepared:
            how = how_ended(self._child.status) if crash is None else str(crash.error())
            raise VoleryError(f"the process of the run ended before the run began: {how}")
        recover = partial(recover_run, self._system, self._options, self._now)
        self._result = recover_by(recover, self._child.status, crash, f" after {clock(self._now)}")


_BEGIN, _TAP, _PACE, _PASS, _PAUSE, _RESUME, _STOP = "begin", "tap", "pace", "pass", "pause", "resume", "stop"
_STATE, _EVENTS, _LIBRARIES, _DONE, _ENDED = "state", "events", "libraries", "done", "ended"


class _Child:
    """The process of a run and the links to it."""

    def __init__(self) -> None:
        ours, theirs = socket.socketpair()
        report, crash_pipe = os.pipe()
        self._link = Connection(ours.detach())
        self._report = Connection(report, writable=False)
        self._sending = Lock()
        script = (
            f"import sys; sys.path[:] = {sys.path!r}; from volery.run.process_session import main; "
            f"main({theirs.fileno()}, {crash_pipe})"
        )
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-c", script],
                pass_fds=[theirs.fileno(), crash_pipe],
                stdin=subprocess.DEVNULL,
                start_new_session=True,  # Ctrl-C reaches this process, which passes it on
            )
        finally:
            theirs.close()
            os.close(crash_pipe)

    @property
    def status(self) -> int:
        """Exit status of a process that was closed."""
        return self._process.returncode

    def send(self, what: str, argument: Any = None) -> None:
        """Send a command, from any thread; in vain if the process has ended: what it has sent says how."""
        with self._sending, suppress(OSError):
            self._link.send((what, argument))

    def signal(self, number: int, frame: FrameType | None) -> None:
        """Pass on a signal that this process has received."""
        with suppress(OSError):
            self._process.send_signal(number)

    def receive(self) -> tuple[str, Any] | None:
        """Return the next message of the process; None if it has ended without another."""
        try:
            while not self._link.poll(LOOK_S):  # what a component has forked may keep a dead process's link
                if self._process.poll() is not None and not self._link.poll():
                    return None
            message: tuple[str, Any] = self._link.recv()
            return message
        except (EOFError, OSError):
            return None

    def crash(self, libraries: dict[str, Path]) -> Crash | None:
        """Return the crash that a process has reported before it died, if any."""
        return read_crash(self._report.fileno(), libraries) if wait([self._report], 0) else None

    def close(self) -> None:
        """Close the links, which ends the process, and wait for its end."""
        with self._sending:
            self._link.close()
        self._report.close()
        try:
            self._process.wait(EXIT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


# -- in the child


@seldom_collected()
def main(descriptor: int, crash_pipe: int) -> None:
    """Make the run that is asked for over a socket, and end the process."""
    for one in (descriptor, crash_pipe):
        os.set_inheritable(one, False)
    outlive_output()
    link = Connection(descriptor)
    _, (system, options, shown, tells, lossless) = link.recv()
    outbox = _Outbox(link, lossless=lossless)
    inbox = _Inbox(link, outbox)
    session, fault = None, None
    try:
        with interrupted_by_signals():
            tell_now = outbox.put_now if tells else None
            options = replace(options, show=outbox.put if shown else None, tell=tell_now)
            if supervision := supervision_of(system, options):
                outbox.answer(_LIBRARIES, supervision.libraries)
                supervision.begin(crash_pipe)
            session = _ServedSession(system, options)
            gc.freeze()  # what exists now stays until the end: collections need not look at it
            inbox.prepared.set()
        with on_ending_signals(inbox.take_signal):
            session.serve(inbox, outbox)
    except BaseException as error:
        fault = _portable(error)
    run = session.result if session is not None and not session.running else None
    outbox.finish(_ENDED, (run, fault))
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    os._exit(0)  # threads that components have left do not hold it


def _portable(error: BaseException) -> BaseException:
    """Return an error as it can be sent, with its traceback if it is none that volery raises on purpose."""
    if not isinstance(error, VoleryError):
        error.add_note("".join(traceback.format_exception(error)).rstrip())
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return VoleryError(f"{type(error).__name__}: {error}")
    return error


class _ServedSession(RunSession):
    """The run in the child."""

    def serve(self, inbox: _Inbox, outbox: _Outbox) -> None:
        """Let time pass as the commands say, until the run has ended."""
        outbox.flush((self.now, self.progress()))
        outbox.answer(_DONE)
        goal, held = self.now, False
        while True:
            while inbox.waits() or goal <= self.now or (held and goal == FOREVER):
                what, argument = inbox.get()
                if what == _PASS:
                    goal = FOREVER if argument is None else self.now + argument
                elif what in (_PAUSE, _RESUME):
                    held = what == _PAUSE and not self._ending.begun
                elif what == _PACE:
                    self.pace = argument
                elif what == _TAP:
                    self.tap(outbox.put, *argument)
                elif what == _STOP:
                    self._begin_end(argument)
                    goal, held = FOREVER, False
            goes_on = self.step(min(goal - self.now, self._slice()))
            outbox.flush((self.now, self.progress()))
            if not goes_on:
                return
            if self.now >= goal:
                outbox.answer(_DONE)


class _Inbox:
    """Commands, as a thread receives them. When the link is closed the run is to end."""

    def __init__(self, link: Connection, outbox: _Outbox) -> None:
        self.prepared = Event()
        self._commands: SimpleQueue[tuple[str, Any]] = SimpleQueue()
        Thread(target=self._listen, args=(link, outbox), daemon=True).start()

    def waits(self) -> bool:
        """Whether there is a command."""
        return not self._commands.empty()

    def get(self) -> tuple[str, Any]:
        """Return the next command, when there is one."""
        return self._commands.get()

    def take_signal(self, number: int, frame: FrameType | None) -> None:
        """Let the run end; a signal while time passes is that of ``Ending.signals``."""
        self._commands.put((_STOP, f"{signal.Signals(number).name} received"))

    def _listen(self, link: Connection, outbox: _Outbox) -> None:
        with suppress(EOFError, OSError):
            while True:
                self._commands.put(link.recv())
        outbox.abandon()
        self._commands.put((_PACE, None))  # for it is not watched
        self._commands.put((_STOP, "the program that watched it has ended"))
        if not self.prepared.is_set():
            os.killpg(0, signal.SIGTERM)  # and what it has started to compile


class _Outbox:
    """Messages to the other process, which a thread sends; a reader that is slow holds no virtual time.

    Args:
        link: To the other process.
        lossless: Wait for the reader and drop nothing.
    """

    def __init__(self, link: Connection, *, lossless: bool) -> None:
        self._link, self._lossless = link, lossless
        self._batch: list[Any] = []
        self._waiting: deque[tuple[int, bytes]] = deque()
        self._size = 0
        self._dropped = 0
        self._state: object = None
        self._answers: deque[tuple[str, Any]] = deque()
        self._abandoned = False
        self._changed = Condition()
        self._sender = Thread(target=self._send, daemon=True)
        self._sender.start()

    def put(self, event: Any) -> None:
        """Add an event, to be sent with others."""
        self._batch.append(event)
        if len(self._batch) >= BATCH or (event.__class__ is Published and len(event.data) > LARGE):
            self.flush()

    def put_now(self, event: Any) -> None:
        """Add an event and send it at once."""
        self._batch.append(event)
        self.flush()

    def flush(self, state: object = None) -> None:
        """Send the events that were added, and the state of the run before them."""
        with self._changed:
            if self._lossless:
                self._changed.wait_for(lambda: self._size < WAITING_BYTES or self._abandoned)
            if self._batch and not self._abandoned:
                content = pickle.dumps(self._batch, pickle.HIGHEST_PROTOCOL)
                self._waiting.append((len(self._batch), content))
                self._size += len(content)
            self._batch.clear()
            while self._size > WAITING_BYTES and len(self._waiting) > 1 and not self._lossless:
                number, content = self._waiting.popleft()
                self._dropped += number
                self._size -= len(content)
            self._state = state or self._state
            self._changed.notify_all()

    def answer(self, what: str, content: Any = None) -> None:
        """Send a message after all events that were flushed."""
        with self._changed:
            self._answers.append((what, content))
            self._changed.notify_all()

    def finish(self, what: str, content: Any) -> None:
        """Send a last message, and return when it is sent."""
        self.flush()
        self.answer(what, content)
        self._sender.join()

    def abandon(self) -> None:
        """Send nothing more: there is no receiver."""
        with self._changed:
            self._abandoned = True
            self._waiting.clear()
            self._changed.notify_all()

    def _send(self) -> None:
        with suppress(OSError):
            while not self._abandoned:
                for message in self._taken():
                    self._link.send(message)
                    if message[0] == _ENDED:
                        return

    def _taken(self) -> list[tuple[str, Any]]:
        """Return the messages that are next, when there are any."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._state or self._answers or self._abandoned)
            messages: list[tuple[str, Any]] = []
            if self._state:
                messages.append((_STATE, self._state))
                self._state = None
            if self._waiting:
                _, content = self._waiting.popleft()
                self._size -= len(content)
                messages.append((_EVENTS, (content, self._dropped)))
            elif self._answers:
                messages.append(self._answers.popleft())
            self._changed.notify_all()
            return messages
