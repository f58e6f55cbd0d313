"""``volery demo``: the delivery service on each of its allocations, side by side."""

from __future__ import annotations

from pathlib import Path

from volery.cli.console import Output
from volery.cli.endings import FAILED, OK
from volery.cli.folders import example
from volery.cli.progress import shown
from volery.model.reader import load
from volery.report.terminal import short_comparison
from volery.requirements.record import RunRecord
from volery.run.result import Run
from volery.run.simulate import Options, simulate
from volery.run.vocabulary import vocabulary

MODEL = "delivery"


def demo(output: Output, out: Path, seed: int) -> int:
    """Run it; 0 if both runs completed, whatever the requirements say."""
    model = example(MODEL)
    names = load(model, vocabulary()).allocations[:2]
    runs: dict[str, Run] = {}
    for name in names:
        runs[name] = _run(output, model, name, out / name, seed)
        if not runs[name].completed:
            break
    records = [run.record for run in runs.values()]
    output.show(*_parcels(records[0]), short_comparison(records, list(runs)))
    output.give(f"[{', '.join(record.model_dump_json(by_alias=True) for record in records)}]")
    for name, run in runs.items():
        _say(output, name, run)
    whole = len(runs) == len(names) and all(run.completed and not run.problems for run in runs.values())
    return OK if whole else FAILED


def _run(output: Output, model: Path, allocation: str, out: Path, seed: int) -> Run:
    with shown(output, f"{MODEL} · {allocation}") as show:
        options = Options("code", seed, None, out, show)
        return simulate(model, options, allocation=allocation)


def _parcels(record: RunRecord) -> list[str]:
    """One line for each parcel: where it ended and when."""
    return [
        f"{name}: {parcel.state} at {parcel.history[-1].at_s:.0f} s {parcel.history[-1].detail}".rstrip()
        for name, parcel in record.parcels.items()
    ]


def _say(output: Output, name: str, run: Run) -> None:
    for requirement, found in run.record.requirements.items():
        if found.met is False:
            output.note(f"{name}: the requirement {requirement!r} ({found.observable}) is not met")
    if not run.completed:
        output.complain(f"volery: {name}: {run.record.outcome.status}: {run.record.outcome.reason}")
    for problem in run.problems:
        output.complain(f"volery: {name}: {problem}")
    if run.folder is not None:
        output.note(f"report: {run.folder / 'report.html'}")
