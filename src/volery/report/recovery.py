"""The documents of a run folder, made anew: also of one whose run was killed and left its trace alone."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from volery.report.document import TRACE_FILE, status_of, write_report
from volery.requirements.accounts import Accounts
from volery.requirements.observables import Observers, bounds_of
from volery.requirements.record import RUN_FILE, RunRecord, read_record, write_record
from volery.trace.events import Verdict
from volery.trace.mcap_writer import OUTCOME
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

    The recovered record has no wall time and no versions, for these stand nowhere but in ``run.json``.
    Requirements that the run did not come to judge are judged by what the trace holds. Raises ``UsageError``
    if there is no trace or it breaks off before its set-up.
    """
    lost = ""
    if not (folder / RUN_FILE).exists():
        record, lost = _rebuild(folder)
        write_record(record, folder)
    return Recovered(read_record(folder), write_report(folder), lost)


def _rebuild(folder: Path) -> tuple[RunRecord, str]:
    with Reading(folder / TRACE_FILE) as reading:
        accounts = Accounts(reading.setup)
        observers = Observers(bounds_of(reading.setup), reading.setup)
        timeline = TimelineWriter(folder / TIMELINE_FILE)
        judged = False
        for event in reading.events():
            accounts(event)
            observers(event)
            timeline(event)
            judged = judged or isinstance(event, Verdict)
        if not judged:
            for verdict in observers.verdicts(accounts.last):
                accounts(verdict)
                timeline(verdict)
        timeline.close()
        ending = reading.metadata.get(OUTCOME, {})
        reason = ending.get("reason", "") or reading.lost
        return accounts.record(status_of(ending), reason), reading.lost
