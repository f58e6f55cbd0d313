"""``volery vehicle params``, ``mission``, ``logs`` and ``files``: what an autopilot keeps on board.

None of these commands moves a vehicle, and one that flies goes on flying.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.text import Text

from volery.base.errors import NotArrived, UsageError, choices
from volery.cli.command import FAILED, OK, Commands
from volery.cli.console import CommandOutput, make_table, number_column

if TYPE_CHECKING:
    from collections.abc import Sequence

    from volery.vehicles import Vehicle
    from volery.vehicles.parameters import ParameterDifference, Parameters

parameters = Commands("vehicle params", "Read and write the parameters of an autopilot.")
missions = Commands("vehicle mission", "Upload and download missions, geofences, rally points.")
commands = Commands("vehicle", "Read and set what an autopilot keeps, serve a simulated one, check a driver.")

Url = Annotated[str, typer.Argument(metavar="URL", help="Address, such as px4+udp://:14550 or sim:px4.")]
Kind = Annotated[str, typer.Option(help="drone or rover.")]
Only = Annotated[
    str | None, typer.Option(metavar="PART,...", help="Only these parts: mission, fence, rally.")
]
ParameterFile = Annotated[
    Path, typer.Argument(metavar="FILE", help=".params of QGroundControl; .param or .parm of others.")
]
PlanFile = Annotated[
    Path,
    typer.Argument(
        metavar="FILE", help=".plan of QGroundControl; upload takes QGC WPL 110 of other stations, too."
    ),
]
HOME_WITHIN_S = 3.0
"""Wait for the home that a downloaded plan states."""

KINDS = ("drone", "rover")


@contextmanager
def _attached(url: str, kind: str) -> Iterator[Vehicle]:
    from volery.run.connect import attach
    from volery.vehicles import Drone, Rover

    if kind not in KINDS:
        raise UsageError(f"--kind {kind}: give {choices(KINDS)}")
    with attach(url, Rover if kind == "rover" else Drone) as vehicle:
        yield vehicle


@parameters.add("quiet", "json", "debug", name="get")
def get(
    output: CommandOutput,
    url: Url,
    names: Annotated[list[str] | None, typer.Argument(metavar="NAME...", help="By default all.")] = None,
    kind: Kind = "drone",
) -> int:
    """Print parameters."""
    with _attached(url, kind) as vehicle:
        found = {name: vehicle.parameters.get(name) for name in names} if names else vehicle.parameters.all()
    table = make_table("parameter", number_column("value"))
    for name, value in found.items():
        table.add_row(name, f"{value:.9g}")
    output.show(table)
    output.give(found)
    return OK


@parameters.add("quiet", "debug", name="set")
def set_one(
    output: CommandOutput,
    url: Url,
    name: Annotated[str, typer.Argument(metavar="NAME")],
    value: Annotated[float, typer.Argument(metavar="VALUE")],
    kind: Kind = "drone",
) -> int:
    """Set a parameter, and wait until the autopilot reports the value."""
    with _attached(url, kind) as vehicle:
        before = vehicle.parameters.get(name)
        vehicle.parameters.set(name, value)
    output.note(f"{name}: {before:.9g} -> {value:.9g}")
    return OK


@parameters.add("quiet", "debug", name="save")
def save(output: CommandOutput, url: Url, file: ParameterFile, kind: Kind = "drone") -> int:
    """Write all parameters into a file."""
    with _attached(url, kind) as vehicle:
        count = vehicle.parameters.save(file)
    output.note(f"{count} parameters: {file}")
    return OK


@parameters.add("quiet", "json", "debug", name="load")
def load(output: CommandOutput, url: Url, file: ParameterFile, kind: Kind = "drone") -> int:
    """Set the parameters of a file that differ from the vehicle's, but for those that it writes itself."""
    with _attached(url, kind) as vehicle:
        own = vehicle.parameters
        changed = own.load(file)
    _show(output, changed, own, "before", "now")
    output.note(f"{len(changed)} parameters were set")
    return OK


@parameters.add("quiet", "json", "debug", name="diff")
def diff(output: CommandOutput, url: Url, file: ParameterFile, kind: Kind = "drone") -> int:
    """Compare a vehicle with a file. Exit status: 0 if no setting of the file differs, else 1.

    Values that the autopilot writes itself, such as counters, are no settings: those that differ are named.
    """
    with _attached(url, kind) as vehicle:
        own = vehicle.parameters
        found = own.compare(file)
    _show(output, found, own, "vehicle", "file")
    return FAILED if found else OK


