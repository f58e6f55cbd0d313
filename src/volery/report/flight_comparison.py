"""Two flights beside each other, phase by phase, with what was answered and said.

Phases are the operations of two runs, else, where one side is a log, what arming, height and modes show. They
are matched by name and order. Within a phase both tracks begin at the same time and place. ``path_m`` is the
distance between the two ways, whatever the time, so that a slower vehicle on the same way is judged by the
duration alone; ``apart_m`` is the distance at the same time.

A phase is alike if its durations differ by no more than a tenth of the longer one (or ``LEAST_S``) and the
ways by no more than some metres. Of one that is not, the verdict says what exceeds its bound the most.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher
from itertools import groupby
from math import isnan
from typing import NamedTuple, TypeVar

import numpy as np

from volery.base.time import to_seconds
from volery.report.digest import thin_track
from volery.report.flights import ANGLES, DONE, EAST, HEIGHT, Array, FlightAnswer, Stretch, VehicleFlight
from volery.report.grids import NOTHING, Cell, Column, Grid, number
from volery.trace.events import WARNING

SHARE, LEAST_S, WITHIN_M = 0.1, 1.0, 2.0
"""Differences of phases that are alike: of the longer duration, at least in seconds, and of the ways in
metres. A heartbeat of a tlog comes once a second, so arming and modes are no better known there."""

ARMED, ON_GROUND, BEFORE_ARMING, TAKE_OFF, LANDING = (
    "armed", "armed on the ground", "before arming", "take-off", "landing",
)  # fmt: skip
COMMON = (ARMED, ON_GROUND, BEFORE_ARMING, TAKE_OFF, LANDING)
"""Phases that do not depend on the autopilot or the mission."""
LEAST_CLIMB_M, LEVEL_M_S = 0.5, 0.2
"""Least height of a climb that is a take-off; rate of one that neither climbs nor descends."""
_CLIMB_S = 1.0
"""Time over which the rate of climb is taken."""
_STEP_S = 0.1
_PATH_TOLERANCE_M, _MOST_PLACES = 0.05, 1000
"""Of a way: distance at which a place between others is left out, and how many there are at most."""
_MOST_PAIRS = 2_000_000
"""Pairs of a point and a line that are computed at once."""


class FlightPhase(NamedTuple):
    """A part of a flight that has a name."""

    name: str
    stretch: Stretch
    asked: str = ""

    @property
    def seconds(self) -> float:
        """Its duration."""
        return self.stretch.end - self.stretch.begin


def phases(flight: VehicleFlight, *, by_operations: bool) -> list[FlightPhase]:
    """Return the phases of a flight in the order of their beginning, those that contain others first.

    Args:
        flight: What the vehicle did.
        by_operations: Take the operations of its run; else arming, take-off, modes and landing. What an
            operation waits for until the vehicle arms, such as satellites, is a phase of its own.
    """
    found = _asked(flight) if by_operations else []
    for armed in flight.armed:
        climbs = _climbs(flight, armed) if flight.flies else []
        found.append(FlightPhase(ARMED if climbs or not flight.flies else ON_GROUND, armed))
        if not by_operations:
            found += [FlightPhase(f"mode {mode}", stretch) for mode, stretch in flight.modes(armed)] + climbs
    return sorted(found, key=lambda one: (one.stretch.begin, -one.stretch.end))


def _asked(flight: VehicleFlight) -> list[FlightPhase]:
    found = []
    for operation in flight.operations:
        begin, end = to_seconds(operation.start), to_seconds(operation.end)
        arming = next((armed.begin for armed in flight.armed if begin < armed.begin < end), begin)
        if arming > begin:
            found.append(FlightPhase(BEFORE_ARMING, Stretch(begin, arming), operation.asked))
        found.append(FlightPhase(operation.operation, Stretch(arming, end), operation.asked))
    return found


def _climbs(flight: VehicleFlight, armed: Stretch) -> list[FlightPhase]:
    """Return the first climb and the last descent between arming and disarming: take-off and landing.

    The height at which it stands before and after does not matter: estimates drift on the ground.
    """
    times = np.arange(armed.begin, armed.end, _STEP_S)
    half = _CLIMB_S / 2.0
    rates = (flight.values(HEIGHT, times + half) - flight.values(HEIGHT, times - half)) / _CLIMB_S
    climbs, descents = (_moves(times, rates * sign) for sign in (1.0, -1.0))
    found = [FlightPhase(TAKE_OFF, climb) for climb in climbs[:1]]
    if not (flight.ends_armed and armed == flight.armed[-1]):
        found += [FlightPhase(LANDING, descent) for descent in descents[-1:]]  # a log may begin in the air
    return found


def _moves(times: Array, rates: Array) -> list[Stretch]:
    """Return where a rate stays above that of a level flight for more than ``LEAST_CLIMB_M``."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], rates > LEVEL_M_S, [0]))))
    return [
        Stretch(float(times[begin]), float(times[end - 1]))
        for begin, end in edges.reshape(-1, 2)
        if np.sum(rates[begin:end]) * _STEP_S > LEAST_CLIMB_M
    ]


