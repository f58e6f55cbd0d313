"""The drawn content of a report, folded from the events of a run: tracks, curves, load, notes, remarks.

``Digest`` is a tap of the event stream. Its result is plain lists and numbers that become JSON within the
document. Tracks and curves are thinned, so the report of a long run stays small. A track keeps the points
without which the interpolated position at some time would be off by more than a tolerance (top-down time
ratio, Meratnia and de By, *Spatiotemporal Compression Techniques for Moving Point Objects*, EDBT 2004). A
curve keeps the smallest and the largest value of each stretch, so no peak is lost.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from math import hypot, isnan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.base.frames import quaternion_to_euler
from volery.base.time import MS, Ns, S, to_seconds
from volery.report.grids import heading
from volery.report.published_maps import PublishedMaps, TrueTrack
from volery.requirements.record import DELIVERY_KIND
from volery.trace.attachments import RunSetup, Scenery
from volery.trace.events import (
    NONE,
    WARNING,
    Activation,
    Collision,
    Event,
    Failure,
    LinkState,
    Message,
    Milestone,
    Omitted,
    Operation,
    Published,
    Slice,
    Text,
    VehicleState,
)

Floats = NDArray[np.float64]
Indexes = NDArray[np.int64]


def thin_track(times: Floats, points: Floats, tolerance: float) -> Indexes:
    """Return the indexes of the points to keep.

    Args:
        times: n ascending times, seconds.
        points: n rows of coordinates, metres.
        tolerance: Largest error of the interpolated position, metres.
    """
    count = len(times)
    keep = np.zeros(count, dtype=bool)
    if count == 0:
        return np.flatnonzero(keep)
    keep[[0, count - 1]] = True
    stretches = [(0, count - 1)]
    while stretches:
        first, last = stretches.pop()
        if last - first < 2:
            continue
        worst, distance = _worst(times[first : last + 1], points[first : last + 1])
        if distance > tolerance:
            middle = first + worst
            keep[middle] = True
            stretches += [(first, middle), (middle, last)]
    return np.flatnonzero(keep)


def _worst(times: Floats, points: Floats) -> tuple[int, float]:
    """Return the inner point that is farthest from even motion between the ends, and its distance."""
    span = times[-1] - times[0]
    share = (times - times[0]) / span if span > 0 else np.zeros_like(times)
    even = points[0] + share[:, np.newaxis] * (points[-1] - points[0])
    off = ((points - even) ** 2).sum(axis=1)
    worst = int(off[1:-1].argmax()) + 1
    return worst, float(off[worst]) ** 0.5


def thin_curve(values: Floats, stretches: int) -> Indexes:
    """Return the indexes of the ends of *values* and of the extremes of each stretch; NaN is skipped."""
    count = len(values)
    if count <= 2 * stretches:
        return np.flatnonzero(~np.isnan(values))
    unknown = np.isnan(values)
    low, high = np.where(unknown, np.inf, values), np.where(unknown, -np.inf, values)
    keep = {0, count - 1}
    edges = [count * index // stretches for index in range(stretches + 1)]
    for first, last in pairwise(edges):
        keep.add(first + int(low[first:last].argmin()))
        keep.add(first + int(high[first:last].argmax()))
    found = np.array(sorted(keep), dtype=np.int64)
    return found[~unknown[found]]


_BIN: Ns = 500 * MS  # holds as many activations of the usual periods each time
_MOST_BINS = 300
TRACK_TOLERANCE_M = 0.15
_CURVE_STRETCHES = 350
_MOST_REMARKS = 400
_MOST_SUBJECTS = 60  # of a kind of notes
_MOST_STEPS = 200  # of a subject, after its first one

Json = dict[str, Any]


@dataclass
class _Track:
    """States of one vehicle, column by column."""

    kind: str
    columns: dict[str, array[float]] = field(
        default_factory=lambda: {name: array("d") for name in ("t", "x", "y", "z", "yaw", "v", "battery")}
    )
    modes: list[tuple[float, str, bool]] = field(default_factory=list)

    def add(self, event: VehicleState) -> None:
        at = to_seconds(event.at)
        if not self.modes or self.modes[-1][1:] != (event.mode, event.armed):
            self.modes.append((at, event.mode, event.armed))
        x, y, z = event.where()
        if isnan(x):
            return
        columns = self.columns
        columns["t"].append(at)
        columns["x"].append(x)
        columns["y"].append(y)
        columns["z"].append(z)
        _, _, yaw = quaternion_to_euler((event.qw, event.qx, event.qy, event.qz))
        columns["yaw"].append(yaw)
        columns["v"].append(hypot(event.vx, event.vy, event.vz))
        columns["battery"].append(event.battery)

    def column(self, name: str) -> Floats:
        return np.frombuffer(self.columns[name], dtype=np.float64)

    def true_track(self) -> TrueTrack:
        places = self.column("x") + 1j * self.column("y")
        return TrueTrack(self.column("t"), places, self.column("yaw"))


class Digest:
    """Stream tap that collects for its ``data`` what a report draws."""

    def __init__(self, setup: RunSetup, scenery: Scenery | None) -> None:
        self._setup = setup
        self._scenery = scenery
        self._tracks = {vehicle.name: _Track(vehicle.kind) for vehicle in setup.vehicles}
        self._load: dict[str, dict[str, list[Ns]]] = {processor.name: {} for processor in setup.processors}
        self._misses: dict[str, list[int]] = {}
        self._processor_of = {component.name: component.processor for component in setup.components}
        self._noted: dict[str, dict[str, list[Milestone]]] = {}
        self._remarks: list[Json] = []
        self._collisions: list[Json] = []
        self._left_out = 0
        self._deliveries: set[tuple[str, str]] = set()
        self._subscriptions: dict[str, set[str]] = {}
        self._lost: dict[str, list[int]] = {}
        self._omitted: dict[str, list[int]] = {}
        self._last: Ns = 0
        self._maps = PublishedMaps()
        self.takers: dict[type[Any], Callable[[Any], None]] = {
            VehicleState: self._state,
            Slice: self._slice,
            Activation: self._activation,
            Milestone: self._milestone,
            Message: self._message,
            Omitted: self._omission,
            Published: self._maps,
            **dict.fromkeys((Collision, Failure, Operation, LinkState, Text), self._remark),
        }
        """What adds an event of each kind that matters."""

    def listener(self, kind: type[Any]) -> Callable[[Any], None] | None:
        """Return what adds events of a kind; None if they do not matter."""
        return self.takers.get(kind)

    def __call__(self, event: Event) -> None:
        """Add one event."""
        add = self.takers.get(event.__class__)
        if add is not None:
            add(event)

    def _state(self, event: VehicleState) -> None:
        self._tracks.setdefault(event.vehicle, _Track("")).add(event)
        self._last = max(self._last, event.at)

    def _slice(self, event: Slice) -> None:
        self._last = max(self._last, event.end)
        bins = self._load.setdefault(event.processor, {}).setdefault(event.component, [])
        first, last = event.start // _BIN, max(event.start, event.end - 1) // _BIN
        bins.extend([0] * (last + 1 - len(bins)))
        for index in range(first, last + 1):
            bins[index] += min(event.end, (index + 1) * _BIN) - max(event.start, index * _BIN)

    def _activation(self, event: Activation) -> None:
        self._last = max(self._last, event.finished)
        if event.deadline != NONE and event.finished > event.deadline:
            counts = self._misses.setdefault(self._processor_of.get(event.component, ""), [])
            index = event.finished // _BIN
            counts.extend([0] * (index + 1 - len(counts)))
            counts[index] += 1

    def _milestone(self, event: Milestone) -> None:
        self._last = max(self._last, event.at)
        self._noted.setdefault(event.kind, {}).setdefault(event.subject, []).append(event)

    def _message(self, event: Message) -> None:
        counts = self._lost.setdefault(event.topic, [0, 0])
        counts[0] += 1
        counts[1] += event.received == NONE
        if (event.topic, event.subscriber) not in self._deliveries:
            self._deliveries.add((event.topic, event.subscriber))
            vehicle = event.topic.lstrip("/").partition("/")[0]
            if vehicle in self._tracks:
                self._subscriptions.setdefault(event.subscriber.strip("/"), set()).add(vehicle)

    def _omission(self, event: Omitted) -> None:
        counts = self._omitted.setdefault(event.topic, [0, 0])
        counts[0] += 1
        counts[1] += event.size

    def _names_of_vehicles(self) -> dict[str, str]:
        """Return {name in a note: vehicle}: its own name, or a node that subscribes to it alone."""
        alone = {name: next(iter(found)) for name, found in self._subscriptions.items() if len(found) == 1}
        return alone | {name: name for name in self._tracks}

    def _remark(self, event: Event) -> None:
        match event:
            case Collision():
                self._note(event.at, "failure", event.vehicle, str(event))
                self._collisions.append(
                    {"t": _seconds(event.at), "x": round(event.x, 2), "y": round(event.y, 2)}
                )
            case Failure():
                self._note(event.at, "failure", event.who, event.what)
            case Operation() if event.outcome != "ok":
                what = f"{event.operation} {event.asked}: {event.outcome}: {event.said}"
                self._note(event.end, "refused", event.vehicle, what)
            case LinkState():
                self._note(event.at, "link", event.link, f"{event.state} {event.detail}".strip())
            case Text():
                kind = "warning" if event.severity <= WARNING else "words"
                self._note(event.at, kind, event.source, event.text)
            case _:
                pass

    def _note(self, at: Ns, kind: str, who: str, what: str) -> None:
        self._last = max(self._last, at)
        if len(self._remarks) < _MOST_REMARKS or kind in ("failure", "refused"):
            self._remarks.append({"t": _seconds(at), "kind": kind, "who": who, "what": what})
        else:
            self._left_out += 1

    def data(self, ended: float | None = None) -> Json:
        """Return everything to draw as JSON values.

        Args:
            ended: End of the run in seconds; by default its last event.
        """
        end = to_seconds(self._last) if ended is None else ended
        return {
            "end": round(end, 3),
            "scenery": _scenery(self._scenery),
            "vehicles": [_vehicle(name, track) for name, track in self._tracks.items()],
            "processors": [self._processor(name) for name in self._load],
            "notes": [self._notes(kind, subjects) for kind, subjects in self._noted.items()],
            "collisions": self._collisions,
            **self._maps.data({name: track.true_track() for name, track in self._tracks.items()}),
            "remarks": sorted(self._remarks, key=lambda remark: float(remark["t"])),
            "left_out": self._left_out,
            "omitted": [
                {"topic": topic, "messages": messages, "bytes": size}
                for topic, (messages, size) in sorted(self._omitted.items())
            ],
            "messages": [
                {"topic": topic, "sent": sent, "lost": lost}
                for topic, (sent, lost) in sorted(self._lost.items())
            ],
        }

    def _notes(self, kind: str, subjects: dict[str, list[Milestone]]) -> Json:
        """Return what is drawn of a kind of notes: the first subjects, of each its first and last states."""
        drawn = list(subjects.items())[:_MOST_SUBJECTS]
        return {
            "kind": kind,
            "title": heading(kind),
            "left_out": len(subjects) - len(drawn),
            "subjects": [
                {"name": name, "steps": self._steps(steps[:1] + steps[1:][-_MOST_STEPS:])}
                for name, steps in drawn
            ],
        }

    def _steps(self, steps: list[Milestone]) -> list[Json]:
        vehicles = self._names_of_vehicles()
        places = {place.name: place.kind for place in self._scenery.places} if self._scenery else {}
        return [
            {
                "t": _seconds(step.at),
                "state": step.state,
                "by": step.component,
                "detail": step.detail,
                "vehicle": _mentioned(step, vehicles),
                "place": _place(step, places, first=step is steps[0]),
                "from": vehicles.get(step.component, ""),
            }
            for step in steps
        ]

    def _processor(self, name: str) -> Json:
        cores = next((processor.cores for processor in self._setup.processors if processor.name == name), 1)
        count = max((len(bins) for bins in self._load[name].values()), default=0)
        count = max(count, -(-self._last // _BIN))
        together = max(1, -(-count // _MOST_BINS))
        whole = together * _BIN * cores
        return {
            "name": name,
            "cores": cores,
            "step": to_seconds(together * _BIN),
            "components": [
                {
                    "name": component,
                    "share": [round(100.0 * ns / whole, 3) for ns in _merge(bins, together, count)],
                }
                for component, bins in self._load[name].items()
            ],
            "misses": _merge(self._misses.get(name, []), together, count),
        }


def _merge(bins: list[int], together: int, count: int) -> list[int]:
    filled = bins + [0] * (count - len(bins))
    return [sum(filled[at : at + together]) for at in range(0, count, together)]


def _mentioned(step: Milestone, names: dict[str, str]) -> str:
    """Return the vehicle in a state or its detail: the longest name, since drone_11 contains drone_1."""
    for words in (step.state, step.detail):
        found = [name for name in names if name in words]
        if found:
            return names[max(found, key=len)]
    return ""


def _place(step: Milestone, kinds: dict[str, str], first: bool) -> str:
    """Return where the subject is: the place that it is, that the state names or that the detail is.

    A place within a longer detail may be the destination, so it does not count. What is
    to be delivered is in the store at first.
    """
    if step.subject in kinds:
        return step.subject
    said = [name for name in kinds if name in step.state]
    if said:
        return max(said, key=len)
    if step.detail in kinds:
        return step.detail
    stores = [name for name, kind in kinds.items() if kind == "store"]
    return stores[0] if first and step.kind == DELIVERY_KIND and len(stores) == 1 else ""


def _seconds(at: Ns) -> float:
    return round(at / S, 3)


def rounded(values: Floats, digits: int) -> list[float]:
    """Return values for JSON."""
    found: list[float] = np.round(values, digits).tolist()
    return found


def _vehicle(name: str, track: _Track) -> Json:
    times = track.column("t")
    points = np.column_stack([track.column("x"), track.column("y"), track.column("z")])
    kept = thin_track(times, points, TRACK_TOLERANCE_M)
    return {
        "name": name,
        "kind": track.kind,
        "t": rounded(times[kept], 2),
        "x": rounded(points[kept, 0], 2),
        "y": rounded(points[kept, 1], 2),
        "z": rounded(points[kept, 2], 2),
        "modes": [[round(at, 2), mode, armed] for at, mode, armed in track.modes],
        "height": curve_json(times, track.column("z")),
        "speed": curve_json(times, track.column("v")),
        "battery": curve_json(times, 100.0 * track.column("battery")),
    }


def curve_json(times: Floats, values: Floats) -> Json:
    """Return times and values of a curve for the charts, thinned; NaN is left out."""
    kept = thin_curve(values, _CURVE_STRETCHES)
    return {"t": rounded(times[kept], 2), "v": rounded(values[kept], 2)}


def _scenery(scenery: Scenery | None) -> Json | None:
    if scenery is None:
        return None
    return {
        "origin": [scenery.origin.latitude, scenery.origin.longitude, scenery.origin.amsl],
        "places": [[place.name, place.x, place.y, place.kind] for place in scenery.places],
        "roads": scenery.roads,
        "corridors": scenery.corridors,
        "areas": [[area.name, area.kind, area.outline] for area in scenery.areas],
    }
