"""``volery cost calibrate``: measurements of this machine as entries of a catalogue."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from volery.base.errors import UsageError
from volery.cli.command import FAILED, OK, Commands
from volery.cli.console import CommandOutput, make_table, number_column
from volery.cli.options import CATALOGUE, CatalogueFile, EntryName, Frequency

if TYPE_CHECKING:
    from volery.calibration.operation_costs import Calibration
    from volery.calibration.ros.call_costs import CallCost
    from volery.cost import CoreLaw, OperationTable

commands = Commands("cost calibrate", "Measure the cost of computing on this machine.")

MAX_LOOSE_SHOWN = 5
"""Number of uncertain figures that are named."""


@contextmanager
def _progress_bar(
    output: CommandOutput, description: str, detail: str
) -> Iterator[Callable[[int, int, str], None]]:
    """Yield a function that shows *done* of *total* rounds and a detail."""
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[detail]}"))
    with Progress(
        *columns, TimeElapsedColumn(), console=output.notes, disable=not output.shows_progress
    ) as bar:
        task = bar.add_task(description, total=None, detail=detail)
        yield lambda done, total, detail: bar.update(task, total=total, completed=done, detail=detail)


@commands.add("quiet", "json", "debug")
def ros(
    output: CommandOutput,
    client: Annotated[str, typer.Option(metavar="roscpp|rospy|rclpy", help="Client library.")],
    out: CatalogueFile = CATALOGUE,
    frequency: Frequency = None,
    name: EntryName = "",
    python: Annotated[
        str, typer.Option(metavar="PATH", help="Python with rospy or rclpy; by default this one.")
    ] = "",
    rounds: Annotated[
        tuple[int, int], typer.Option(metavar="LEAST MOST", help="Number of fresh processes to measure.")
    ] = (10, 30),
    within: Annotated[
        float,
        typer.Option(metavar="PERCENT", help="Half width of the 95 % interval that each figure must reach."),
    ] = 10.0,
) -> int:
    """Measure the cost of ROS calls on this machine and write it as an entry of a catalogue.

    Measured is the CPU time of whole cycles minus that of idle cycles: publishing to 1 to 8 subscribers,
    sleeps of several lengths, spinOnce, received messages, and registrations by fresh processes. Ctrl-C keeps
    the measurements; the same command continues from there. Exit status: 0 if every figure is as certain as
    required, 2 for bad input, 1 otherwise.
    """
    from volery.calibration.host_machine import at_frequency, this_machine
    from volery.calibration.ros.call_costs import call_costs
    from volery.calibration.ros.campaign import (
        LEAST_ROUNDS,
        CampaignLog,
        Conditions,
        RoundPlan,
        plot_svg,
        ros_law,
        run_campaign,
        uncertain_costs,
        write_entry,
    )
    from volery.calibration.ros.campaign import RoundProgress as Rounds
    from volery.calibration.ros.probe_environment import check_client, probe_setup

    check_client(client, python)  # before any file is made
    plan = RoundPlan(*rounds, within / 100.0)
    machine = this_machine(name, catalogue=out)
    rounds_file = out.with_name(f"{out.name}.{client}.rounds")
    complete = True
    with at_frequency(machine, frequency) as mhz:
        conditions = Conditions(client, machine.description, mhz)
        log = CampaignLog(rounds_file, conditions)
        if log.rounds:
            output.note(f"continuing after {len(log.rounds)} rounds of {rounds_file}")
        try:
            with (
                _progress_bar(output, f"calibrating {client}", "starting") as update,
                probe_setup(client, python) as setup,
            ):

                def show(progress: Rounds) -> None:
                    loose = ", ".join(f"{cost.call} ±{cost.half_width:.0%}" for cost in progress.loose[:3])
                    detail = f"round {progress.rounds} of at most {progress.most}"
                    update(progress.rounds, progress.most, f"{detail}; {loose}" if loose else detail)

                run_campaign(setup, plan, log, show)
        except KeyboardInterrupt:
            complete = False
    if len(log.rounds) < LEAST_ROUNDS:
        raise UsageError(
            f"{len(log.rounds)} rounds were measured, at least {LEAST_ROUNDS} are needed; the same command "
            f"continues from {rounds_file}"
        )
    found = call_costs(log.rounds)
    law = write_entry(out, machine, ros_law(found, conditions))
    title = f"{client} on {machine.description}, {mhz:g} MHz: {len(log.rounds)} rounds"
    drawn = out.with_name(f"{out.stem}-{client}.svg")
    drawn.write_text(plot_svg(found, title), encoding="utf-8")
    if complete:
        log.forget()
    output.show(_call_table(found, title))
    output.give({"processor": machine.name, "file": str(out), "law": law.model_dump(mode="json")})
    output.note(f"{out}: {machine.name}, ros.{client}, {law.validity}; {drawn}")
    if not complete:
        output.complain(
            f"interrupted: the figures are provisional; the same command continues from {rounds_file}"
        )
    loose = uncertain_costs(log.rounds, plan.within)
    for cost in loose:
        output.complain(
            f"{cost.call}: certain to {cost.half_width:.0%} after {len(log.rounds)} rounds, required are "
            f"{plan.within:.0%}; use a quiet machine, or more rounds (--rounds)"
        )
    return OK if complete and not loose else FAILED


def _call_table(found: Mapping[str, CallCost], title: str) -> Table:
    from volery.calibration.ros.campaign import format_line

    shown = make_table(title=title)
    for heading in ("call", "process µs", "caller µs", "certain to", "quartiles", "residual"):
        shown.add_column(heading, justify="left" if heading == "call" else "right", no_wrap=True)
    for cost in found.values():
        shown.add_row(
            cost.call,
            format_line(cost.whole, cost.call),
            format_line(cost.caller, cost.call),
            f"±{cost.half_width:.0%}",
            f"±{cost.spread / 2.0:.0%}",
            f"{cost.residual:.0%}" if len(cost.points) > 1 else "",
        )
    shown.caption = "n: subscribers; ms: slept or waited; µs of CPU time"
    return shown


@commands.add("quiet", "json", "debug")
def python(
    output: CommandOutput,
    out: CatalogueFile = CATALOGUE,
    frequency: Frequency = None,
    name: EntryName = "",
    rounds: Annotated[
        tuple[int, int], typer.Option(metavar="LEAST MOST", help="Number of timings of each piece of code.")
    ] = (9, 31),
    within: Annotated[
        float,
        typer.Option(metavar="PERCENT", help="Half width of the 95 % interval that each median must reach."),
    ] = 3.0,
    reference: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Also write the table of operations.")
    ] = None,
) -> int:
    """Measure the cost of Python code on this machine and write it as an entry of a catalogue.

    Measured is the CPU time of some 250 statements and of whole programs. The results are the cost of each
    kind of operation, and a factor between this machine and the one of volery's own table. Measure on a
    robot's own computer to replace the estimated factor. Exit status: 0 if every time is as certain as
    required, 2 for bad input, 1 otherwise.
    """
    from volery.calibration.host_machine import at_frequency, put_law, this_machine
    from volery.calibration.operation_costs import calibrate
    from volery.calibration.timed_code import Rounds

    limits = Rounds(*rounds, within / 100.0)
    machine = this_machine(name, catalogue=out)
    with (
        at_frequency(machine, frequency) as mhz,
        _progress_bar(output, "calibrating python", "warming up") as update,
    ):
        found = calibrate(
            limits,
            lambda done, most, pieces: update(
                done, most, f"round {done + 1} of at most {most}, {pieces} pieces"
            ),
        )
    law = found.law(machine.description, mhz)
    put_law(out, machine, ("code", "python"), law, (mhz, mhz))
    if reference is not None:
        _write_reference(reference, found.table(machine.description))
    output.show(_operation_table(found), *_calibration_sentences(found))
    output.give({"processor": machine.name, "file": str(out), "law": law.model_dump(mode="json")})
    output.note(f"{out}: {machine.name}, code.python, {law.how_good()}")
    for code, width in list(found.loose.items())[:MAX_LOOSE_SHOWN]:
        output.complain(f"{' '.join(code.split())}: certain to {width:.1%}, required are {limits.within:.1%}")
    if found.loose:
        output.complain(
            f"{len(found.loose)} of {found.pieces} pieces of code are uncertain; use a quiet machine, or "
            "more rounds (--rounds)"
        )
    return FAILED if found.loose else OK


def _operation_table(found: Calibration) -> Table:
    from volery.cost import OPERATIONS, operation_table

    shipped = operation_table().nanoseconds
    title = "Cost of CPython's operations on this machine"
    shown = make_table(
        "operation", "meaning", number_column("ns"), number_column("ns in volery's table"), title=title
    )
    for name, what in OPERATIONS.items():
        shown.add_row(name, what, f"{found.costs[name]:.1f}", f"{shipped[name]:.1f}")
    return shown


def _calibration_sentences(found: Calibration) -> tuple[str, str, str]:
    errors = sorted(abs(error) for error in found.statements.values())
    worst = max(found.programs, key=lambda name: abs(found.programs[name]))
    return (
        f"{len(errors)} statements: the median error of the costs is {errors[len(errors) // 2]:.0%}, "
        f"nine in ten errors are below {errors[len(errors) * 9 // 10]:.0%}",
        f"{len(found.programs)} programs take {found.in_context:.2f} times as long as their operations in "
        "loops of one statement; predicted from the other programs, "
        f"the mean error is {found.program_error:.0%}, that of {worst} {found.programs[worst]:+.0%}",
        f"this machine takes {found.slowdown:.2f} times as long as volery's table, "
        f"± {found.slowdown_spread:.0%} from program to program",
    )


def _write_reference(file: Path, table: OperationTable) -> None:
    from ruamel.yaml import YAML

    yaml = YAML()
    yaml.width = 110
    text = io.StringIO()
    text.write(
        "# Cost of CPython's operations in nanoseconds: by `volery cost calibrate python --reference`.\n"
    )
    yaml.dump(table.model_dump(exclude_defaults=True), text)
    _write_text(file, text.getvalue())


def _write_text(file: Path, text: str) -> None:
    try:
        file.write_text(text, encoding="utf-8")
    except OSError as error:
        raise UsageError(f"{file} cannot be written: {error.strerror}") from error


@commands.add("quiet", "debug")
def libraries(
    output: CommandOutput,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Table to be written.")],
    only: Annotated[
        list[str] | None,
        typer.Option(
            metavar="LIBRARY", help="Measure only cv2, gtsam, small_gicp or autonomy; may be repeated."
        ),
    ] = None,
) -> int:
    """Measure the times of calls of compiled libraries (numpy, json, re, cv2, ...) and write them as a table.

    The table that comes with volery is such a file; its times are scaled to other processors like those of
    Python's operations. `autonomy` are volery's own maps, paths and markers. OpenCV, gtsam and small_gicp are
    measured where they are installed. With --only the other entries are those of volery's table.
    """
    from volery.calibration.host_machine import this_machine
    from volery.calibration.library_times import measure_table, measured_again
    from volery.calibration.timed_code import DEFAULT_ROUNDS
    from volery.cost import library_table

    machine = this_machine("")
    with _progress_bar(output, "calibrating libraries", "timing programs") as update:

        def show(name: str, number: int, whole: int) -> None:
            update(number, whole, name)

        if only:
            table = measured_again(library_table(), only, DEFAULT_ROUNDS, show)
        else:
            table = measure_table(machine.description, DEFAULT_ROUNDS, show)
    _write_text(file, table.as_text())
    output.note(
        f"{file}: {len(table.calls)} functions, {len(table.work)} blocks of autonomy; "
        f"in programs numpy takes {table.in_context:.2f} times as long"
    )
    return OK


@commands.add("quiet", "json", "debug")
def processor(output: CommandOutput, out: CatalogueFile = CATALOGUE, name: EntryName = "") -> int:
    """Measure the cost of compiled code on this machine and write it as an entry of a catalogue.

    Measured are operations, library calls, branch mispredictions, caches and memory. `volery cost` and C++
    components that are allocated to this machine use the entry.

    Each figure is timed until its median is certain to 1 %, or reported as noisy. Ctrl-C keeps the
    measurements; the same command continues from there. Exit status: 0 if every figure is certain, 2 for bad
    input, 1 otherwise.
    """
    from volery.calibration.core_measurement import core_law, isa, measure, noisy_snippets
    from volery.calibration.host_machine import put_law, this_machine
    from volery.calibration.queue_measurement import measure_queues

    machine, here = this_machine(name, catalogue=out), isa()
    log = out.with_name(f"{out.name}.notes")
    bar = Progress(TextColumn("{task.description}"), BarColumn(), console=output.notes)
    bar.disable = not output.shows_progress
    with bar:
        line = bar.add_task("building")
        measured = measure(
            log, lambda name, done, whole: bar.update(line, description=name, completed=done, total=whole)
        )
    law = core_law(machine, here, measured, measure_queues())
    frequencies = law.least_mhz, law.greatest_mhz
    put_law(out, machine, ("core_model",), law.model_copy(update={"name": ""}), frequencies)
    log.unlink(missing_ok=True)
    output.show(_core_table(law))
    output.give(law.model_dump())
    output.note(f"{law.name} in {out}: volery cost FILE --on {law.name} --catalogue {out}")
    noisy = noisy_snippets(measured)
    if noisy:
        output.note(f"noisy, because the machine was busy: {', '.join(noisy)}")
    return FAILED if noisy else OK


def _core_table(law: CoreLaw) -> Table:
    title = f"{law.name} at {law.greatest_mhz:g} MHz"
    shown = make_table("operation", number_column("cycles"), number_column("starts per cycle"), title=title)
    for name, one in law.operations.items():
        shown.add_row(name, f"{one.latency:g}", f"{one.per_cycle:g}")
    memory = law.memory
    if memory is not None:
        for level, cache in enumerate(memory.caches, 1):
            shown.add_row(f"load from cache {level}, {cache.bytes >> 10} KiB", f"{cache.latency:g}", "")
        shown.add_row("load from memory", f"{memory.latency_ns:g} ns", f"{memory.bytes_per_ns:g} GB/s")
    shown.add_row(f"reorder buffer, {law.window} entries", "", "")
    for queue in law.queues:
        shown.add_row(f"issue queue of {', '.join(queue.pipes)}, {queue.entries} entries", "", "")
    return shown
