"""Tables that compare runs: one table for each subject, one column for each run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from volery.report.grids import (
    NOTHING,
    Cell,
    Column,
    Grid,
    bound,
    brief,
    by_state,
    count,
    energy,
    figure,
    last_states,
    milliseconds,
    number,
    plural,
    total,
    verdict,
    widest_band,
)
from volery.requirements.record import ComponentRecord, LatencyRecord, RunRecord, VehicleRecord


def _names(dictionaries: Iterable[Iterable[str]]) -> list[str]:
    """Return all keys in the order of their first occurrence."""
    return list(dict.fromkeys(name for names in dictionaries for name in names))


def outcome_comparison(labels: Sequence[str], records: Sequence[RunRecord]) -> Grid:
    """Return the outcome and the totals of each run."""
    rows = [
        ("outcome", [_outcome(record) for record in records]),
        ("requirements met", [_met(record) for record in records]),
        ("fidelity", [Cell(record.fidelity or NOTHING) for record in records]),
        ("scenario", [Cell(record.scenario or NOTHING) for record in records]),
        ("seed", [Cell(str(record.seed)) for record in records]),
        ("simulated s", [Cell(number(record.sim_s, 1)) for record in records]),
        ("faster than real time", [Cell(number(record.real_time_factor, 0, "×")) for record in records]),
        *(
            (plural(kind), [Cell(_noted(record, kind)) for record in records])
            for kind in _names(record.notes for record in records)
        ),
        ("energy of computers", [Cell(_of_computers(record)) for record in records]),
        ("energy of vehicles", [Cell(energy(total(_vehicles(record)))) for record in records]),
    ]
    columns = (Column(""), *(Column(label, True) for label in labels))
    return Grid("The runs", columns, tuple((Cell(name), *cells) for name, cells in rows))


def _of_computers(record: RunRecord) -> str:
    return " ".join(filter(None, (energy(total(_computers(record))), widest_band(record))))


def _outcome(record: RunRecord) -> Cell:
    good = record.outcome.status == "completed"
    return Cell(record.outcome.status, status="good" if good else "bad")


def _met(record: RunRecord) -> Cell:
    judged = [requirement for requirement in record.requirements.values() if requirement.met is not None]
    met = sum(1 for one in judged if one.met)
    return Cell(
        f"{met} of {len(record.requirements)}", status="good" if met == len(record.requirements) else "bad"
    )


def _noted(record: RunRecord, kind: str) -> str:
    return by_state(dict(last_states(record.notes.get(kind, {})).most_common())) or NOTHING


def _computers(record: RunRecord) -> list[float | None]:
    return [processor.energy_j for processor in record.processors.values()]


def _vehicles(record: RunRecord) -> list[float | None]:
    return [vehicle.energy_j for vehicle in record.vehicles.values()]


def requirements_comparison(labels: Sequence[str], records: Sequence[RunRecord]) -> Grid:
    """Return the observed value and the verdict of each requirement in every run."""
    rows = []
    for name in _names(record.requirements for record in records):
        first = next(record.requirements[name] for record in records if name in record.requirements)
        cells = [Cell(name), Cell(bound(first), status="quiet")]
        for record in records:
            requirement = record.requirements.get(name)
            if requirement is None:
                cells.append(Cell("not required", status="quiet"))
            else:
                judged = verdict(requirement)
                cells.append(
                    Cell(
                        f"{figure(requirement.observed, requirement.unit)}  {judged.text}",
                        status=judged.status,
                    )
                )
        rows.append(tuple(cells))
    columns = (Column("requirement"), Column("bound", True), *(Column(label, True) for label in labels))
    return Grid("Requirements", columns, tuple(rows))


Take = Callable[[ComponentRecord], Cell]
_QUESTIONS: tuple[tuple[str, Take], ...] = (
    ("execution s", lambda one: Cell(brief(one.cpu_s), share=one.cpu_s)),
    ("of it ROS s", lambda one: Cell(brief(one.ros_cpu_s), share=one.ros_cpu_s)),
    ("response p95 ms", lambda one: Cell(milliseconds(one.response_s.p95), share=one.response_s.p95)),
    ("response max ms", lambda one: Cell(milliseconds(one.response_s.max), share=one.response_s.max)),
    (
        "deadline misses",
        lambda one: (
            Cell(count(one.deadline_misses), status="bad" if one.deadline_misses else "")
            if one.activations
            else Cell(NOTHING)
        ),
    ),
    ("energy", lambda one: Cell(energy(one.energy_j), share=one.energy_j)),
)
_IN_SHORT: tuple[tuple[str, Take], ...] = (
    ("exec s", _QUESTIONS[0][1]),
    ("p95 ms", _QUESTIONS[2][1]),
    ("late", _QUESTIONS[4][1]),
    ("J", lambda one: Cell(number(one.energy_j, 2), share=one.energy_j)),
)
"""Columns of the short table, for 80 characters."""


def _on_computers(records: Sequence[RunRecord]) -> list[str]:
    """Return the components that at least one run executes on a processor."""
    names = _names(record.components for record in records)
    everywhere = [(name, record.components.get(name)) for name in names for record in records]
    placed = {name for name, one in everywhere if one is not None and one.processor}
    return [name for name in names if name in placed]


def cost_comparison(labels: Sequence[str], records: Sequence[RunRecord]) -> Grid:
    """Return the processor and the costs of each component in every run."""
    rows = []
    for name in _on_computers(records):
        found = [record.components.get(name) for record in records]
        places = [Cell(one.processor or "none", status="quiet") if one else Cell(NOTHING) for one in found]
        rows.append((Cell(name), Cell("processor", status="quiet"), *places))
        for question, take in _QUESTIONS:
            cells = [take(one) if one else Cell(NOTHING) for one in found]
            if any(cell.text != NOTHING for cell in cells):
                rows.append((Cell(""), Cell(question, status="quiet"), *_relative(cells)))
    columns = (Column("component"), Column(""), *(Column(label, True) for label in labels))
    return Grid("Cost of each component", columns, tuple(rows))


def cost_matrix(labels: Sequence[str], records: Sequence[RunRecord]) -> Grid:
    """Return the most important costs of each component, in one row."""
    rows = []
    for name in _on_computers(records):
        cells = [Cell(name)]
        for _, take in _IN_SHORT:
            found = [record.components.get(name) for record in records]
            cells += _relative([take(one) if one else Cell(NOTHING) for one in found])
        rows.append(tuple(cells))
    columns = [Column(f"{question}\n{label}", True) for question, _ in _IN_SHORT for label in labels]
    return Grid("Cost of each component", (Column("component"), *columns), tuple(rows))


def processor_comparison(labels: Sequence[str], records: Sequence[RunRecord]) -> Grid:
    """Return the kind, utilisation and energy of each processor in every run."""
    rows = []
    for name in _names(record.processors for record in records):
        found = [record.processors.get(name) for record in records]
        kinds = [Cell(one.kind, status="quiet") if one else Cell(NOTHING) for one in found]
        frequencies = [Cell(number(one.frequency_mhz, 0, "MHz") if one else NOTHING) for one in found]
        loads = [
            Cell(number(100.0 * one.utilisation, 2, "%"), share=one.utilisation) if one else Cell(NOTHING)
            for one in found
        ]
        taken = [Cell(energy(one.energy_j), share=one.energy_j) if one else Cell(NOTHING) for one in found]
        rows.append((Cell(name), Cell("kind", status="quiet"), *kinds))
        rows.append((Cell(""), Cell("frequency", status="quiet"), *frequencies))
        rows.append((Cell(""), Cell("utilisation", status="quiet"), *loads))
        rows.append((Cell(""), Cell("energy", status="quiet"), *_relative(taken)))
    columns = (Column("processor"), Column(""), *(Column(label, True) for label in labels))
    return Grid("Processors", columns, tuple(rows))


def chain_comparison(labels: Sequence[str], records: Sequence[RunRecord]) -> Grid:
    """Return the latency along each chain of topics in every run."""
    rows = []
    for name in _names(record.chains for record in records):
        found = [record.chains.get(name) for record in records]
        latencies = [one.latency_s if one else LatencyRecord() for one in found]
        for first, question, values in (
            (name, "p95 ms", [latency.p95 for latency in latencies]),
            ("", "max ms", [latency.max for latency in latencies]),
        ):
            cells = [Cell(milliseconds(value), share=value) for value in values]
            rows.append((Cell(first), Cell(question, status="quiet"), *_relative(cells)))
    columns = (Column("chain"), Column(""), *(Column(label, True) for label in labels))
    return Grid("Latency along chains of topics", columns, tuple(rows))


_VEHICLE_QUESTIONS: tuple[tuple[str, Callable[[VehicleRecord], Cell]], ...] = (
    ("distance m", lambda one: Cell(number(one.distance_m), share=one.distance_m)),
    ("airborne s", lambda one: Cell(number(one.airborne_s), share=one.airborne_s)),
    ("energy", lambda one: Cell(energy(one.energy_j), share=one.energy_j)),
)


def vehicle_comparison(labels: Sequence[str], records: Sequence[RunRecord]) -> Grid:
    """Return the distance, time and energy of each vehicle in every run."""
    rows = []
    for name in _names(record.vehicles for record in records):
        found = [record.vehicles.get(name) for record in records]
        for index, (question, take) in enumerate(_VEHICLE_QUESTIONS):
            cells = [take(one) if one else Cell(NOTHING) for one in found]
            first = Cell("" if index else name)
            rows.append((first, Cell(question, status="quiet"), *_relative(cells)))
    columns = (Column("vehicle"), Column(""), *(Column(label, True) for label in labels))
    return Grid("Vehicles", columns, tuple(rows))


def _relative(cells: list[Cell]) -> list[Cell]:
    """Scale the shares to the largest of the runs; without bars if all are about equal."""
    shares = [cell.share for cell in cells if cell.share is not None]
    largest = max(shares, default=0.0)
    if largest <= 0.0 or min(shares) > 0.99 * largest:
        return [Cell(cell.text, None, cell.status) for cell in cells]
    return [
        Cell(cell.text, None if cell.share is None else cell.share / largest, cell.status) for cell in cells
    ]


def all_comparisons(labels: Sequence[str], records: Sequence[RunRecord]) -> list[Grid]:
    """Return all tables that have rows, in reading order."""
    made = (
        outcome_comparison(labels, records),
        requirements_comparison(labels, records),
        cost_comparison(labels, records),
        chain_comparison(labels, records),
        processor_comparison(labels, records),
        vehicle_comparison(labels, records),
    )
    return [grid for grid in made if grid]
