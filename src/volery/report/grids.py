"""The tables of a report as plain data, so that the terminal and the HTML document show the same.

The ``share`` (0..1) of a cell may be drawn as a bar behind its text, its ``status`` as a colour beside the
text and never instead of it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import floor, log10
from typing import Literal

from volery.base.time import clock, from_seconds
from volery.requirements.record import (
    ComponentRecord,
    NoteRecord,
    OffsetRecord,
    RequirementRecord,
    RunRecord,
    VehicleRecord,
)

CellStatus = Literal["", "good", "bad", "warn", "quiet"]
NOTHING = "–"
_MOST_STATES = 12  # of one subject in a line


@dataclass(frozen=True)
class Cell:
    """One cell of a table."""

    text: str
    share: float | None = None
    status: CellStatus = ""


@dataclass(frozen=True)
class Column:
    """Heading of a column.

    Attributes:
        title: Its text.
        numeric: Align the cells to the right.
        hint: Explanation in one sentence.
        essential: Keep the column on a narrow terminal.
    """

    title: str
    numeric: bool = False
    hint: str = ""
    essential: bool = True


@dataclass(frozen=True)
class Grid:
    """A table; every row has one cell for each column."""

    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]

    def __bool__(self) -> bool:
        return bool(self.rows)

    def plain(self) -> dict[str, object]:
        """Return the table as plain data: its title, and a mapping from column to text for each row."""
        names = [column.title for column in self.columns]
        return {
            "title": self.title,
            "rows": [dict(zip(names, (cell.text for cell in row), strict=True)) for row in self.rows],
        }


def number(value: float | None, digits: int = 1, unit: str = "") -> str:
    """Format a number with a fixed number of digits; a dash for None."""
    if value is None:
        return NOTHING
    text = f"{value:,.{digits}f}".replace(",", "\N{NO-BREAK SPACE}")
    return f"{text}\N{NO-BREAK SPACE}{unit}" if unit else text


def figure(value: float | None, unit: str = "") -> str:
    """Format a number of any size to four significant digits; a dash for None."""
    if value is None:
        return NOTHING
    text = f"{value:.4g}" if abs(value) < 1e4 else f"{value:,.0f}".replace(",", "\N{NO-BREAK SPACE}")
    return f"{text}\N{NO-BREAK SPACE}{unit}" if unit else text


def energy(joules: float | None) -> str:
    """Format an energy in mJ to MJ, by size; a dash for None."""
    if joules is None:
        return NOTHING
    if 0.0 < abs(joules) < 0.1:
        return figure(joules * 1e3, "mJ")
    if abs(joules) >= 1e7:
        return number(joules / 1e6, 1, "MJ")
    return number(joules / 1e3, 1, "kJ") if abs(joules) >= 1e4 else figure(joules, "J")


def band(error: float | None) -> str:
    """Format a relative error as ``± 20 %``; empty for None."""
    return "" if error is None else f"±\N{NO-BREAK SPACE}{number(100.0 * error, 0, '%')}"


def widest_band(record: RunRecord) -> str:
    """Return the widest error band of the energies of a run's processors; empty if none is known."""
    known = [
        processor.energy_error
        for processor in record.processors.values()
        if processor.energy_error is not None
    ]
    return band(max(known, default=None))


def total(values: list[float | None]) -> float | None:
    """Return the sum, or None if a value is unknown: a partial sum would look like the total."""
    known = [value for value in values if value is not None]
    return sum(known) if values and len(known) == len(values) else None


def brief(seconds: float) -> str:
    """Format seconds to a millisecond, and times below 10 ms to two significant digits."""
    if seconds == 0.0 or seconds >= 0.01:
        return number(seconds, 3)
    return f"{seconds:.{1 - floor(log10(seconds))}f}"


def milliseconds(seconds: float | None) -> str:
    """Format seconds as milliseconds; a dash for None."""
    return number(None if seconds is None else 1e3 * seconds, 2)


def moment(seconds: float) -> str:
    """Format a time of a run as ``h:mm:ss.mmm``."""
    return clock(from_seconds(seconds))


def count(value: int) -> str:
    """Format a whole number."""
    return f"{value:,}".replace(",", "\N{NO-BREAK SPACE}")


def _offset(offset: OffsetRecord) -> str:
    return f"{number(offset.horizontal, 2)} / {number(offset.vertical, 2)}"


def verdict(requirement: RequirementRecord) -> Cell:
    """Return the verdict of a requirement."""
    if requirement.met is None:
        return Cell("not judged", status="warn")
    return Cell("✓ met", status="good") if requirement.met else Cell("✗ not met", status="bad")


