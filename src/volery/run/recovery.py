"""Recovery of a run whose process has died: its recording is finished by the process that survived."""

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
"""Name of the truncated trace while the trace is written again."""


def recover_run(
    system: System, out: Path | None, seed: int, fidelity: str, error: VoleryError, blamed: str
) -> Run:
    """Return a failed ``Run`` from what its process has recorded.

    The trace is written again up to its truncation, followed by the failure, the verdicts and the usual
    documents.

    Args:
        system: The model.
        out: Run folder; None if nothing was kept.
        seed: Seed of the run.
        fidelity: Fidelity of the run.
        error: What ended the process.
        blamed: Component that failed, or ``run``.
    """
    cut = _set_aside(out) if out is not None else None
    platform = Platform(system, VirtualKernel(), seed, fidelity)
    platform.look_up_prices()
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
    """Yield the events of the truncated trace; none if it ends before its header."""
    if cut is None:
        return
    try:
        with Reading(cut) as reading:
            yield from (event for event in reading.events() if not isinstance(event, Verdict))
    except UsageError:
        return