Key = TypeVar("Key", bound=Hashable)


def aligned(first: Sequence[Key], second: Sequence[Key]) -> list[tuple[int | None, int | None]]:
    """Return the indexes of two sequences side by side, in the order of both; None where one has no equal."""
    pairs: list[tuple[int | None, int | None]] = []
    for tag, a, b, c, d in SequenceMatcher(None, first, second, autojunk=False).get_opcodes():
        if tag == "equal":
            pairs += zip(range(a, b), range(c, d), strict=True)
        else:
            pairs += [(index, None) for index in range(a, b)]
            pairs += [(None, index) for index in range(c, d)]
    return pairs


@dataclass(frozen=True)
class PhaseDifference:
    """A phase on both sides; None where a side does not have it, and of what is then not known.

    Attributes:
        name: Name with its number, if there are several.
        asked: What was asked of the first side that has it.
        seconds: Duration on each side.
        ends: East, north, up of the place of arming at the end, on each side [m].
        apart_m: Greatest distance at the same time after the begin.
        path_m: Greatest distance between the ways.
        rms_deg: Root mean square of the differences of roll, pitch and yaw at the same time.
        verdict: ``alike``, or what differs most.
        excess: By how much it exceeds its bound; up to 1 the phase is alike.
    """

    name: str
    asked: str
    seconds: tuple[float | None, float | None]
    ends: tuple[tuple[float, ...] | None, tuple[float, ...] | None]
    apart_m: float | None = None
    path_m: float | None = None
    rms_deg: tuple[float | None, ...] = (None, None, None)
    verdict: str = ""
    excess: float | None = None

    @property
    def alike(self) -> bool:
        """Whether both sides have the phase and it is alike."""
        return self.excess is not None and self.excess <= 1.0

    @property
    def longer_s(self) -> float | None:
        """By how much it takes longer on the second side."""
        first, second = self.seconds
        return None if first is None or second is None else second - first

    @property
    def ends_apart_m(self) -> float | None:
        """Distance between the ends, both measured from the place of arming."""
        first, second = self.ends
        if first is None or second is None:
            return None
        return float(np.linalg.norm(np.subtract(second, first)))

    def plain(self) -> dict[str, object]:
        """Return all of it as plain data, to a millisecond, a millimetre and a thousandth of a degree."""
        return {
            "phase": self.name,
            "asked": self.asked,
            "seconds": [_rounded(second) for second in self.seconds],
            "longer_s": _rounded(self.longer_s),
            "ends_east_north_up_m": [None if end is None else list(map(_rounded, end)) for end in self.ends],
            "ends_apart_m": _rounded(self.ends_apart_m),
            "apart_m": _rounded(self.apart_m),
            "path_m": _rounded(self.path_m),
            **{f"{name}_rms_deg": _rounded(value) for name, value in zip(ANGLES, self.rms_deg, strict=True)},
            "alike": self.alike,
            "verdict": self.verdict,
        }


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 3)


class ComparedRow(NamedTuple):
    """Something of both sides: what it is, and how often, or with what outcome, each has it; None: not."""

    what: str
    first: str | None
    second: str | None


class Said(NamedTuple):
    """A text that one side alone has said.

    ``side`` is 0 or 1, ``after_arming_s`` the time of the first of several after the vehicle first armed.
    """

    side: int
    after_arming_s: float
    severity: int
    text: str
    times: int


