"""Writer of ``timeline.json``: which task ran on which core when, for https://ui.perfetto.dev and chrome://tracing.

The trace-event format (*Trace Event Format*, Google, 2016) as its JSON array, which by its definition may
lack the closing bracket: a file whose writer was killed opens as far as it goes. A process of the timeline is
a processor of the run and a thread one of its cores; preemptions are marked there. Activations, messages that
took time (both with the names of ros2_tracing for their begin and end), calls, vehicle operations and what
the application follows have tracks of their own. The format's time is microseconds; three decimals keep the
nanoseconds.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from volery.base.files import Output
from volery.base.time import Ns
from volery.trace.events import (
    Activation,
    Call,
    Event,
    Failure,
    LinkState,
    Message,
    Milestone,
    Operation,
    Preemption,
    Record,
    Slice,
    Verdict,
)

_quote = json.JSONEncoder(ensure_ascii=False).encode

_CALLBACK = '"begin": "callback_start", "end": "callback_end"'
_MESSAGE = '"begin": "rclcpp_publish", "end": "rclcpp_take"'
_ACTIVATIONS = "activations"
_CALLS = "calls"
_MESSAGES = "messages"
_OPERATIONS = "vehicle operations"
_FOLLOWED = "followed"
_RUN = "the run"


class TimelineWriter:
    """A listener of the event stream that writes ``timeline.json``. Call it with events, then ``close`` it.

    For a full disk, see ``Output``.

    Raises:
        UsageError: the file cannot be created.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._output = Output(path)
        self._lines: list[str] = []
        self._first = True
        self._processes: dict[str, int] = {}
        self._threads: dict[tuple[str, str], str] = {}
        self._spans = 0
        self._running: dict[tuple[Any, ...], tuple[Ns, Slice]] = {}
        self._cores: dict[tuple[Any, ...], str] = {}
        self._names: dict[tuple[Any, ...], str] = {}
        self._quoted: dict[str, str] = {}
        self._tracks: dict[str, tuple[str, str]] = {}  # category and track of the spans of a process
        self._states: dict[tuple[str, str], Milestone] = {}
        self._last: Ns = 0
        self._writers: dict[type[Any], Callable[[Any], None]] = {
            Slice: self._slice,
            Preemption: self._preemption,
            Activation: self._activation,
            Call: self._call,
            Message: self._message,
            Operation: self._operation,
            Milestone: self._milestone,
            LinkState: self._link_state,
            Failure: self._failure,
            Verdict: self._verdict,
        }

    @property
    def problem(self) -> str:
        """Why the timeline is incomplete; empty if it is complete."""
        return self._output.problem

    def listener(self, kind: type[Any]) -> Record | None:
        """Return what writes events of *kind*, None if the timeline does not show them."""
        return self._writers.get(kind)

    def __call__(self, event: Event) -> None:
        """Write one event, if the timeline shows its kind."""
        writer = self._writers.get(type(event))
        if writer is not None:
            writer(event)

    def close(self) -> None:
        """End what is still in progress, and close the file. A second call does nothing."""
        if self._output.closed:
            return
        for running in self._running.values():
            self._ran(*running)
        for state in self._states.values():
            self._state_until(state, max(self._last, state.at))
        self._write_out()
        self._output.write(b"[]\n" if self._first else b"\n]\n")
        self._output.close()

    def _slice(self, event: Slice) -> None:
        """Write slices of one task that follow each other without a gap as one."""
        core = event[2:4]
        running = self._running.get(core)
        if running is None:
            self._running[core] = (event.start, event)
        elif running[1].end == event.start and running[1][4:] == event[4:]:
            self._running[core] = (running[0], event)
        else:
            self._ran(*running)
            self._running[core] = (event.start, event)

    def _ran(self, start: Ns, event: Slice) -> None:
        where = self._cores.get(event[2:4])
        if where is None:
            where = self._thread(event.processor, str(event.core), f"core {event.core}")
            self._cores[event[2:4]] = where
        name = self._names.get(event[4:])
        if name is None:
            whole = event.component if event.task == event.component else f"{event.component}/{event.task}"
            name = self._names[event[4:]] = _quote(whole)
        self._complete(name, start, event.end, where)

    def _preemption(self, event: Preemption) -> None:
        """Write a mark on the track of the core, between the two tasks."""
        where = self._cores.get(event[1:3]) or self._thread(
            event.processor, str(event.core), f"core {event.core}"
        )
        name = _quote(f"{event.by} preempts {event.preempted}")
        self._line(f'{{"name":{name},"ph":"i","s":"t","ts":{_microseconds(event.at)},{where}}}')

    def _activation(self, event: Activation) -> None:
        details = f'{{"deadline": {event.deadline}, {_CALLBACK}}}'
        self._span(_ACTIVATIONS, self._name(event.component), event.released, event.finished, details)

    def _message(self, event: Message) -> None:
        """Write a message that took time; lost and immediate ones do not show."""
        if event.received > event.sent:
            ends = f'"from": {self._name(event.publisher)}, "to": {self._name(event.subscriber)}'
            details = f'{{{ends}, "bytes": {event.size}, {_MESSAGE}}}'
            self._span(_MESSAGES, self._name(event.topic), event.sent, event.received, details)

    def _call(self, event: Call) -> None:
        name = f"{event.callee}.{event.operation}"
        details = {"caller": event.caller, "outcome": event.outcome}
        self._span(_CALLS, _quote(name), event.start, event.end, _quote(details))

    def _operation(self, event: Operation) -> None:
        details = {"asked": event.asked, "outcome": event.outcome, "said": event.said}
        name = _quote(f"{event.vehicle}.{event.operation}")
        self._span(_OPERATIONS, name, event.start, event.end, _quote(details))

    def _milestone(self, event: Milestone) -> None:
        key = (event.kind, event.subject)
        before = self._states.get(key)
        if before is not None:
            self._state_until(before, event.at)
        self._states[key] = event
        self._last = max(self._last, event.at)

    def _state_until(self, state: Milestone, end: Ns) -> None:
        track = f"{state.kind} {state.subject}"
        self._complete(_quote(state.state), state.at, end, self._thread(_FOLLOWED, track, track))

    def _link_state(self, event: LinkState) -> None:
        self._instant(event.at, f"{event.link}: {event.state}", event.detail)

    def _failure(self, event: Failure) -> None:
        self._instant(event.at, f"failure of {event.who}", event.what)

    def _verdict(self, event: Verdict) -> None:
        self._instant(event.at, f"{event.requirement} {'met' if event.met else 'NOT met'}", event.observable)

    def _complete(self, name: str, start: Ns, end: Ns, where: str) -> None:
        """Write a span of a track whose spans do not overlap; *name* is JSON already."""
        self._last = max(self._last, end)
        times = f'"ts":{_microseconds(start)},"dur":{_microseconds(end - start)}'
        self._line(f'{{"name":{name},"ph":"X",{times},{where}}}')

    def _span(self, process: str, name: str, start: Ns, end: Ns, details: str) -> None:
        """Write a span that may overlap with others: an asynchronous pair; *name* and *details* are JSON."""
        self._last = max(self._last, end)
        self._spans += 1
        track = self._tracks.get(process)
        if track is None:
            track = self._tracks[process] = f'"cat":{_quote(process)}', self._thread(process, "", process)
        common = f'{track[0]},"id":{self._spans},{track[1]}'
        self._line(f'{{"name":{name},"ph":"b","ts":{_microseconds(start)},{common},"args":{details}}}')
        self._line(f'{{"name":{name},"ph":"e","ts":{_microseconds(end)},{common}}}')

    def _instant(self, at: Ns, name: str, detail: str) -> None:
        self._last = max(self._last, at)
        where = self._thread(_RUN, "", _RUN)
        arguments = _quote({"detail": detail})
        time = _microseconds(at)
        self._line(f'{{"name":{_quote(name)},"ph":"i","s":"g","ts":{time},{where},"args":{arguments}}}')

    def _thread(self, process: str, thread: str, name: str) -> str:
        """Return the ``pid`` and ``tid`` of a track, which is named when it first occurs."""
        known = self._threads.get((process, thread))
        if known is not None:
            return known
        if process not in self._processes:
            pid = self._processes[process] = len(self._processes) + 1
            self._line(_introduction("process_name", f'"pid":{pid}', process))
        where = f'"pid":{self._processes[process]},"tid":{len(self._threads) + 1}'
        self._threads[process, thread] = where
        self._line(_introduction("thread_name", where, name))
        return where

    def _name(self, name: str) -> str:
        """Return a name of the model as JSON; there are few, and they repeat."""
        known = self._quoted.get(name)
        if known is None:
            known = self._quoted[name] = _quote(name)
        return known

    def _line(self, line: str) -> None:
        self._lines.append(line)
        if len(self._lines) >= 1000:
            self._write_out()

    def _write_out(self) -> None:
        if self._lines:
            text = ("[\n" if self._first else ",\n") + ",\n".join(self._lines)
            self._output.write(text.encode("utf-8", "replace"))
            self._first = False
        self._lines.clear()


def _introduction(what: str, where: str, name: str) -> str:
    return f'{{"name":"{what}","ph":"M",{where},"args":{{"name":{_quote(name)}}}}}'


def _microseconds(ns: Ns) -> str:
    return f"{ns // 1000}.{ns % 1000:03d}"