def bound(requirement: RequirementRecord) -> str:
    """Format the bound of a requirement, as ``≤ 0.3 m``."""
    sign = {"max": "≤", "min": "≥"}.get(requirement.relation, requirement.relation)
    return f"{sign} {figure(requirement.bound, requirement.unit)}"


def requirements_grid(record: RunRecord) -> Grid:
    """Return the verdicts of the requirements."""
    rows = tuple(
        (
            Cell(name),
            verdict(one),
            Cell(figure(one.observed, one.unit)),
            Cell(bound(one)),
            Cell(one.observable, status="quiet"),
        )
        for name, one in record.requirements.items()
    )
    columns = (
        Column("requirement"),
        Column("verdict"),
        Column("observed", True),
        Column("bound", True),
        Column("observable", essential=False),
    )
    return Grid("Requirements", columns, rows)


def cost_grid(record: RunRecord) -> Grid:
    """Return the cost of each component on its processor."""
    longest = max((component.cpu_s for component in record.components.values()), default=0.0)
    rows = tuple(_cost_row(name, one, longest) for name, one in record.components.items())
    columns = (
        Column("component"),
        Column("processor"),
        Column("language", essential=False),
        Column("exec s", True, "time executed on the processor"),
        Column("of it\nROS", True, "share of the execution time that was owed to ROS calls"),
        Column("ROS calls", True, essential=False),
        Column("activations", True, essential=False),
        Column("misses", True, "activations that ended after their deadline"),
        Column("mean ms", True, "response time of activations, else of calls served", False),
        Column("p95 ms", True, "95 % of all responses took no longer"),
        Column("max ms", True, "", False),
        Column(
            "bound ms",
            True,
            "analysis of fixed priorities, with the longest executions and densest releases that were seen "
            "or that the period allows; waiting for messages, networks and locks is not in it",
            False,
        ),
        Column(
            _energy_title(record),
            True,
            "stated for its operations, else what its execution takes above idle, within the band of its "
            "processor's power figures",
        ),
    )
    return Grid("Cost of each component", columns, rows)


def _energy_title(record: RunRecord) -> str:
    return "\n".join(filter(None, ("energy", widest_band(record))))


def _cost_row(name: str, one: ComponentRecord, longest: float) -> tuple[Cell, ...]:
    ros_share = one.ros_cpu_s / one.cpu_s if one.cpu_s else None
    response = one.response_s
    late = Cell(count(one.deadline_misses), status="bad" if one.deadline_misses else "")
    return (
        Cell(name),
        Cell(one.processor or "none", status="" if one.processor else "warn"),
        Cell(one.language or NOTHING, status="quiet"),
        Cell(brief(one.cpu_s), share=one.cpu_s / longest if longest else None),
        Cell(NOTHING if ros_share is None else number(100.0 * ros_share, 1, "%")),
        Cell(count(sum(one.ros_calls.values()))),
        Cell(count(one.activations)),
        late if one.activations else Cell(NOTHING),
        Cell(milliseconds(response.mean)),
        Cell(milliseconds(response.p95)),
        Cell(milliseconds(response.max)),
        Cell(milliseconds(one.response_bound_s)),
        Cell(energy(one.energy_j)),
    )


def chains_grid(record: RunRecord) -> Grid:
    """Return the end-to-end latencies along chains of topics."""
    rows = tuple(
        (
            Cell(name),
            Cell(one.unobserved or " → ".join(one.topics), status="warn" if one.unobserved else "quiet"),
            Cell(count(one.latency_s.count)),
            Cell(milliseconds(one.latency_s.mean)),
            Cell(milliseconds(one.latency_s.p95)),
            Cell(milliseconds(one.latency_s.max)),
        )
        for name, one in record.chains.items()
    )
    columns = (
        Column("chain"),
        Column("topics", essential=False),
        Column("arrivals", True, "messages on its last topic that go back to one on its first"),
        Column("mean ms", True, "age of what arrived: since the first message was sent"),
        Column("p95 ms", True),
        Column("max ms", True),
    )
    return Grid("Latency along chains of topics", columns, rows)


MOST_PREEMPTIONS = 20


def preemptions_grid(record: RunRecord) -> Grid:
    """Return the most frequent preemptions."""
    rows = tuple(
        (
            Cell(preemption.processor),
            Cell(preemption.preempted),
            Cell(preemption.by),
            Cell(count(preemption.count)),
        )
        for preemption in record.preemptions[:MOST_PREEMPTIONS]
    )
    columns = (Column("processor"), Column("task"), Column("preempted by"), Column("times", True))
    return Grid("Preemptions", columns, rows)


