"""The log file of a run: one line for what happens, for people and ``grep``.

The trace has everything; the log has what one reads first: log lines of components, status texts of
autopilots, links, ends of operations, milestones, failures, verdicts. Times are those of the run, so the same
seed gives the same log.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import isnan
from pathlib import Path

from volery.base.errors import UsageError, choices, did_you_mean
from volery.base.time import Ns, clock
from volery.trace.events import Collision, Event, Failure, LinkState, Milestone, Operation, Text, Verdict

LEVELS = {"error": 3, "warning": 4, "info": 6, "debug": 7}
"""Levels and the syslog severity up to which each shows lines."""

WHO = "volery"

Entry = tuple[Ns, int, str, str]
"""Time, severity, source and text of a line."""


@dataclass(frozen=True)
class LogOptions:
    """Options of a log.

    Attributes:
        file: The file; an earlier one is replaced.
        severity: Greatest syslog severity that is written, 0 to 7.
    """

    file: Path
    severity: int = LEVELS["info"]


def parse_level(level: str) -> int:
    """Return the syslog severity of a level. Raises ``UsageError`` for any other word."""
    if level not in LEVELS:
        hint = did_you_mean(level, LEVELS)
        raise UsageError(f"--log-level {level}: there is {choices(LEVELS)}{hint}")
    return LEVELS[level]


class EventLog:
    """Stream tap that writes the log. ``problem`` is empty, or says why lines are missing.

    Raises:
        UsageError: The file cannot be written.
    """

    def __init__(self, wanted: LogOptions) -> None:
        self._severity = wanted.severity
        self._path = wanted.file
        self.problem = ""
        try:
            self._file = wanted.file.open("w", encoding="utf-8")
        except OSError as error:
            raise UsageError(f"cannot write {wanted.file}: {error.strerror or error}") from error

    def __call__(self, event: Event) -> None:
        """Write the line of *event*, if it has one."""
        entry = entry_of(event)
        if entry is not None:
            self._write(entry)

    def outcome(self, at: Ns, status: str, reason: str) -> None:
        """Write the last line: how the run ended."""
        severity = LEVELS["info" if status == "completed" else "error"]
        self._write((at, severity, WHO, f"{status}: {reason}" if reason else status))

    def close(self) -> None:
        """Close the file."""
        self._guarded(self._file.close)

    def _write(self, entry: Entry) -> None:
        at, severity, source, text = entry
        if severity > self._severity or self.problem:
            return
        level = next(name for name, most in LEVELS.items() if severity <= most)
        line = f"{clock(at)} {level:7} {source}: {' '.join(text.split())}\n"
        self._guarded(lambda: self._file.write(line))
        self._guarded(self._file.flush)

    def _guarded(self, write: Callable[[], object]) -> None:
        try:
            write()
        except OSError as error:
            self.problem = self.problem or f"{self._path}: {error.strerror or error}; its end is missing"


def entry_of(event: Event) -> Entry | None:
    """Return the line of an event, or None for the events that only the trace has."""
    info, warning, error = LEVELS["info"], LEVELS["warning"], LEVELS["error"]
    entry: Entry | None = None
    match event:
        case Text():
            entry = event.at, event.severity, event.source, event.text
        case Failure():
            entry = event.at, error, event.who, event.what
        case Collision():
            entry = event.at, error, event.vehicle, str(event)
        case Operation():
            good = event.outcome == "ok"
            text = f"{event.asked}: done" if good else f"{event.asked}: {event.outcome}: {event.said}"
            entry = event.end, info if good else warning, event.vehicle, text
        case Milestone():
            text = f"{event.kind} {event.subject}: {event.state} {event.detail}"
            entry = event.at, info, event.component or WHO, text
        case LinkState():
            entry = event.at, info, event.link, f"{event.state} {event.detail}"
        case Verdict():
            observed = "was never observed" if isnan(event.observed) else f"is {event.observed:g}"
            bound = f"{event.relation} {event.bound:g}"
            text = f"{event.requirement}: {event.observable} {observed}, required is {bound}"
            entry = event.at, info if event.met else error, WHO, text
    return entry