def _show(
    output: CommandOutput, found: Sequence[ParameterDifference], own: Parameters, here: str, there: str
) -> None:
    converted = own.converted
    if found:
        table = make_table("parameter", number_column(here), number_column(there))
        if converted:
            table.add_column("the file states")
        for one in found:
            values = ("-" if value is None else f"{value:.9g}" for value in (one.here, one.there))
            table.add_row(one.name, *values, *([converted.get(one.name, "")] if converted else []))
        output.show(table)
    if own.left_alone:
        names = ", ".join(one.name for one in own.left_alone)
        output.note(f"written by the autopilot itself, left alone: {names}")
    output.give([one._asdict() | {"stated": converted.get(one.name, "")} for one in found])


@missions.add("quiet", "debug", name="upload")
def upload(output: CommandOutput, url: Url, file: PlanFile, only: Only = None, kind: Kind = "drone") -> int:
    """Replace mission, geofence and rally points on board by those of a plan; an empty part clears."""
    from volery.vehicles.vehicle_plan import Plan

    plan = Plan.read(file)
    with _attached(url, kind) as vehicle:
        parts = _parts(only)
        if (plan.mission and "mission" in parts) or (plan.rally and "rally" in parts):
            vehicle.wait_ready()  # limits count from home
        vehicle.plan.upload(plan, parts)
    output.note(f"{_count(plan)} are on board of {url}")
    return OK


@missions.add("quiet", "debug", name="download")
def download(output: CommandOutput, url: Url, file: PlanFile, only: Only = None, kind: Kind = "drone") -> int:
    """Write mission, geofence and rally points on board into a plan."""
    with _attached(url, kind) as vehicle:
        with suppress(NotArrived):  # home is part of the file
            vehicle.wait_located(HOME_WITHIN_S)
        plan = vehicle.plan.download(_parts(only))
    plan.write(file)
    output.note(f"{_count(plan)}: {file}")
    return OK


def _parts(only: str | None) -> tuple[str, ...]:
    from volery.vehicles.onboard_plan import PARTS

    return tuple(part.strip() for part in only.split(",")) if only else PARTS


def _count(plan: object) -> str:
    from volery.vehicles.vehicle_plan import Plan

    assert isinstance(plan, Plan)
    return f"{len(plan.mission)} mission items, {len(plan.fence)} areas, {len(plan.rally)} rally points"


@commands.add("quiet", "json", "debug")
def logs(
    output: CommandOutput,
    url: Url,
    get: Annotated[int | None, typer.Option(metavar="NUMBER", help="Download this log.")] = None,
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="File to download into.")] = None,
    kind: Kind = "drone",
) -> int:
    """List the logs on board of an autopilot, or download one; a download goes on where it was ended."""
    with _attached(url, kind) as vehicle:
        entries = vehicle.logs.list()
        if get is not None:
            entry = next((entry for entry in entries if entry.number == get), None)
            if entry is None:
                numbers = choices(str(entry.number) for entry in entries)
                raise UsageError(f"--get {get}: there is no such log; there is {numbers}")
            suffix = ".ulg" if vehicle.telemetry.autopilot == "PX4" else ".bin"
            path = vehicle.logs.download(entry, out or Path(f"log-{get}{suffix}"))
            output.note(f"{entry.size} bytes: {path}")
            return OK
    table = make_table(number_column("log"), number_column("bytes"), "ended (UTC)")
    for one in entries:
        ended = f"{datetime.fromtimestamp(one.utc, UTC):%Y-%m-%d %H:%M:%S}" if one.utc else "-"
        table.add_row(str(one.number), str(one.size), ended)
    if entries:
        output.show(table)
    else:
        output.note("there are no logs on board")
    output.give([entry._asdict() for entry in entries])
    return OK


@commands.add("quiet", "json", "debug")
def files(
    output: CommandOutput,
    url: Url,
    path: Annotated[str, typer.Argument(metavar="PATH", help="Folder to list, or file to download.")] = "/",
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="Download PATH into this file.")] = None,
    kind: Kind = "drone",
) -> int:
    """List a folder on board of an autopilot, or download a file of it, by MAVLink FTP."""
    with _attached(url, kind) as vehicle:
        if out is not None:
            vehicle.files.download(path, out)
            output.note(f"{out.stat().st_size} bytes: {out}")
            return OK
        entries = vehicle.files.list(path)
    table = make_table("name", number_column("bytes"))
    for one in entries:
        table.add_row(
            Text(f"{one.name}/" if one.is_folder else one.name), "" if one.is_folder else str(one.size)
        )
    if entries:
        output.show(table)
    else:
        output.note(f"{path} is empty")
    output.give([entry._asdict() for entry in entries])
    return OK
