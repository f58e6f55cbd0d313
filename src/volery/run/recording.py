"""What is kept of a run: the stream with its taps, and the run folder.

A run without a folder keeps accounts and verdicts alone. With one it writes ``trace.mcap`` and
``timeline.json`` as it goes, and ``run.json`` and the reports at its end; see ``docs/run-folder.md``.

What differs from one execution of the same run to the next: wall time and versions. They go to
``run.json`` only.
"""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from time import perf_counter

from volery.base.errors import UsageError
from volery.base.registry import Registry
from volery.base.time import Ns
from volery.requirements.accounts import Accounts, Circumstances
from volery.requirements.record import RUN_FILE, RunRecord, Status, write_record
from volery.ros.messages.store import definition
from volery.trace.attachments import RunSetup
from volery.trace.events import Stream, Verdict
from volery.trace.mcap_writer import Attachment, McapWriter
from volery.trace.timeline import TimelineWriter

_LIBRARIES = ("greenlet", "llvmlite", "numba", "numpy", "pymavlink", "rosbags", "mcap")


class Stopwatch:
    """Seconds of wall time since it was made."""

    def __init__(self) -> None:
        self._start = perf_counter()

    def seconds(self) -> float:
        """Seconds so far."""
        return perf_counter() - self._start


def own_version() -> str:
    """The version of this package; ``0`` if it is run without being installed."""
    try:
        return version("volery")
    except PackageNotFoundError:
        return "0"


def circumstances(watch: Stopwatch) -> Circumstances:
    """For the record of a run that *watch* was started with."""
    versions = {name: version(name) for name in _LIBRARIES}
    versions |= {
        "volery": own_version(),
        "python": platform.python_version(),
        "platform": f"{platform.system()} {platform.machine()}",
    }
    return Circumstances(watch.seconds(), versions)


TRACE_FILE = "trace.mcap"
TIMELINE_FILE = "timeline.json"
REPORT_FILE = "report.html"

ReportWriter = Callable[[Path], Path]
"""Makes a document out of a finished run folder and says where it is."""

reporters: Registry[ReportWriter] = Registry("volery.reporters", "report")


def make_folder(out: Path) -> Path:
    """*out* as an existing, writable folder; ``UsageError`` says why not."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        probe = out / ".writable"
        probe.write_bytes(b"")
        probe.unlink()
    except OSError as error:
        raise UsageError(
            f"cannot write into {out}: {error.strerror or error}; choose another with --out"
        ) from error
    return out


class Recording:
    """The stream of one run and everything that listens to it."""

    def __init__(self, setup: RunSetup, out: Path | None, attachments: Iterable[Attachment] = ()) -> None:
        self.stream = Stream()
        self.accounts = Accounts(setup)
        self.folder = make_folder(out) if out is not None else None
        self.problems: list[str] = []
        self._watch = Stopwatch()
        self._trace: McapWriter | None = None
        self._timeline: TimelineWriter | None = None
        self.stream.tap(self.accounts)
        if self.folder is not None:
            _forget_earlier_run(self.folder)
            self._trace = McapWriter(self.folder / TRACE_FILE, setup, attachments, definition)
            self._timeline = TimelineWriter(self.folder / TIMELINE_FILE)
            self.stream.tap(self._trace)
            self.stream.tap(self._timeline)

    def finish(self, status: Status, reason: str, ended: Ns, verdicts: Iterable[Verdict]) -> RunRecord:
        """Close the books and the files. What could not be written stands in ``problems``."""
        for verdict in verdicts:
            self.stream(verdict)
        if self._trace is not None:
            self._trace.outcome(status, reason)
        for writer in (self._trace, self._timeline):
            if writer is not None:
                writer.close()
                self.problems += [writer.problem] if writer.problem else []
        record = self.accounts.record(status, reason, ended, circumstances(self._watch))
        if self.folder is not None:
            self._write_documents(record, self.folder)
        return record

    def _write_documents(self, record: RunRecord, folder: Path) -> None:
        try:
            write_record(record, folder)
            for name in reporters.names():
                reporters.load(name)(folder)
        except (UsageError, OSError) as error:
            self.problems.append(str(error))


def _forget_earlier_run(folder: Path) -> None:
    """What an earlier run came to must not be taken for this one's, should this one be killed."""
    for name in (RUN_FILE, REPORT_FILE):
        (folder / name).unlink(missing_ok=True)
