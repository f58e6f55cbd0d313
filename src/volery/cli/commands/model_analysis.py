"""``volery model analyse``: what a model guarantees without a run, beside what a run has shown."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer
from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from volery.cli.command import FAILED, OK, Commands
from volery.cli.console import CommandOutput, file_size, make_table, number_column
from volery.cli.options import Allocation, Model, Overrides, Scenario

if TYPE_CHECKING:
    from volery.analysis.budgets import Budgets
    from volery.analysis.hardware import PricedPart
    from volery.analysis.simulated_times import LongestTimes
    from volery.analysis.system_analysis import Analysis, Bound, Utilisation
    from volery.base.time import Ns
    from volery.requirements.record import RunRecord

commands = Commands("model")

RunFolder = Annotated[
    Path | None,
    typer.Option("--run", metavar="DIR", help="Run folder whose longest times stand beside the bounds."),
]
NONE = "–"


class _Seen(NamedTuple):
    """What a run has shown: its record, and the longest times after its start-up."""

    record: RunRecord
    longest: LongestTimes


@commands.add("quiet", "json", "debug")
def analyse(
    output: CommandOutput,
    model: Model,
    allocation: Allocation = None,
    scenario: Scenario = None,
    overrides: Overrides = None,
    run: RunFolder = None,
) -> int:
    """Bound response times, delays and latencies without a run; budgets of memory, energy and battery.

    Each bound states why there is none where its assumptions do not hold. The exit status is 1 if a deadline
    is not guaranteed although there is a bound, or a longest simulated time is above its bound.
    """
    from volery.analysis.budgets import budgets
    from volery.analysis.hardware import hardware, hardware_price
    from volery.analysis.simulated_times import longest_times
    from volery.analysis.system_analysis import ASSUMPTIONS
    from volery.analysis.system_analysis import analyse as analyse_system
    from volery.model.system_loader import load
    from volery.requirements.record import read_record
    from volery.run.assembly.model_checks import vocabulary

    system = load(model, vocabulary(), scenario, allocation, overrides or ())
    parts = hardware(system)
    seen = None if run is None else _Seen(read_record(run), longest_times(run))
    found = analyse_system(system)
    limits = budgets(system, found.processors)
    output.show(
        Text(f"{system.name}, allocation {system.allocation or 'none'}", style="bold"),
        *_shares("processor", found.processors, seen),
        *_shares("network", found.networks, None),
        *_responses(found, seen),
        *_latencies(found, seen),
        *_reasons(found),
        *_budgets(limits),
        *_hardware(parts),
        Text("Assumed for every bound: " + "; ".join(ASSUMPTIONS) + ".", style="dim"),
    )
    output.give(
        {
            **asdict(found),
            "budgets": asdict(limits),
            "hardware": [asdict(part) for part in parts],
            "hardware_price": hardware_price(parts),
            "assumptions": list(ASSUMPTIONS),
        }
    )
    broken = list(_broken(found, seen))
    for one in broken:
        output.complain(f"volery: {one}")
    return FAILED if broken else OK


def _shares(kind: str, shares: Iterable[Utilisation], seen: _Seen | None) -> Iterator[RenderableType]:
    simulated = [number_column("simulated")] if seen else []
    table = make_table(kind, number_column("utilisation"), *simulated)
    for share in shares:
        least = "≥ " if share.not_counted else ""
        record = seen.record.processors.get(share.resource) if seen else None
        beside = [NONE if record is None else f"{record.utilisation:.2%}"] if seen else []
        table.add_row(share.resource, f"{least}{share.share:.2%}", *beside)
    if table.row_count:
        yield table


def _responses(found: Analysis, seen: _Seen | None) -> Iterator[RenderableType]:
    simulated = [number_column("bound of the run"), number_column("simulated")] if seen else []
    table = make_table(
        "response time of", "on", number_column("bound"), *simulated, number_column("deadline"), "guaranteed"
    )
    for processor, bounds in found.responses.items():
        for one in {each.subject: each for each in reversed(bounds)}.values():
            beside = []
            if seen:
                name = _component(one)
                record = seen.record.components.get(name)
                of_run = None if record is None else record.response_bound_s
                beside = [_seconds(of_run), _time(seen.longest.responses.get(name))]
            verdict = {True: "yes", False: "no", None: ""}[one.holds]
            table.add_row(one.subject, processor, _bound(one), *beside, _time(one.deadline), verdict)
    if table.row_count:
        yield table


def _latencies(found: Analysis, seen: _Seen | None) -> Iterator[RenderableType]:
    simulated = [number_column("simulated")] if seen else []
    table = make_table("latency of", number_column("bound"), *simulated)
    for one in (*found.delays, *found.chains):
        beside = [_time(seen.longest.chains.get(one.subject))] if seen else []
        table.add_row(one.subject, _bound(one), *beside)
    if table.row_count:
        yield table


def _reasons(found: Analysis) -> Iterator[RenderableType]:
    """Yield why there is no bound, one line a reason."""
    subjects: dict[str, dict[str, None]] = {}
    for one in (
        *(each for bounds in found.responses.values() for each in bounds),
        *found.delays,
        *found.chains,
    ):
        if one.why:
            subjects.setdefault(one.why, {})[one.subject] = None
    for network in found.networks:
        for why in network.not_counted:
            subjects.setdefault(why, {})[network.resource] = None
    if subjects:
        yield Text("No bound, because the model does not state enough:", style="bold")
    for why, names in subjects.items():
        yield Text(f"  {', '.join(names)}", style="yellow").append(f"\n    {why}", style="dim")


def _budgets(found: Budgets) -> Iterator[RenderableType]:
    energy = make_table("energy of", number_column("power"), number_column("for the run"), "remark")
    for one in found.energy:
        least = "≥ " if one.at_least else ""
        power = NONE if one.watts is None else f"{least}{one.watts:.2f} W"
        joules = NONE if one.joules is None else f"{least}{one.joules / 1000:.2f} kJ"
        energy.add_row(
            one.processor, power, joules, one.why or (f"within {one.error:.0%}" if one.error else "")
        )
    memory = make_table("memory of process", "on", number_column("at most"), "remark")
    for each in found.memory if any(one.bytes is not None for one in found.memory) else ():
        memory.add_row(each.process, each.processor, _size(each.bytes), each.why)
    battery = make_table(
        "hover of", number_column("power"), number_column("until reserve"), "of", "the longest run"
    )
    for drone in found.endurance:
        lasts = NONE if drone.seconds is None else f"{drone.seconds / 60:.1f} min"
        verdict = drone.why or ("fits" if drone.feasible else "does not fit")
        power = NONE if drone.watts is None else f"{drone.watts:.0f} W"
        battery.add_row(drone.vehicle, power, lasts, f"{drone.reserve:.0%}", verdict)
    yield from (one for one in (memory, energy, battery) if _filled(one))


def _hardware(parts: Sequence[PricedPart]) -> Iterator[RenderableType]:
    from volery.analysis.hardware import hardware_price

    table = make_table("hardware", "what", number_column("price"), number_column("of the year"), "")
    for part in parts:
        year = NONE if part.year is None else str(part.year)
        estimated = "estimated" if part.estimated else ""
        table.add_row(part.name, part.what, f"{part.amount:.0f} {part.currency}", year, estimated)
    for currency, amount in hardware_price(parts).items():
        table.add_row("all of it", "", f"{amount:.0f} {currency}", "", "")
    if parts:
        yield table


def _filled(table: Table) -> bool:
    return table.row_count > 0


def _broken(found: Analysis, seen: _Seen | None) -> Iterator[str]:
    """Yield the deadlines that are not guaranteed, and the bounds that a run has exceeded."""
    longest: dict[str, list[Bound]] = {}
    for bounds in found.responses.values():
        for one in bounds:
            longest.setdefault(_component(one), []).append(one)
            if one.holds is False:
                yield f"{one.subject}: the deadline of {_time(one.deadline)} is not guaranteed: {_bound(one)}"
    if seen is None:
        return
    for name, each in longest.items():
        known = [one.bound for one in each if one.bound is not None]
        if len(known) == len(each):
            yield from _exceeded(name, max(known), seen.longest.responses.get(name))
    for one in found.chains:
        yield from _exceeded(one.subject, one.bound, seen.longest.chains.get(one.subject))


def _component(one: Bound) -> str:
    """Return whose activations *one* bounds: empty for calls that it serves, which are its callers'."""
    name, _, rest = one.subject.partition(" ")  # a callback is "<instance> <topic>"
    return "" if rest.startswith("for ") else name


def _exceeded(subject: str, bound: Ns | None, simulated: Ns | None) -> Iterator[str]:
    if bound is not None and simulated is not None and simulated > bound:
        yield (
            f"{subject}: {_time(simulated)} were simulated, above the bound of {_time(bound)}: the run is of "
            "another model, or its components do more than the model states"
        )


def _bound(one: Bound) -> str:
    return _time(one.bound)


def _time(time: Ns | None) -> str:
    return NONE if time is None else f"{time / 1e6:.3f} ms"


def _seconds(seconds: float | None) -> str:
    return NONE if seconds is None else f"{seconds * 1e3:.3f} ms"


def _size(size: float | None) -> str:
    return NONE if size is None else file_size(size)
