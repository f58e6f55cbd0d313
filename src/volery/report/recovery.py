"""The documents of a run folder, made anew: also of one whose run was killed and left its trace alone."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from volery.report.document import TRACE_FILE, gather, write_document
from volery.requirements.record import RUN_FILE, RunRecord, write_record
from volery.trace.reader import Reading
from volery.trace.timeline import TimelineWriter

TIMELINE_FILE = "timeline.json"


class Recovered(NamedTuple):
    """What was made: the record, the report, and in words what of the trace is missing (empty: nothing)."""

    record: RunRecord
    report: Path
    lost: str


def recover(folder: Path) -> Recovered:
    """Write ``report.html``, and ``run.json`` and ``timeline.json`` too if the run did not.

    A recovered record has no wall time and no versions, for these stand nowhere but in ``run.json``. Raises
    ``UsageError`` as ``gather`` does.
    """
    if (folder / RUN_FILE).exists():
        material = gather(folder)
    else:
        with Reading(folder / TRACE_FILE):
            pass  # raises before a file is made
        timeline = TimelineWriter(folder / TIMELINE_FILE)
        try:
            material = gather(folder, timeline)
        finally:
            timeline.close()
        write_record(material.record, folder)
    return Recovered(material.record, write_document(material, folder), material.lost)
