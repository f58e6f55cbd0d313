"""Runs and logs side by side: what is read of each, and one HTML file that needs no network.

Tables compare the records of runs; flights are compared with those of the first side, vehicle by vehicle: by
name, or in their order where no name is the same. Times of tracks and curves count from the first arming.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from volery.base.errors import UsageError
from volery.base.files import write_text
from volery.report.comparison import all_comparisons
from volery.report.digest import TRACK_TOLERANCE_M, Json, curve_json, rounded, thin_track
from volery.report.flight_comparison import (
    WITHIN_M,
    FlightComparison,
    answer_grid,
    compare_flights,
    phase_grid,
    text_grid,
    turned,
)
from volery.report.flights import (
    BATTERY,
    EAST,
    HEIGHT,
    PITCH,
    PLACE,
    ROLL,
    SPEED,
    YAW,
    Array,
    Curve,
    VehicleFlight,
    read_flights,
)
from volery.report.grids import Grid, labels
from volery.report.html_report import REPORT_FILE, embedded, environment, gather
from volery.requirements.record import RUN_FILE, RunRecord, read_record

COMPARISON_FILE = "comparison.html"
FOOTER = "volery: one model, simulated, priced and flown"
_STEP_S, _MOST_STEPS = 0.1, 3000
"""Time between two values of a difference, and how many there are at most."""
_CHARTS = (
    (HEIGHT, "Height", "m above the place of arming"),
    (SPEED, "Speed", "m/s"),
    (ROLL, "Roll", "°, right side down"),
    (PITCH, "Pitch", "°, nose up"),
    (YAW, "Heading", "°, clockwise from north"),
    (BATTERY, "Battery", "%"),
)
_DISTANCE = "distance"


@dataclass(frozen=True)
class Side:
    """What is compared. ``record`` is None of a log; a run may have no flights."""

    path: Path
    name: str
    flights: tuple[VehicleFlight, ...]
    record: RunRecord | None


def read_side(path: Path, name: str = "") -> Side:
    """Read a run folder or a log.

    Args:
        path: Run folder, tlog, DataFlash log or ULog.
        name: What to call it; by default the name of the folder or file.

    Raises:
        UsageError: As ``read_flights``.
    """
    flights = read_flights(path)
    record = None
    if path.is_dir():
        record = read_record(path) if (path / RUN_FILE).exists() else gather(path).record
    return Side(path, name or path.resolve().name, flights, record)


class Comparison:
    """Sides, at least two, and their flights beside those of the first.

    Args:
        sides: What is compared.
        within_m: Distance between the ways of phases that are alike.

    Raises:
        UsageError: There are fewer than two sides, or a run beside a log has no vehicle.
    """

    def __init__(self, sides: Sequence[Side], within_m: float = WITHIN_M) -> None:
        if len(sides) < 2:
            raise UsageError(f"a comparison takes at least two runs or logs, not {len(sides)}")
        self.sides = tuple(sides)
        records = [side.record for side in sides if side.record is not None]
        self.records = records if len(records) == len(sides) else []
        names = [side.name for side in sides]
        if len(set(names)) < len(names):
            names = [str(side.path) for side in sides]
        self.labels = labels(self.records, names) if self.records else names
        for side in () if self.records else self.sides:
            if not side.flights:
                raise UsageError(f"{side.path} has no vehicle, and a log is compared with flights alone")
        self.flown: list[tuple[str, VehicleFlight]] = []
        self.flights: list[list[FlightComparison]] = [[] for _ in sides]
        self.pairs: list[tuple[int, int]] = []
        self._pair(within_m)

    def _pair(self, within_m: float) -> None:
        """Compare the vehicles of each side with those of the first."""
        first = self.sides[0]
        starts = []
        for side, label in zip(self.sides, self.labels, strict=True):
            starts.append(len(self.flown))
            several = len(side.flights) > 1
            self.flown += [
                (f"{label} {flight.vehicle}" if several else label, flight) for flight in side.flights
            ]
        for number, side in enumerate(self.sides[1:], 1):
            for a, b in _partners(first.flights, side.flights):
                here, there = self.flown[a], self.flown[starts[number] + b]
                self.pairs.append((a, starts[number] + b))
                self.flights[number].append(compare_flights(here[1], there[1], (here[0], there[0]), within_m))

    @property
    def run_grids(self) -> list[Grid]:
        """The tables of the records; none if one of the sides is a log."""
        return all_comparisons(self.labels, self.records) if self.records else []

    @property
    def all_flights(self) -> list[FlightComparison]:
        """The comparisons of all sides."""
        return [one for side in self.flights for one in side]

    def plain(self) -> list[Json]:
        """Return each side as plain data: the content of ``run.json`` or the log, and the comparison."""
        return [
            {
                **(_log(side) if side.record is None else side.record.model_dump(mode="json", by_alias=True)),
                **({"comparison": [one.plain() for one in compared]} if compared else {}),
            }
            for side, compared in zip(self.sides, self.flights, strict=True)
        ]

    def html(self, beside: Path | None = None) -> str:
        """Return the page.

        Args:
            beside: Folder of the page, to which the links to the reports are relative; None for no links.
        """
        runs = [
            {
                "label": label,
                "link": _link(side.path, beside),
                "not_counted": side.record.not_counted,
                "warnings": side.record.warnings,
                "unserved": [str(one) for one in side.record.unserved],
            }
            for label, side in zip(self.labels, self.sides, strict=True)
            if side.record is not None
        ]
        titles = [side.name if side.record is None else side.record.system or "a run" for side in self.sides]
        data = self._drawn()
        return (
            environment()
            .get_template("comparison.html.j2")
            .render(
                title=" and ".join(dict.fromkeys(titles)),
                subtitle=" · ".join(self.labels),
                grids=self.run_grids,
                verdicts=[flight.verdict for flight in self.all_flights],
                alike=all(phase.alike for flight in self.all_flights for phase in flight.phases),
                flights=[_grids(flight) for flight in self.all_flights],
                runs=runs,
                moving=bool(self.pairs),
                charts=_CHARTS,
                end=data["end"],
                data=embedded(data),
                footer=FOOTER,
            )
        )

    def _drawn(self) -> Json:
        """Return what the scripts of the page draw."""
        vehicles = [_vehicle(name, flight) for name, flight in self.flown]
        for a, b in self.pairs:  # the heading of the second goes on from that of the first
            own, other = (vehicles[index][YAW] for index in (a, b))
            if own["v"] and other["v"]:
                turns = 360.0 * round((own["v"][0] - other["v"][0]) / 360.0)
                other["v"] = [round(value + turns, 2) for value in other["v"]]
        return {
            "end": round(
                max((_span(flight)[1] - _span(flight)[0] for _, flight in self.flown), default=0.0), 3
            ),
            "scenery": None,
            "vehicles": vehicles,
            "differences": [
                {"name": f"{self.flown[b][0]} – {self.flown[a][0]}", "colour": b}
                | _differences(self.flown[a][1], self.flown[b][1])
                for a, b in self.pairs
            ],
            **{
                name: []
                for name in ("processors", "notes", "collisions", "maps", "paths", "scans", "pictures")
            },
        }

    def write(self, into: Path) -> Path:
        """Write ``comparison.html`` into a folder and return its path.

        Raises:
            UsageError: It cannot be written.
        """
        path = into / COMPARISON_FILE
        try:
            write_text(path, self.html(into))
        except OSError as error:
            raise UsageError(f"cannot write {path}: {error.strerror or error}") from error
        return path


def _partners(first: Sequence[VehicleFlight], second: Sequence[VehicleFlight]) -> list[tuple[int, int]]:
    """Return the vehicles that are compared, by their places on each side."""
    places = {flight.vehicle: place for place, flight in enumerate(second)}
    same = [(place, places[one.vehicle]) for place, one in enumerate(first) if one.vehicle in places]
    return same or list(zip(range(len(first)), range(len(second)), strict=False))


def _log(side: Side) -> Json:
    return {"log": str(side.path), "vehicles": [flight.vehicle for flight in side.flights]}


def _link(folder: Path, beside: Path | None) -> str:
    report = folder / REPORT_FILE
    if beside is None or not report.exists():
        return ""
    return Path(os.path.relpath(report.resolve(), beside.resolve())).as_posix()


def _grids(one: FlightComparison) -> list[Grid]:
    return [grid for grid in (phase_grid(one), answer_grid(one), text_grid(one)) if grid]


# -- what is drawn


def _span(flight: VehicleFlight) -> tuple[float, float]:
    """Return first arming and last disarming; without any the whole track."""
    if flight.armed:
        return flight.armed[0].begin, flight.armed[-1].end
    times = flight.curves[EAST].times
    return (float(times[0]), float(times[-1])) if len(times) else (0.0, 0.0)


def _within(curve: Curve, span: tuple[float, float]) -> tuple[Array, Array]:
    """Return times from the begin of a span on, and values, of the part of a curve that is in it."""
    inside = (curve.times >= span[0]) & (curve.times <= span[1])
    return curve.times[inside] - span[0], curve.values[inside]


def _vehicle(name: str, flight: VehicleFlight) -> Json:
    span = _span(flight)
    columns = [_within(flight.curves[one], span) for one in PLACE]
    times, points = columns[0][0], np.column_stack([values for _, values in columns])
    kept = thin_track(times, points, TRACK_TOLERANCE_M)
    modes = [
        [round(state.at - span[0], 2), state.mode, state.armed]
        for state in flight.states
        if state.at >= span[0]
    ]
    return {
        "name": name,
        "kind": "multirotor" if flight.flies else "rover",
        "t": rounded(times[kept], 2),
        **{axis: rounded(points[kept, index], 2) for index, axis in enumerate("xyz")},
        "modes": modes,
        **{one: curve_json(*_within(flight.curves[one], span)) for one, *_ in _CHARTS},
    }


def _differences(first: VehicleFlight, second: VehicleFlight) -> Json:
    """Return what the second has more than the first at the same time after arming, and their distance."""
    spans = _span(first), _span(second)
    until = min(end - begin for begin, end in spans)
    times = np.linspace(0.0, until, min(int(until / _STEP_S) + 1, _MOST_STEPS))
    here, there = times + spans[0][0], times + spans[1][0]
    found: Json = {}
    for name, *_ in _CHARTS:
        values = second.values(name, there) - first.values(name, here)
        found[name] = curve_json(times, turned(values) if name == YAW else values)
    apart = np.linalg.norm(second.places(there) - first.places(here), axis=1)
    return {**found, _DISTANCE: curve_json(times, apart)}
