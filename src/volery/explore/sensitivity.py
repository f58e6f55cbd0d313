"""What matters, and how far it may change: sensitivity indices, margins, the worst case, fault campaigns.

Sources: Morris, Technometrics 33 (1991) 161, and Campolongo, Cariboni and Saltelli, Environmental Modelling
and Software 22 (2007) 1509, for elementary effects; Saltelli et al., Computer Physics Communications 181
(2010) 259, for Sobol's indices (both by SALib). A margin is bisected, and each step is a sequential test:
Clopper and Pearson's bounds at few numbers of runs, with Bonferroni's correction for all looks of all steps.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from math import ceil, log, log2, nan
from typing import Any, Final

import numpy as np

from volery.base.errors import UsageError, did_you_mean
from volery.base.installed import require_extra
from volery.base.time import Ns, S
from volery.explore.flight_phases import EVERYWHERE, Phases
from volery.explore.points import CampaignRow, Evaluate, Value, VariantPoint
from volery.explore.search import Discard, Objective, search
from volery.explore.space import Choices, Range, Space
from volery.explore.specification import run_seed
from volery.explore.statistics import LEVEL, Array, Interval
from volery.model.faults import (
    FAULTS,
    AddedSensorFault,
    Fault,
    NetworkFault,
    ProcessorFault,
    VehicleFault,
    can_happen_to,
)
from volery.model.system import System

# -- sensitivity


@dataclass(frozen=True)
class Influence:
    """How much a parameter influences a quantity.

    Attributes:
        parameter: Its path.
        first: Sobol's first-order index: the share of the variance that it explains alone. Of Morris: the
            mean size of its elementary effects (mu*), in units of the quantity over the whole of its range.
        total: Sobol's total index: with all its interactions. Of Morris: the standard deviation of the
            effects (sigma), large for interactions and curves, without an interval.
    """

    parameter: str
    first: Interval
    total: Interval


@dataclass(frozen=True)
class Influences:
    """Result of a sensitivity analysis; the most important parameter is first.

    ``left_out`` are the groups of runs (a Morris trajectory, a row of Sobol's matrices) with a failed run.
    """

    method: str
    quantity: str
    parameters: tuple[Influence, ...]
    runs: int
    left_out: int


MORRIS, SOBOL = "morris", "sobol"


def sensitivity(
    evaluate: Evaluate,
    space: Space,
    quantity: str | Objective,
    *,
    method: str = MORRIS,
    size: int = 0,
    seed: int = 1,
    level: float = LEVEL,
) -> Influences:
    """Return the influence of each parameter on a quantity.

    Example::

        sensitivity(campaign.evaluate, {"environment.wind.speed": Range(0, 8, "m/s"), ...}, "drone_1.energy")

    Args:
        evaluate: Runs points; ``Campaign.evaluate``.
        space: Parameters by the paths that they set. Morris is for those with an order: not for more than
            two choices.
        quantity: An observable, or an ``Objective`` with a measure.
        method: ``morris`` screens with ``size * (parameters + 1)`` runs; ``sobol`` divides the variance with
            ``size * (parameters + 2)`` runs.
        size: Trajectories of Morris, 10 by default; rows of Sobol's matrices, a power of 2, 256 by default.
        seed: Seed of the plan and of all runs: differences are due to the parameters.
        level: Confidence of the intervals (bootstrap).

    Raises:
        UsageError: No such method, a wrong size, fewer than two parameters or groups without a failed run, or
            a quantity that does not vary.
    """
    require_extra("explore", "a sensitivity analysis")
    if method not in (MORRIS, SOBOL):
        raise UsageError(f"no sensitivity analysis {method!r}; there is morris or sobol")
    size = size or (10 if method == MORRIS else 256)
    if size < 2 or (method == SOBOL and size & (size - 1)):
        raise UsageError(
            f"{size} {'rows; give a power of 2' if method == SOBOL else 'trajectories; give 2 and more'}"
        )
    if len(space) < 2:
        raise UsageError("a sensitivity analysis compares two parameters and more")
    several = [path for path, one in space.items() if isinstance(one, Choices) and len(one.values) > 2]
    if method == MORRIS and several:
        raise UsageError(f"the choices of {several[0]} have no order; use sobol, or a range")
    measured = Objective(quantity) if isinstance(quantity, str) else quantity
    problem = {"num_vars": len(space), "names": list(space), "bounds": [[0.0, 1.0]] * len(space)}
    shares = _plan(method, problem, size, run_seed(seed, 0))
    points = [
        VariantPoint(
            {path: one.at(float(share)) for (path, one), share in zip(space.items(), row, strict=True)}, seed
        )
        for row in shares
    ]
    rows = evaluate(points)
    values = np.array([measured.value(row) for row in rows], dtype=float)
    names = dict.fromkeys(name for row in rows if row.completed for name in row.observables)
    if names and measured.measure is None and measured.name not in names:
        raise UsageError(f"no run observed {measured.name!r}{did_you_mean(measured.name, list(names))}")
    group = len(space) + (1 if method == MORRIS else 2)
    good = np.repeat(np.isfinite(values.reshape(-1, group)).all(axis=1), group)
    groups, lost = int(good.sum()) // group, int((~good).sum()) // group
    if groups < 2:
        raise UsageError(
            f"{lost} of {groups + lost} groups of runs have a failed run: too few are left to analyse"
        )
    if not np.ptp(values[good]):
        raise UsageError(f"{measured.name} is the same in all runs: no parameter of this space influences it")
    found = _indices(method, problem, shares[good], values[good], level, run_seed(seed, 1))
    made = [
        Influence(
            path,
            _about(first, of_first, groups, level, method),
            _about(total, of_total, groups, level, method),
        )
        for path, first, of_first, total, of_total in zip(space, *found, strict=True)
    ]
    key = (lambda one: -one.first.estimate) if method == MORRIS else (lambda one: -one.total.estimate)
    return Influences(method, measured.name, tuple(sorted(made, key=key)), len(points), lost)


def _plan(method: str, problem: Mapping[str, Any], size: int, seed: int) -> Array:
    from SALib.sample import morris, sobol  # noqa: PLC0415  # optional

    if method == MORRIS:
        made: Array = morris.sample(problem, size, seed=seed)
    else:
        made = sobol.sample(problem, size, calc_second_order=False, seed=seed)
    return made


def _indices(
    method: str, problem: Mapping[str, Any], shares: Array, values: Array, level: float, seed: int
) -> Sequence[Sequence[float]]:
    from SALib.analyze import morris, sobol  # noqa: PLC0415  # optional

    if method == MORRIS:
        found = morris.analyze(problem, shares, values, conf_level=level, seed=seed)
        return (
            found["mu_star"],
            found["mu_star_conf"],
            found["sigma"],
            [nan] * len(values[: problem["num_vars"]]),
        )
    found = sobol.analyze(
        problem, values, calc_second_order=False, conf_level=level, num_resamples=400, seed=seed
    )
    return found["S1"], found["S1_conf"], found["ST"], found["ST_conf"]


def _about(estimate: float, half: float, groups: int, level: float, method: str) -> Interval:
    centre = float(estimate)
    return Interval(centre, centre - float(half), centre + float(half), groups, level, method)


# -- margins


@dataclass(frozen=True)
class Margin:
    """How far a parameter may change until a requirement fails.

    With the stated confidence the limit lies between ``holds`` and ``fails``, if the requirement gets no
    better again beyond it.

    Attributes:
        requirement: Name of the requirement.
        holds: Last value at which it is met often enough; None if not even at the beginning of the range.
        fails: First value at which it is not; None if it is met all over the range.
        runs: Runs that it took.
        doubtful: Values between the two at which the permitted runs did not decide.
        level: Confidence.
    """

    requirement: str
    holds: Value | None
    fails: Value | None
    runs: int
    doubtful: tuple[Value, ...] = ()
    level: float = LEVEL

    def __str__(self) -> str:
        if self.holds is None:
            return f"{self.requirement} fails at {self.fails} already"
        if self.fails is None:
            return f"{self.requirement} holds up to {self.holds}, the end of the range"
        sure = f"{self.level * 100:g} %"
        return f"{self.requirement} holds up to {self.holds} and fails from {self.fails} ({sure})"


def margin(  # noqa: PLR0913  # each is an option
    evaluate: Evaluate,
    path: str,
    parameter: Range,
    requirement: str,
    *,
    worse: str = "greater",
    least: float = 0.9,
    tolerance: float = 0.02,
    most_runs: int = 400,
    seed: int = 1,
    level: float = LEVEL,
) -> Margin:
    """Return how far a parameter may change until a requirement fails.

    Example::

        margin(campaign.evaluate, "environment.wind.speed", Range(0, 20, "m/s"), "in_time")
        margin(campaign.evaluate, frequency, Range(200, 1500, "MHz", log=True), "in_time", worse="less")

    Args:
        evaluate: Runs points; ``Campaign.evaluate``.
        path: What is changed.
        parameter: Its range.
        requirement: Name of the requirement.
        worse: Whether ``greater`` or ``less`` values make the requirement fail.
        least: Probability with which the requirement has to be met.
        tolerance: Width, as a share of the range, at which the bisection ends.
        most_runs: Runs at one value; if they do not decide, the value is doubtful.
        seed: Seed of the runs; all values have the same ones.
        level: Confidence of the result as a whole.

    Raises:
        UsageError: An option is out of its range, or no run judges such a requirement.
    """
    if (
        worse not in ("greater", "less")
        or not 0.0 < least < 1.0
        or not 0.0 < tolerance < 1.0
        or most_runs < 1
    ):
        raise UsageError(
            "a margin needs worse='greater' or 'less', a least probability and a tolerance between 0 and 1, "
            "and a permitted number of runs"
        )
    steps = 2 * ceil(log2(1.0 / tolerance)) + 2
    test = _Test(evaluate, requirement, least, most_runs, (1.0 - level) / steps, seed)

    def value(share: float) -> Value:
        return parameter.at(share if worse == "greater" else 1.0 - share)

    def decide(share: float) -> bool | None:
        return test(lambda run: VariantPoint({path: value(share)}, run_seed(seed, run)))

    begin, end = decide(0.0), decide(1.0)
    holds, fails, doubts = 0.0 if begin else None, 1.0 if end is False else None, list[float]()
    if begin is False:
        fails = 0.0
    elif end is True:
        holds = 1.0
    elif begin and end is False:
        holds, fails, doubts = _bisect(decide, lambda share: str(value(share)), tolerance)
    else:
        doubts = [share for share, decided in ((0.0, begin), (1.0, end)) if decided is None]
    last = None if holds is None else value(holds)
    first = None if fails is None else value(fails)
    return Margin(requirement, last, first, test.runs, tuple(map(value, sorted(doubts))), level)


def _bisect(
    decide: Callable[[float], bool | None], text: Callable[[float], str], tolerance: float
) -> tuple[float, float, list[float]]:
    """Return the last share that holds, the first that fails, and the doubtful ones between.

    What lies on both sides of doubtful shares is bisected on its own.
    """
    holds, fails, doubts = 0.0, 1.0, list[float]()
    while True:
        gaps = [(holds, min(doubts, default=fails)), (max(doubts, default=holds), fails)]
        low, high = max(gaps, key=lambda gap: gap[1] - gap[0])
        middle = (low + high) / 2.0
        if high - low <= tolerance or text(middle) in (text(low), text(high)):
            return holds, fails, doubts
        decided = decide(middle)
        if decided is None:
            doubts.append(middle)
        elif decided:
            holds = middle
        else:
            fails = middle
        doubts = [doubt for doubt in doubts if holds < doubt < fails]


class _Test:
    """Decides whether a requirement is met with a probability, by as many runs as that takes."""

    def __init__(
        self, evaluate: Evaluate, requirement: str, least: float, most: int, error: float, seed: int
    ) -> None:
        self._evaluate, self._requirement, self._least = evaluate, requirement, least
        self.runs = 0
        first = max(ceil(log(error) / log(least)), 4)  # as many as decide if all meet it
        looks = [min(4, most), *(first * 2**number for number in range(12) if first * 2**number < most), most]
        self._looks = sorted(set(looks))
        self._error = error / len(self._looks)

    def __call__(self, point: Callable[[int], VariantPoint]) -> bool | None:
        """Return whether the requirement is met often enough; None if it cannot be decided."""
        from scipy.stats import binomtest  # noqa: PLC0415  # optional

        met = done = 0
        for look in self._looks:
            rows = self._evaluate([point(run) for run in range(done, look)])
            if not any(self._requirement in row.verdicts for row in rows if row.completed) and any(
                row.completed for row in rows
            ):
                raise UsageError(f"no run judges a requirement {self._requirement!r}")
            met += sum(row.completed and bool(row.verdicts.get(self._requirement)) for row in rows)
            self.runs += len(rows)
            done = look
            bounds = binomtest(met, done).proportion_ci(1.0 - 2.0 * self._error, "exact")
            if bounds.low > self._least:
                return True
            if bounds.high < self._least:
                return False
        return None


# -- the worst case


@dataclass(frozen=True)
class WorstCase:
    """The worst that a search has found: runs that failed, and the completed run with the worst value."""

    quantity: str
    worst: CampaignRow | None
    value: float
    failed: tuple[CampaignRow, ...]
    runs: int


def worst_case(
    evaluate: Evaluate,
    space: Space,
    worse: Objective | str,
    *,
    evaluations: int,
    seed: int = 1,
    discard: Discard | None = None,
) -> WorstCase:
    """Search a space for the point at which a quantity is worst. A run that fails is worse than any other.

    Example::

        worst_case(campaign.evaluate, {"environment.wind.speed": Range(0, 12, "m/s"), ...},
                   "maximise drone_1.goto_error", evaluations=100)

    Args:
        evaluate: Runs points; ``Campaign.evaluate``.
        space: Parameters by the paths that they set.
        worse: The way in which the quantity gets worse.
        evaluations: Runs.
        seed: Seed of the search.
        discard: As of ``search``.

    Raises:
        UsageError: As of ``search``.
    """
    seen: list[CampaignRow] = []

    def remember(points: Sequence[VariantPoint]) -> list[CampaignRow]:
        rows = evaluate(points)
        seen.extend(rows)
        return rows

    front = search(
        remember, space, [worse], evaluations=evaluations, seed=seed, confirmations=0, discard=discard
    )
    (objective,) = front.objectives
    sign = -1.0 if objective.maximise else 1.0
    known = [(sign * objective.value(row), row) for row in seen if np.isfinite(objective.value(row))]
    score, worst = min(known, key=lambda one: one[0], default=(nan, None))
    failed = tuple({one.point.key: one for one in seen if not one.completed}.values())
    return WorstCase(objective.name, worst, sign * score, failed, len(seen))


# -- fault campaigns

FAULT_PATH: Final = "environment.faults.campaign"
"""Where a fault campaign states its fault, beside those that the model has."""


@dataclass(frozen=True)
class FaultTrial:
    """One fault, of one thing, in one phase, and the rows of its runs."""

    kind: str
    subject: str
    phase: str
    rows: tuple[CampaignRow, ...]

    @property
    def met(self) -> int:
        """Runs that completed and met all requirements."""
        return sum(row.ok for row in self.rows)


@dataclass(frozen=True)
class FaultCampaign:
    """Result of a fault campaign: what was tried, and which kinds the system has nothing for."""

    trials: tuple[FaultTrial, ...]
    phases: tuple[str, ...]
    without_subject: tuple[str, ...]

    def table(self) -> dict[tuple[str, str], dict[str, str]]:
        """Return the coverage: by kind and subject, then by phase, ``met/runs``."""
        found: dict[tuple[str, str], dict[str, str]] = {}
        for trial in self.trials:
            found.setdefault((trial.kind, trial.subject), {})[trial.phase] = f"{trial.met}/{len(trial.rows)}"
        return found


def fault_campaign(
    evaluate: Evaluate,
    system: System,
    phases: Phases,
    *,
    values: Mapping[str, Value] | None = None,
    duration_ns: Ns | None = None,
    repetitions: int = 1,
    seed: int = 1,
) -> FaultCampaign:
    """Try every kind of fault on everything that it can happen to, in every phase of a mission.

    Example::

        fault_campaign(campaign.evaluate, system, campaign.flight_phases())
        fault_campaign(campaign.evaluate, system, {"take-off": {EVERYWHERE: 5 * S}})

    Args:
        evaluate: Runs points; ``Campaign.evaluate``.
        system: The system, whose vehicles, computers and networks get the faults.
        phases: When each phase is, ns from the start of the run, by its name and by vehicle. What has no
            vehicle, and is not carried by one, gets its faults in the phases of the first vehicle.
        values: What the variant sets besides, such as ``{"scenario": "windy"}``.
        duration_ns: How long a fault lasts, ns; for good if it is None.
        repetitions: Runs of each.
        seed: Seed of the runs; all faults have the same ones.

    Raises:
        UsageError: There is no phase.
    """
    if not phases or repetitions < 1:
        raise UsageError("a fault campaign needs a phase and a repetition")
    stated = {} if duration_ns is None else {"duration": _seconds(duration_ns)}
    trials: list[tuple[str, str, str, list[VariantPoint]]] = []
    without: list[str] = []
    for kind, made in FAULTS.items():
        subjects = list(_subjects(made, system))
        if not subjects:
            without.append(kind)
        for key, named, about in subjects:
            subject = ".".join(about.values()) or named
            for phase, times in phases.items():
                at = _time_of(times, key, named, system)
                if at is None:
                    continue
                fault = {"kind": kind, "at": _seconds(at), **stated, **about, **_severe(kind)}
                points = [
                    VariantPoint({**(values or {}), FAULT_PATH: fault}, run_seed(seed, run))
                    for run in range(repetitions)
                ]
                trials.append((kind, subject, phase, points))
    rows = iter(evaluate([point for *_, points in trials for point in points]))
    return FaultCampaign(
        tuple(
            FaultTrial(kind, subject, phase, tuple(next(rows) for _ in points))
            for kind, subject, phase, points in trials
        ),
        tuple(phases),
        tuple(without),
    )


def _time_of(times: Mapping[str, Ns], key: str, subject: str, system: System) -> Ns | None:
    """Return when a subject goes through a phase; None for a vehicle that does not."""
    if EVERYWHERE in times:
        return times[EVERYWHERE]
    vehicle = subject if key == "vehicle" else None
    if key == "processor":
        vehicle = next(
            (processor.carried_by for processor in system.processors if processor.name == subject), None
        )
    return next(iter(times.values())) if vehicle is None else times.get(vehicle)


def _seconds(at: Ns) -> str:
    return f"{at / S!r} s"


def _subjects(made: type[Fault], system: System) -> Iterator[tuple[str, str, dict[str, str]]]:
    """Yield each subject that a fault can happen to: the key that names it, its name, and all such keys."""
    if issubclass(made, AddedSensorFault):
        for vehicle in system.vehicles:
            for one in vehicle.added_sensors:
                if can_happen_to(made, one):
                    sensor = one if isinstance(one, str) else one.named
                    yield "vehicle", vehicle.name, {"vehicle": vehicle.name, "sensor": sensor}
        return
    key, names = "", ["all"]
    if issubclass(made, VehicleFault):
        rotors = any("motor" in field.name or "cells" in field.name for field in fields(made))
        key = "vehicle"
        names = [vehicle.name for vehicle in system.vehicles if not rotors or vehicle.kind == "multirotor"]
    elif issubclass(made, ProcessorFault):
        key, names = "processor", [processor.name for processor in system.processors]
    elif issubclass(made, NetworkFault):
        key, names = "network", [network.name for network in system.networks]
    for name in names:
        yield key, name, {key: name} if key else {}


def _severe(kind: str) -> dict[str, Value]:
    """Return arguments of a kind whose defaults change nothing."""
    return {"loss": 0.3, "delay": "0.2 s"} if kind in ("link-degraded", "network-degraded") else {}
