"""``volery demo``: the delivery service on each of its allocations, side by side."""

from __future__ import annotations

from pathlib import Path

from volery.cli.console import Output
from volery.cli.endings import FAILED, OK
from volery.cli.folders import example
from volery.cli.outcome import unmet
from volery.cli.side_by_side import Job, Outcome, run_all
from volery.model.reader import load
from volery.report.document import write_comparison
from volery.report.terminal import short_comparison
from volery.requirements.record import RunRecord
from volery.run.assembly.vocabulary import vocabulary
from volery.run.recording import make_folder

MODEL = "delivery"


def demo(output: Output, out: Path, seed: int) -> int:
    """Run it; 0 if both runs completed, whatever the requirements say."""
    model = example(MODEL)
    names = load(model, vocabulary()).allocations[:2]
    outcomes = run_all(output, {name: Job(model, name, seed, make_folder(out / name)) for name in names})
    records = [outcome.record for outcome in outcomes.values()]
    output.show(*_parcels(records[0]), short_comparison(records, list(outcomes)))
    output.give(f"[{', '.join(record.model_dump_json(by_alias=True) for record in records)}]")
    for name, outcome in outcomes.items():
        _say(output, name, outcome)
    beside = write_comparison([outcome.folder for outcome in outcomes.values()], out)
    output.note(f"side by side: {beside}")
    return OK if all(outcome.completed for outcome in outcomes.values()) else FAILED


def _parcels(record: RunRecord) -> list[str]:
    """One line for each parcel: where it ended and when."""
    return [
        f"{name}: {parcel.state} at {parcel.history[-1].at_s:.0f} s {parcel.history[-1].detail}".rstrip()
        for name, parcel in record.parcels.items()
    ]


def _say(output: Output, name: str, outcome: Outcome) -> None:
    for requirement, found in outcome.record.requirements.items():
        if found.met is False:
            output.note(f"{name}: {unmet(requirement, found)}")
    for complaint in outcome.complaints:
        output.complain(f"volery: {name}: {complaint}")
    output.note(f"report: {outcome.folder / 'report.html'}")