@dataclass(frozen=True)
class FlightComparison:
    """Two flights. ``texts`` are those of one side alone, ``said_by_both`` counts the others."""

    labels: tuple[str, str]
    within_m: float
    phases: tuple[PhaseDifference, ...]
    answers: tuple[ComparedRow, ...]
    texts: tuple[Said, ...]
    said_by_both: int

    @property
    def verdict(self) -> str:
        """One line: how many phases are alike, and what differs most."""
        first, second = self.labels
        both = [phase for phase in self.phases if phase.excess is not None]
        if not both:
            return f"{second} against {first}: they have no phase in common"
        alike = sum(one.alike for one in both)
        words = [f"{second} against {first}: {alike} of {len(both)} phases alike"]
        worst = max(both, key=lambda one: one.excess or 0.0)
        if not worst.alike:
            words.append(f"most different is {worst.name}, {worst.verdict}")
        for side, label in enumerate(self.labels):
            only = [phase.name for phase in self.phases if phase.seconds[1 - side] is None]
            if only:
                words.append(f"only {label} has {', '.join(only)}")
        return "; ".join(words)

    def plain(self) -> dict[str, object]:
        """Return all of it as plain data."""
        return {
            "sides": list(self.labels),
            "verdict": self.verdict,
            "criterion": {"duration_share": SHARE, "duration_least_s": LEAST_S, "path_m": self.within_m},
            "phases": [phase.plain() for phase in self.phases],
            "answers": [answer._asdict() for answer in self.answers],
            "texts_of_one_side": [
                {
                    **text._asdict(),
                    "side": self.labels[text.side],
                    "after_arming_s": _rounded(text.after_arming_s),
                }
                for text in self.texts
            ],
            "texts_of_both": self.said_by_both,
        }


def compare_flights(
    first: VehicleFlight, second: VehicleFlight, labels: tuple[str, str], within_m: float = WITHIN_M
) -> FlightComparison:
    """Compare two flights.

    Args:
        first: What the second is compared with.
        second: The other.
        labels: What to call them.
        within_m: Distance between the ways of phases that are alike.
    """
    by_operations = bool(first.operations and second.operations)
    pairs = _matched(*(phases(one, by_operations=by_operations) for one in (first, second)))
    begins = [one.armed[0].begin if one.armed else 0.0 for one in (first, second)]

    def position(pair: Pair) -> tuple[float, float]:
        side = 0 if pair[0] is not None else 1
        phase = pair[side]
        assert phase is not None
        return phase.stretch.begin - begins[side], -phase.seconds

    pairs.sort(key=position)
    texts, both = _said((first, second), begins)
    return FlightComparison(
        labels,
        within_m,
        tuple(
            _difference(name, (first, second), pair, labels, within_m)
            for name, pair in zip(_numbered(pairs), pairs, strict=True)
        ),
        tuple(_answers(first.answers, second.answers)),
        texts,
        both,
    )


Pair = tuple[FlightPhase | None, FlightPhase | None]


def _matched(own: Sequence[FlightPhase], others: Sequence[FlightPhase]) -> list[Pair]:
    """Return the phases in pairs: what all flights have by number, operations and modes in their order."""
    pairs: list[Pair] = []
    for name in COMMON:
        a, b = ([one for one in side if one.name == name] for side in (own, others))
        common = min(len(a), len(b))
        pairs += zip(a[:common], b[:common], strict=True)
        pairs += [(one, None) for one in a[common:]] + [(None, one) for one in b[common:]]
    a, b = ([one for one in side if one.name not in COMMON] for side in (own, others))
    for part, other in _gaps(a, b, pairs):
        for i, j in aligned([one.name for one in part], [one.name for one in other]):
            pairs.append((None if i is None else part[i], None if j is None else other[j]))
    return pairs


def _gaps(
    own: Sequence[FlightPhase], others: Sequence[FlightPhase], pairs: list[Pair]
) -> Iterable[tuple[Sequence[FlightPhase], Sequence[FlightPhase]]]:
    """Add the pairs that were asked the same, and yield what lies between them on each side."""
    keys = ([(one.name, one.asked) for one in side] for side in (own, others))
    i = j = 0
    for here, there in aligned(*keys):
        if here is not None and there is not None:
            yield own[i:here], others[j:there]
            pairs.append((own[here], others[there]))
            i, j = here + 1, there + 1
    yield own[i:], others[j:]


def _numbered(pairs: Iterable[Pair]) -> list[str]:
    """Return the names of the phases, with numbers where one comes several times."""
    names = [phase.name for pair in pairs if (phase := pair[0] or pair[1]) is not None]
    counts, seen = Counter(names), Counter[str]()
    found = []
    for name in names:
        seen[name] += 1
        found.append(f"{name} {seen[name]}" if counts[name] > 1 else name)
    return found


