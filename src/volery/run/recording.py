"""Recording of a run: the event stream with its taps, and the run folder.

A run without a folder keeps accounts and verdicts only, one that is not traced writes ``run.json``. Any other
writes ``trace.mcap`` and ``timeline.json`` while it runs, and ``run.json`` and the reports at its end; see
``docs/run-folder.md``. Wall time and versions differ between executions of the same run, so they go to
``run.json`` only.
"""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterable, Sequence
from functools import cache, partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from time import perf_counter
from typing import Protocol

from volery.base.errors import UsageError
from volery.base.files import create_file
from volery.base.installed import MissingExtraError, Registry
from volery.base.time import Ns
from volery.requirements.accounts import Accounts, Circumstances
from volery.requirements.record import RUN_FILE, RunRecord, Status, write_record
from volery.run.event_log import EventLog, LogOptions
from volery.trace.attachments import RunSetup
from volery.trace.events import Event, Verdict
from volery.trace.mcap_writer import TRACE_FILE, Attachment, McapWriter
from volery.trace.stream import Stream
from volery.trace.timeline import TimelineWriter

_LIBRARIES = ("greenlet", "llvmlite", "numba", "numpy", "pymavlink", "rosbags", "mcap")


@cache
def _versions() -> dict[str, str]:
    """Return the versions of what is installed; a reading of each package's metadata takes 0.3 ms."""
    versions = {}
    for name in (*_LIBRARIES, "volery"):
        try:
            versions[name] = version(name)
        except PackageNotFoundError:  # not installed, or volery is run from a checkout
            continue
    return versions | {
        "python": platform.python_version(),
        "platform": f"{platform.system()} {platform.machine()}",
    }


TIMELINE_FILE = "timeline.json"
REPORT_FILE = "report.html"


class Reporter(Protocol):
    """Makes a document of a run: a listener of its events (see ``Stream``) that writes at the end."""

    def __call__(self, event: Event) -> None:
        """Take an event."""

    def write(self, record: RunRecord, folder: Path) -> Path:
        """Write the document into a finished run folder and return its path."""


ReporterClass = Callable[[RunSetup, Sequence[Attachment]], Reporter]
"""Makes the reporter of one run from its set-up and the attachments of its trace."""

reporters: Registry[ReporterClass] = Registry("volery.reporters", "report")


def make_folder(out: Path) -> Path:
    """Create the folder *out* if it is missing. Raises ``UsageError`` if it cannot be written."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        probe = out / ".writable"
        create_file(probe).close()
        probe.unlink()
    except OSError as error:
        raise UsageError(
            f"cannot write into {out}: {error.strerror or error}; choose another with --out"
        ) from error
    return out


class Recording:
    """The event stream of one run and everything that records it.

    ``problems`` lists files that could not be written, ``notes`` documents that need a missing extra.
    """

    def __init__(
        self,
        setup: RunSetup,
        out: Path | None,
        attachments: Sequence[Attachment] = (),
        *,
        traced: bool = True,
    ) -> None:
        self.stream = Stream()
        self.accounts = Accounts(setup)
        self.folder = make_folder(out) if out is not None else None
        self.problems: list[str] = []
        self.notes: list[str] = []
        self._start = perf_counter()
        self._trace: McapWriter | None = None
        self._timeline: TimelineWriter | None = None
        self._log: EventLog | None = None
        self._reporters: dict[str, Reporter] = {}
        self.stream.tap(self.accounts)
        if self.folder is not None:
            _forget_earlier_run(self.folder)
        if self.folder is not None and traced:
            self._start_reporters(setup, attachments)
            self._trace = McapWriter(self.folder / TRACE_FILE, setup, attachments, _definition)
            self._timeline = TimelineWriter(self.folder / TIMELINE_FILE)
            self.stream.tap(self._trace)
            self.stream.tap(self._timeline)

    def _start_reporters(self, setup: RunSetup, attachments: Sequence[Attachment]) -> None:
        for name in reporters.names():
            try:
                reporter = reporters.load(name)(setup, attachments)
            except MissingExtraError as error:
                self.notes.append(str(error))
                continue
            self._reporters[name] = reporter
            self.stream.tap_guarded(reporter, partial(self._drop_reporter, name))

    def _drop_reporter(self, name: str, error: Exception) -> None:
        del self._reporters[name]
        what = f"the report {name!r} was not made: {type(error).__name__}: {error}"
        self.problems.append(f"{what}; the other files are complete")

    def log_into(self, wanted: LogOptions) -> None:
        """Write the lines of a log from now on. Raises ``UsageError`` if the file cannot be written."""
        self._log = EventLog(wanted)
        self.stream.tap(self._log)

    def finish(self, status: Status, reason: str, ended: Ns, verdicts: Iterable[Verdict]) -> RunRecord:
        """Record the verdicts, close the files, write the documents and return the record."""
        for verdict in verdicts:
            self.stream(verdict)
        if self._trace is not None:
            self._trace.outcome(status, reason)
        if self._log is not None:
            self._log.outcome(ended, status, reason)
        for writer in (self._trace, self._timeline, self._log):
            if writer is not None:
                writer.close()
                self.problems += [writer.problem] if writer.problem else []
        circumstances = Circumstances(perf_counter() - self._start, _versions())
        record = self.accounts.record(status, reason, ended, circumstances)
        if self.folder is not None:
            self._write_documents(record, self.folder)
        return record

    def _write_documents(self, record: RunRecord, folder: Path) -> None:
        try:
            write_record(record, folder)
            for reporter in self._reporters.values():
                reporter.write(record, folder)
        except (UsageError, OSError) as error:
            self.problems.append(str(error))


def _definition(message_type: str) -> str:
    """Return the definition of a ROS message type, for the schema of a topic in the trace."""
    from volery.ros.messages.store import definition

    return definition(message_type)


def _forget_earlier_run(folder: Path) -> None:
    """Remove the results of an earlier run, which would look like those of this one if it is killed."""
    for name in (RUN_FILE, REPORT_FILE, TRACE_FILE, TIMELINE_FILE):
        (folder / name).unlink(missing_ok=True)
