"""``volery conformance``."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from rich.status import Status
from rich.table import Column, Table
from rich.text import Text

from volery.cli.console import Output, table
from volery.cli.endings import FAILED, OK
from volery.run.recording import make_folder
from volery.testing.checks import Check
from volery.testing.driver_conformance import Outcome, Report, Result, Show, chosen, conformance

STYLES = {
    Outcome.PASSED: "green",
    Outcome.LACKING: "dim",
    Outcome.IMPOSSIBLE: "dim",
    Outcome.FAILED: "bold red",
}


@dataclass(frozen=True)
class Wanted:
    """What was asked for."""

    url: str
    only: tuple[str, ...]
    kind: str
    fly: bool
    second: str
    seed: int
    out: Path | None


def check(output: Output, wanted: Wanted) -> int:
    """Run the checks and show what was found; the exit status."""
    folder = make_folder(wanted.out) if wanted.out is not None else None
    with _shown(output) as show:
        report = conformance(
            wanted.url,
            only=wanted.only,
            kind=wanted.kind,
            fly=wanted.fly,
            seed=wanted.seed,
            second=wanted.second,
            show=show,
        )
    if folder is not None:
        text = json.dumps(report.as_data(), indent=2, ensure_ascii=False)
        (folder / "conformance.json").write_text(text + "\n", encoding="utf-8")
    output.show(*_tables(report))
    output.give(report.as_data())
    for fault in report.faults:
        output.complain(f"volery: {wanted.url}: {fault.check}: {fault.detail}")
    return OK if report.conforms else FAILED


def show_checks(output: Output, only: Sequence[str], kind: str) -> int:
    """Show which checks there are and what each demands; the exit status."""
    wanted = chosen(only, kind)
    listed = table("group", "check", "flies", "demands")
    for one in wanted:
        listed.add_row(one.group, one.name, "yes" if one.flies else "", one.demands)
    output.show(listed)
    output.give(
        [
            {"check": one.name, "group": one.group, "flies": one.flies, "demands": one.demands}
            for one in wanted
        ]
    )
    return OK


def _tables(report: Report) -> list[Table | Text]:
    shown = table(
        Column("group", style="dim"),
        Column("check", no_wrap=True),
        Column("found", no_wrap=True),
        Column("noted", overflow="fold"),
    )
    group = ""
    for one in report.results:
        shown.add_row(
            "" if one.group == group else one.group,
            one.check,
            Text(one.outcome.value, style=STYLES[one.outcome]),
            Text(one.detail),
        )
        group = one.group
    return [shown, Text(summary(report), style="bold green" if report.conforms else "bold red")]


def summary(report: Report) -> str:
    """In one line, how many checks ended how."""
    counts = dict.fromkeys(Outcome, 0)
    for one in report.results:
        counts[one.outcome] += 1
    said = [f"{count} {outcome.value}" for outcome, count in counts.items() if count]
    return f"{report.url}: {', '.join(said)}"


@contextmanager
def _shown(output: Output) -> Iterator[Show | None]:
    """The check that is under way, where somebody watches."""
    if not output.shows_progress:
        yield None
        return
    with Status("", console=output.notes) as status:
        done = [0]

        def show(one: Check, result: Result | None) -> None:
            if result is None:
                status.update(f"{done[0]} done; {one.group}: {one.name}")
                return
            done[0] += 1
            if result.outcome is Outcome.FAILED:
                output.complain(f"{one.name}: {result.detail}")

        yield show