def _difference(
    name: str,
    flights: tuple[VehicleFlight, VehicleFlight],
    pair: Pair,
    labels: tuple[str, str],
    within_m: float,
) -> PhaseDifference:
    first, second = pair
    asked = next((one.asked for one in pair if one is not None and one.asked), "")
    seconds = None if first is None else first.seconds, None if second is None else second.seconds
    ends = _end(flights[0], first), _end(flights[1], second)
    if first is None or second is None:
        return PhaseDifference(
            name, asked, seconds, ends, verdict=f"only {_headings(labels)[first is None]} has it"
        )
    after = np.arange(0.0, min(first.seconds, second.seconds) + _STEP_S / 2.0, _STEP_S)
    times = first.stretch.begin + after, second.stretch.begin + after
    here, there = (_from_begin(flight, at) for flight, at in zip(flights, times, strict=True))
    whole = [
        _from_begin(flight, np.linspace(*one.stretch, min(int(one.seconds / _STEP_S) + 2, _MOST_PLACES)))
        for flight, one in zip(flights, (first, second), strict=True)
    ]
    tracked = all(len(flight.curves[EAST].times) for flight in flights)
    path_m = max(_farthest(whole[0], whole[1]), _farthest(whole[1], whole[0])) if tracked else None
    longer = second.seconds - first.seconds
    allowed = max(SHARE * max(first.seconds, second.seconds), LEAST_S)
    by_time, by_path = abs(longer) / allowed, 0.0 if path_m is None else path_m / within_m
    words = f"{abs(longer):.1f} s {'longer' if longer > 0.0 else 'shorter'}"
    if first.seconds > 0.0:
        words += f" ({100.0 * longer / first.seconds:+.0f} %)"
    if by_path > by_time:
        words = f"ways {path_m:.1f} m apart"
    return PhaseDifference(
        name,
        asked,
        seconds,
        ends,
        _known(float(np.max(np.linalg.norm(there - here, axis=1)))),
        path_m,
        tuple(_rms(flights, angle, times) for angle in ANGLES),
        "alike" if max(by_time, by_path) <= 1.0 else words,
        max(by_time, by_path),
    )


def _known(value: float) -> float | None:
    return None if isnan(value) else value


def _end(flight: VehicleFlight, phase: FlightPhase | None) -> tuple[float, ...] | None:
    if phase is None or not len(flight.curves[EAST].times):
        return None
    (place,) = flight.places(np.array([phase.stretch.end]))
    return tuple(place.tolist())


def _from_begin(flight: VehicleFlight, times: Array) -> Array:
    """Return the places at some times from the first of them."""
    places = flight.places(times)
    from_first: Array = places - places[0]
    return from_first


