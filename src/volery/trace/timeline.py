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

from volery.base.files import RecordFile
from volery.base.time import Ns
from volery.trace.events import (
    Activation,
    Call,
    Collision,
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
from volery.trace.spans import Spans

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

    For a full disk, see ``RecordFile``.

    Raises:
        UsageError: the file cannot be created.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._output = RecordFile(path)
        self._spans = Spans(self._output.write, self._core, _task)
        self._processes: dict[str, int] = {}
        self._threads: dict[tuple[str, str], str] = {}
        self._quoted: dict[str, str] = {}
        self._tracks: dict[str, tuple[str, str]] = {}  # category and track of the spans of a process
        self._states: dict[tuple[str, str], Milestone] = {}
        self._writers: dict[type[Any], Callable[[Any], None]] = {
            Slice: self._spans.slice,
            Preemption: self._preemption,
            Activation: self._activation,
            Call: self._call,
            Message: self._message,
            Operation: self._operation,
            Milestone: self._milestone,
            LinkState: self._link_state,
            Failure: self._failure,
            Collision: self._collision,
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
        self._spans.end_slices()
        for state in self._states.values():
            self._state_until(state, max(self._spans.last, state.at))
        self._spans.close()
        self._output.close()

    def _preemption(self, event: Preemption) -> None:
        """Write a mark on the track of the core, between the two tasks."""
        name = _quote(f"{event.by} preempts {event.preempted}")
        self._spans.mark(name, "t", event.at, self._core(event.processor, event.core))

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
        self._spans.last = max(self._spans.last, event.at)

    def _state_until(self, state: Milestone, end: Ns) -> None:
        track = f"{state.kind} {state.subject}"
        where = self._thread(_FOLLOWED, track, track)
        self._spans.complete(_quote(state.state), state.at, end, where)

    def _link_state(self, event: LinkState) -> None:
        self._instant(event.at, f"{event.link}: {event.state}", event.detail)

    def _failure(self, event: Failure) -> None:
        self._instant(event.at, f"failure of {event.who}", event.what)

    def _collision(self, event: Collision) -> None:
        self._instant(event.at, f"{event.vehicle} {event}", "")

    def _verdict(self, event: Verdict) -> None:
        self._instant(event.at, f"{event.requirement} {'met' if event.met else 'NOT met'}", event.observable)

    def _span(self, process: str, name: str, start: Ns, end: Ns, details: str) -> None:
        """Write a span that may overlap with others of its process; *name* and *details* are JSON."""
        track = self._tracks.get(process)
        if track is None:
            track = self._tracks[process] = f'"cat":{_quote(process)}', self._thread(process, "", process)
        self._spans.pair(name, start, end, *track, details)

    def _instant(self, at: Ns, name: str, detail: str) -> None:
        where = self._thread(_RUN, "", _RUN)
        self._spans.mark(_quote(name), "g", at, f'{where},"args":{_quote({"detail": detail})}')

    def _core(self, processor: str, core: int) -> str:
        return self._thread(processor, str(core), f"core {core}")

    def _thread(self, process: str, thread: str, name: str) -> str:
        """Return the ``pid`` and ``tid`` of a track, which is named when it first occurs."""
        known = self._threads.get((process, thread))
        if known is not None:
            return known
        if process not in self._processes:
            pid = self._processes[process] = len(self._processes) + 1
            self._spans.add(_introduction("process_name", f'"pid":{pid}', process))
        where = f'"pid":{self._processes[process]},"tid":{len(self._threads) + 1}'
        self._threads[process, thread] = where
        self._spans.add(_introduction("thread_name", where, name))
        return where

    def _name(self, name: str) -> str:
        """Return a name of the model as JSON; there are few, and they repeat."""
        known = self._quoted.get(name)
        if known is None:
            known = self._quoted[name] = _quote(name)
        return known


def _task(task: str, component: str) -> str:
    return _quote(component if task == component else f"{component}/{task}")


def _introduction(what: str, where: str, name: str) -> str:
    return f'{{"name":"{what}","ph":"M",{where},"args":{{"name":{_quote(name)}}}}}'