def ros_calls_grid(record: RunRecord) -> Grid:
    """Return the number of ROS calls of each component, by kind of call."""
    kinds = sorted({kind for component in record.components.values() for kind in component.ros_calls})
    rows = tuple(
        (
            Cell(name),
            *(Cell(count(one.ros_calls[kind]) if kind in one.ros_calls else NOTHING) for kind in kinds),
        )
        for name, one in record.components.items()
        if one.ros_calls
    )
    return Grid("ROS calls by kind", (Column("component"), *(Column(kind, True) for kind in kinds)), rows)


def processors_grid(record: RunRecord) -> Grid:
    """Return the kind, utilisation and energy of each processor."""
    rows = tuple(
        (
            Cell(name),
            Cell(one.kind, status="quiet"),
            Cell(number(one.frequency_mhz, 0, "MHz")),
            Cell(str(one.cores)),
            Cell(one.scheduler, status="quiet"),
            Cell(number(100.0 * one.utilisation, 2, "%"), share=min(1.0, one.utilisation)),
            Cell(energy(one.energy_j)),
            Cell(band(one.energy_error) or NOTHING),
        )
        for name, one in record.processors.items()
    )
    columns = (
        Column("processor"),
        Column("kind"),
        Column("frequency", True),
        Column("cores", True, essential=False),
        Column("scheduler", essential=False),
        Column("utilisation", True, "busy share of all cores over the whole run"),
        Column("energy", True, "idle power included"),
        Column("band", True, "of the power figures that the energy comes from"),
    )
    return Grid("Processors", columns, rows)


def vehicles_grid(record: RunRecord) -> Grid:
    """Return the distance, time, energy and errors of each vehicle."""
    swapped = any(vehicle.battery_swaps for vehicle in record.vehicles.values())
    charged = any(vehicle.charging_s for vehicle in record.vehicles.values())
    rows = tuple(
        (
            *_vehicle_row(name, one),
            *((Cell(number(one.battery_swaps, 0)),) if swapped else ()),
            *((Cell(number(one.charging_s)),) if charged else ()),
        )
        for name, one in record.vehicles.items()
    )
    served = (
        *((Column("battery\nswaps", True),) if swapped else ()),
        *((Column("charged\ns", True, "time for which places charged it"),) if charged else ()),
    )
    columns = (
        Column("vehicle"),
        Column("kind", essential=False),
        Column("autopilot", essential=False),
        Column("distance\nm", True),
        Column("armed\ns", True, essential=False),
        Column("airborne\ns", True),
        Column("energy", True),
        Column("battery\nleft", True, essential=False),
        Column("at the end"),
        Column(
            "error m\nby estimate", True, "largest of all operations that succeeded: horizontal / vertical"
        ),
        Column("error m\nby truth", True, "the same, by where the vehicle really was"),
        *served,
    )
    return Grid("Vehicles", columns, rows)


def _vehicle_row(name: str, one: VehicleRecord) -> tuple[Cell, ...]:
    end = {None: Cell("never seen", status="warn"), True: Cell("at rest", status="good")}
    return (
        Cell(name),
        Cell(one.kind, status="quiet"),
        Cell(f"{one.autopilot} ({one.firmware})" if one.firmware else one.autopilot, status="quiet"),
        Cell(number(one.distance_m)),
        Cell(number(one.armed_s)),
        Cell(number(one.airborne_s)),
        Cell(energy(one.energy_j)),
        Cell(NOTHING if one.battery is None else number(100.0 * one.battery, 0, "%"), share=one.battery),
        end.get(one.landed, Cell("not at rest", status="bad")),
        Cell(_offset(one.error_by_estimate_m)),
        Cell(_offset(one.error_by_truth_m)),
    )


def operations_grid(record: RunRecord) -> Grid:
    """Return the operations of the vehicles and their outcomes."""
    operations = [(name, each) for name, one in record.vehicles.items() for each in one.operations]
    operations.sort(key=lambda pair: pair[1].start_s)
    rows = tuple(
        (
            Cell(moment(one.start_s)),
            Cell(name),
            Cell(one.operation),
            Cell(one.asked, status="quiet"),
            Cell(number(one.end_s - one.start_s)),
            Cell("✓ ok", status="good")
            if one.outcome == "ok"
            else Cell(f"✗ {one.outcome}: {one.said}", status="bad"),
            Cell(_offset(one.error_by_estimate_m)),
            Cell(_offset(one.error_by_truth_m)),
        )
        for name, one in operations
    )
    columns = (
        Column("at"),
        Column("vehicle"),
        Column("operation"),
        Column("asked"),
        Column("took s", True),
        Column("outcome"),
        Column("error m\nby estimate", True, "horizontal / vertical"),
        Column("error m\nby truth", True, "horizontal / vertical"),
    )
    return Grid("Vehicle operations", columns, rows)


