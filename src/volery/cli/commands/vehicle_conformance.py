"""``volery vehicle conformance``: checks of a driver together with its autopilot."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.status import Status
from rich.table import Column, Table
from rich.text import Text

from volery.cli.command import FAILED, OK, Commands
from volery.cli.console import CommandOutput, make_table
from volery.cli.options import Seed

if TYPE_CHECKING:
    from volery.testing.checks import Check
    from volery.testing.driver_conformance import Report, Result, Show

commands = Commands("vehicle")


@commands.add("quiet", "json", "debug")
def conformance(
    output: CommandOutput,
    url: Annotated[
        str,
        typer.Argument(
            metavar="URL",
            help="Address of the vehicle, such as sim:ardupilot or ardupilot+tcp://127.0.0.1:5760.",
        ),
    ] = "sim:ardupilot",
    only: Annotated[
        str | None, typer.Option(metavar="NAME,...", help="Only these checks, or groups of checks.")
    ] = None,
    only_list: Annotated[
        bool, typer.Option("--list", help="List the checks and what each requires.")
    ] = False,
    kind: Annotated[str, typer.Option(help="drone or rover.")] = "drone",
    allow_flight: Annotated[
        bool,
        typer.Option(
            "--fly", help="Let a real vehicle arm and fly; keep 60 m around home and 30 m above it clear."
        ),
    ] = False,
    second: Annotated[
        str,
        typer.Option(metavar="URL", help="Second link to the same real vehicle, for a second station."),
    ] = "",
    seed: Seed = 1,
    out: Annotated[Path | None, typer.Option(help="Folder for conformance.json.")] = None,
) -> int:
    """Check a driver and its autopilot: readiness, operations, refusals, other stations, the link.

    Each check gets a new simulated vehicle, which flies in virtual time. A real vehicle goes through the
    checks in order and in real time; checks that arm or fly it are skipped without --fly. It is landed after
    each check, and after Ctrl-C, SIGTERM or SIGHUP; if that fails, the report says so. conformance.json is
    written after every check. Exit status: 0 if all checks were run and none failed, 2 for bad input, 1
    otherwise.
    """
    from volery.run.recording import make_folder
    from volery.testing.driver_conformance import Report, chosen
    from volery.testing.driver_conformance import conformance as run_checks

    names = tuple(name.strip() for name in (only or "").split(",") if name.strip())
    if only_list:
        _list_checks(output, chosen(names, kind))
        return OK
    folder = make_folder(out) if out is not None else None
    found: list[Result] = []
    with _progress(output, len(chosen(names, kind))) as progress:

        def show(one: Check, result: Result | None) -> None:
            if result is not None:
                found.append(result)
                _write(folder, Report(url, seed, tuple(found), interrupted=True))
            progress(one, result)

        report = run_checks(url, only=names, kind=kind, fly=allow_flight, seed=seed, second=second, show=show)
    _write(folder, report)
    output.show(_result_table(report), _summary(report))
    output.give(report.as_data())
    for fault in report.faults:
        output.complain(f"volery: {url}: {fault.check}: {fault.detail}")
    if report.interrupted:
        output.complain(f"volery: {url}: interrupted after {len(report.results)} checks")
    if report.left:
        output.complain(f"volery: {url}: THE VEHICLE IS NOT DOWN: {report.left}")
    return OK if report.conforms else FAILED


def _write(folder: Path | None, report: Report) -> None:
    """Replace conformance.json, if there is a folder for it."""
    if folder is None:
        return
    text = json.dumps(report.as_data(), indent=2, ensure_ascii=False)
    part = folder / "conformance.json.part"
    part.write_text(text + "\n", encoding="utf-8")
    part.replace(folder / "conformance.json")


def _list_checks(output: CommandOutput, checks: Sequence[Check]) -> None:
    listed = make_table("group", "check", "flies", "demands")
    for one in checks:
        listed.add_row(one.group, one.name, "yes" if one.flies else "", one.demands)
    output.show(listed)
    output.give(
        [
            {"check": check.name, "group": check.group, "flies": check.flies, "demands": check.demands}
            for check in checks
        ]
    )


def _result_table(report: Report) -> Table:
    from volery.testing.driver_conformance import Outcome

    styles = {Outcome.PASSED: "green", Outcome.FAILED: "bold red"}
    shown = make_table(Column("check", no_wrap=True), Column("result", overflow="fold"))
    group = ""
    for result in report.results:
        if result.group != group:
            shown.add_row(Text(result.group, style="dim"))
        group = result.group
        said = Text(result.outcome.value, style=styles.get(result.outcome, "dim"))
        shown.add_row(
            f"  {result.check}", said.append(f": {result.detail}" if result.detail else "", style="default")
        )
    return shown


def _summary(report: Report) -> Text:
    """Return one line with the number of checks for each outcome."""
    from volery.testing.driver_conformance import Outcome

    counts = dict.fromkeys(Outcome, 0)
    for result in report.results:
        counts[result.outcome] += 1
    parts = [f"{count} {outcome.value}" for outcome, count in counts.items() if count]
    style = "bold green" if report.conforms else "bold red"
    return Text(f"{report.url}: {', '.join(parts)}", style=style)


@contextmanager
def _progress(output: CommandOutput, checks: int) -> Iterator[Show]:
    """Show the check in progress on a terminal; elsewhere print a line for each that has ended."""
    from volery.testing.driver_conformance import Outcome

    done = 0

    def line(one: Check, result: Result | None) -> None:
        nonlocal done
        if result is None:
            return
        done += 1
        detail = f": {result.detail}" if result.outcome is Outcome.FAILED else ""
        output.note(f"{done}/{checks} {one.group}: {one.name}: {result.outcome.value}{detail}")

    if not output.shows_progress:
        yield line
        return
    with Status("", console=output.notes) as status:

        def show(one: Check, result: Result | None) -> None:
            nonlocal done
            if result is None:
                status.update(f"{done} of {checks}; {one.group}: {one.name}")
                return
            done += 1
            if result.outcome is Outcome.FAILED:
                output.complain(f"{one.name}: {result.detail}")

        yield show
