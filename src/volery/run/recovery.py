"""The books of a run whose process has died, closed by whoever survived it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from volery.base.errors import UsageError, VoleryError
from volery.kernel.virtual import VirtualKernel
from volery.model.system import System
from volery.requirements.verdicts import Observers
from volery.run.assembly.computers import Platform
from volery.run.recording import Recording
from volery.run.result import Run
from volery.run.trace_setup import attachments_of, setup_of
from volery.trace.events import Event, Failure, Verdict
from volery.trace.mcap_writer import TRACE_FILE
from volery.trace.reader import Reading

CUT_FILE = "trace-cut.mcap"
"""The trace as the process left it, while it is written anew."""


def recover_run(
    system: System, out: Path | None, seed: int, fidelity: str, error: VoleryError, blamed: str
) -> Run:
    """A ``Run`` that failed with *error*, with all that its trace in *out* still says.

    The trace is written anew up to where it was cut, then the failure of *blamed*, the verdicts and the
    usual documents. Without *out* there is the failure alone.
    """
    cut = _set_aside(out) if out is not None else None
    platform = Platform(system, VirtualKernel(), seed, fidelity)
    platform.foresee()
    setup = setup_of(system, platform, seed, fidelity)
    recording = Recording(setup, out, attachments_of(system))
    observers = Observers(system.requirements, setup)
    recording.stream.tap(observers)
    for event in _events(cut):
        recording.stream(event)
    ended = recording.accounts.last
    what = str(error).removeprefix(f"{blamed}: ")
    recording.stream(Failure(ended, blamed, what))
    record = recording.finish("failed", str(error), ended, observers.verdicts(ended))
    if cut is not None:
        cut.unlink()
    return Run(record, recording.folder, error, (), tuple(recording.problems), tuple(recording.notes))


def _set_aside(out: Path) -> Path | None:
    trace = out / TRACE_FILE
    return trace.replace(out / CUT_FILE) if trace.exists() else None


def _events(cut: Path | None) -> Iterator[Event]:
    """What the trace says; nothing if it was cut before it said anything."""
    if cut is None:
        return
    try:
        with Reading(cut) as reading:
            yield from (event for event in reading.events() if not isinstance(event, Verdict))
    except UsageError:
        return