def _farthest(points: Array, way: Array) -> float:
    """Return the greatest distance of *points* from a way, which is straight between its points."""
    corners = way[thin_track(np.arange(len(way), dtype=float), way, _PATH_TOLERANCE_M)]
    begins = corners[:-1] if len(corners) > 1 else corners
    along = np.diff(corners, axis=0) if len(corners) > 1 else np.zeros_like(corners)
    squares = np.maximum(np.sum(along * along, axis=1), 1e-12)
    farthest = 0.0
    for part in np.array_split(points, max(1, len(points) * len(begins) // _MOST_PAIRS)):
        off = part[:, np.newaxis] - begins
        share = np.clip(np.sum(off * along, axis=2) / squares, 0.0, 1.0)
        distances = np.linalg.norm(off - share[..., np.newaxis] * along, axis=2)
        farthest = max(farthest, float(np.max(np.min(distances, axis=1))))
    return farthest


def _rms(
    flights: tuple[VehicleFlight, VehicleFlight], angle: str, times: tuple[Array, Array]
) -> float | None:
    first, second = (flight.values(angle, at) for flight, at in zip(flights, times, strict=True))
    return _known(float(np.sqrt(np.mean(np.square(turned(second - first))))))


def turned(degrees: Array) -> Array:
    """Return angles from -180 to 180 degrees."""
    found: Array = np.mod(degrees + 180.0, 360.0) - 180.0
    return found


# -- answers and texts


def _answers(first: Iterable[FlightAnswer], second: Iterable[FlightAnswer]) -> Iterable[ComparedRow]:
    """Yield what was asked, in order, with the outcome on each side; the same in succession once."""
    a, b = (_repeated(side) for side in (first, second))
    for i, j in aligned([asked for asked, _ in a], [asked for asked, _ in b]):
        outcomes = None if i is None else a[i][1], None if j is None else b[j][1]
        yield ComparedRow(a[i][0] if i is not None else b[j or 0][0], *outcomes)


def _repeated(answers: Iterable[FlightAnswer]) -> list[tuple[str, str]]:
    found = []
    for (asked, outcome, said), group in groupby(answers, key=lambda one: one[1:]):
        times = sum(1 for _ in group)
        words = f"{outcome}: {said}" if said else outcome
        found.append((asked, f"{words} ×{times}" if times > 1 else words))
    return found


_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?")
_MODULE = re.compile(r"^\[[^\]]*\]\s*")


def _meaning(text: str) -> str:
    """Return what texts have in common that differ in numbers, or in the module that PX4's own logs name."""
    return _NUMBER.sub("#", _MODULE.sub("", text))


def _said(
    flights: tuple[VehicleFlight, VehicleFlight], begins: Sequence[float]
) -> tuple[tuple[Said, ...], int]:
    """Return the texts of one side alone in the order of their times, and how many both sides have."""
    meanings = [Counter(_meaning(text.text) for text in flight.texts) for flight in flights]
    only = []
    for side, flight in enumerate(flights):
        first = {_meaning(text.text): text for text in reversed(flight.texts)}
        for meaning, times in meanings[side].items():
            if meaning not in meanings[1 - side]:
                one = first[meaning]
                only.append(Said(side, one.time - begins[side], one.severity, one.text, times))
    return tuple(sorted(only, key=lambda one: one.after_arming_s)), len(
        meanings[0].keys() & meanings[1].keys()
    )


# -- tables

_LONGEST_HEADING = 18


def _headings(labels: tuple[str, str]) -> tuple[str, str]:
    """Return the labels, without the middle of long ones, as headings of columns."""
    first, second = (
        label
        if len(label) <= _LONGEST_HEADING
        else f"{label[: _LONGEST_HEADING // 2 - 1]}…{label[-_LONGEST_HEADING // 2 :]}"
        for label in labels
    )
    return (first, second) if first != second else ("first", "second")


def phase_grid(compared: FlightComparison) -> Grid:
    """Return a row for each phase."""
    first, second = _headings(compared.labels)
    columns = (
        Column("phase"),
        Column(f"s\n{first}", True),
        Column(f"s\n{second}", True),
        Column("longer s", True, "by how much it takes longer on the second side", False),
        Column("apart m\nways", True, "greatest distance between the two ways, whatever the time"),
        Column("apart m\nsame time", True, "greatest distance at the same time after the begin", False),
        Column("apart m\nends", True, "distance of the ends, each from the place of arming", False),
        *(
            Column(f"rms °\n{name}", True, "root mean square of the difference at the same time", False)
            for name in ANGLES
        ),
        Column("verdict"),
    )
    title = f"Phases: {compared.labels[1]} against {compared.labels[0]}"
    return Grid(title, columns, tuple(map(_phase_row, compared.phases)))


def _phase_row(one: PhaseDifference) -> tuple[Cell, ...]:
    figures = (one.longer_s, one.path_m, one.apart_m, one.ends_apart_m, *one.rms_deg)
    return (
        Cell(one.name),
        *(Cell(number(seconds)) for seconds in one.seconds),
        *(Cell(number(figure)) for figure in figures),
        Cell(one.verdict, status="good" if one.alike else "warn"),
    )


def answer_grid(compared: FlightComparison) -> Grid:
    """Return what was asked, and the outcome on each side."""
    columns = (Column("asked"), *map(Column, _headings(compared.labels)))
    rows = tuple(
        (Cell(answer.what), *(_outcome(outcome) for outcome in (answer.first, answer.second)))
        for answer in compared.answers
    )
    return Grid("Answers", columns, rows)


def _outcome(words: str | None) -> Cell:
    if words is None:
        return Cell(NOTHING, status="quiet")
    return Cell(words, status="good" if words.partition(" ")[0] in DONE else "bad")


def text_grid(compared: FlightComparison) -> Grid:
    """Return the texts that one side alone has said."""
    columns = (
        Column("s after\narming", True),
        Column("only"),
        Column("severity", True, "", False),
        Column("text"),
    )
    rows = tuple(
        (
            Cell(number(text.after_arming_s)),
            Cell(_headings(compared.labels)[text.side]),
            Cell(str(text.severity)),
            Cell(
                f"{text.text} ×{text.times}" if text.times > 1 else text.text,
                status="warn" if text.severity <= WARNING else "",
            ),
        )
        for text in compared.texts
    )
    both = f"; {compared.said_by_both} are said by both" if compared.said_by_both else ""
    return Grid(f"Texts of one side alone{both}", columns, rows)