def plural(kind: str) -> str:
    """Return the name of several things of a kind of notes; a kind that ends in s is taken for one."""
    if kind.endswith(("ch", "sh", "x", "z", "ss")):
        return f"{kind}es"
    if kind.endswith("y") and kind[-2:-1] not in tuple("aeiou"):
        return f"{kind[:-1]}ies"
    return kind if kind.endswith("s") else f"{kind}s"


def heading(kind: str) -> str:
    """Return the heading of what is said of a kind of notes."""
    words = plural(kind)
    return words[:1].upper() + words[1:]


def by_state(counts: Mapping[str, int]) -> str:
    """Format the numbers of subjects in each state: ``2 delivered, 1 failed``."""
    return ", ".join(f"{amount} {state}" for state, amount in counts.items())


def last_states(subjects: Mapping[str, NoteRecord]) -> Counter[str]:
    """Return the number of subjects in each state at the end."""
    return Counter(subject.state for subject in subjects.values())


def note_grids(record: RunRecord) -> list[Grid]:
    """Return a table for each kind of notes: the subjects, their last state, and how they came to it."""
    columns = (
        Column("subject"),
        Column("state"),
        Column("since"),
        Column("after s", True, "from its first state to this one"),
        Column("history", essential=False),
    )
    return [
        Grid(heading(kind), columns, tuple(_noted(name, one) for name, one in subjects.items()))
        for kind, subjects in record.notes.items()
    ]


def _noted(name: str, one: NoteRecord) -> tuple[Cell, ...]:
    first, last = one.history[0].at_s, one.history[-1].at_s
    story = [step.state for step in one.history]
    left_out = len(story) - 1 - _MOST_STATES
    if left_out > 0:
        story[1:-_MOST_STATES] = [f"({left_out} more)"]
    return (
        Cell(name),
        Cell(one.state),
        Cell(moment(last)),
        Cell(number(last - first)),
        Cell(" → ".join(story), status="quiet"),
    )


def added_grids(record: RunRecord) -> list[Grid]:
    """Return the tables of other packages, and a table of values for those that have none."""
    tables = []
    for name, one in record.added.items():
        if one.table is not None:
            table = one.table
            numeric = [
                all(isinstance(row[index], float | None) for row in table.rows)
                for index in range(len(table.columns))
            ]
            columns = tuple(Column(title, right) for title, right in zip(table.columns, numeric, strict=True))
            rows = tuple(
                tuple(Cell(cell if isinstance(cell, str) else figure(cell)) for cell in row)
                for row in table.rows
            )
            tables.append(Grid(table.title, columns, rows))
        elif one.values:
            rows = tuple((Cell(what), Cell(figure(value))) for what, value in one.values.items())
            tables.append(Grid(name, (Column("observable"), Column("observed", True)), rows))
    return [table for table in tables if table]


def laws_grid(record: RunRecord) -> Grid:
    """Return the cost laws of the run, with source, validity and warnings."""
    rows = tuple(
        (
            Cell(law.name),
            Cell(law.source, status="quiet"),
            Cell(law.provenance),
            Cell(law.validity, status="quiet"),
            Cell(f"⚠ {law.warning}", status="warn")
            if law.warning
            else Cell("used within its range", status="quiet"),
        )
        for law in record.laws
    )
    columns = (Column("law"), Column("source"), Column("provenance"), Column("valid for"), Column("this run"))
    return Grid("Laws behind the figures", columns, rows)


def all_grids(record: RunRecord) -> list[Grid]:
    """Return all tables that have rows, in reading order."""
    made = (
        requirements_grid(record),
        cost_grid(record),
        chains_grid(record),
        processors_grid(record),
        vehicles_grid(record),
        *note_grids(record),
        *added_grids(record),
    )
    return [grid for grid in made if grid]


def labels(records: Sequence[RunRecord], names: Iterable[str]) -> list[str]:
    """Return names for compared runs: their allocations if these differ, else *names*."""
    allocations = [record.allocation for record in records]
    if all(allocations) and len(set(allocations)) == len(allocations):
        return allocations
    return list(names)
