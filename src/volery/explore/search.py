"""Search of a design space for its Pareto front, with noise, failed runs and a limited number of runs.

NSGA-II proposes (Deb et al., IEEE Trans. Evolutionary Computation 6 (2002) 182; Optuna's, with simulated
binary crossover and polynomial mutation). Small generations suit budgets of hundreds to thousands of runs:
``bench/search.py`` compares them with the usual hundred.

A search is a function of its seed and of the rows of its runs, and asks for the same points each time. So one
that was interrupted is started again: a campaign returns the rows that it has and runs the rest.

Runs with the same parameters differ by their seed. The variants that look best are therefore run again with
seeds that the search has not used, since what was chosen for its luck must not be judged by it. All variants
have the same seeds, so pairs are compared, with Bonferroni's correction for the number of comparisons. Only
variants of which no one is dominated by another at that confidence are the front; the ones that the
runs do not distinguish from one of them are named beside it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from math import nan
from typing import Any, Final
from warnings import catch_warnings, simplefilter

import numpy as np

from volery.analysis.hardware import hardware, hardware_price
from volery.analysis.impossible import why_impossible
from volery.base.errors import ModelError, UsageError
from volery.base.installed import require_extra
from volery.explore.points import CampaignRow, Evaluate, Value, VariantPoint
from volery.explore.run_process import read_variant
from volery.explore.space import Choices, Parameter, Space
from volery.explore.specification import run_seed
from volery.explore.statistics import LEVEL, Array, Interval, mean, met
from volery.model.builder import ModelBuilder
from volery.model.text import CollectedModelError

POPULATION: Final = 20
"""Variants of a generation."""

CROSSOVER_ETA, MUTATION_ETA = 10.0, 20.0
"""Distribution indexes of crossover and mutation: greater ones keep children nearer to their parents."""

CONFIRMATIONS: Final = 20
"""Runs of each variant that is judged, with seeds that the search has not used."""

JUDGED: Final = 40
"""Variants that are judged at the end: the front and the ranks behind it."""

MOST_IDLE: Final = 50
"""Generations without a new variant after which the space counts as exhausted."""


@dataclass(frozen=True)
class Objective:
    """A quantity to minimise or to maximise.

    Attributes:
        name: An observable; or the name of what ``measure`` returns.
        maximise: Whether more is better.
        measure: Returns the quantity of a row, for what is no observable, such as the price of its hardware.
    """

    name: str
    maximise: bool = False
    measure: Callable[[CampaignRow], float] | None = None

    def value(self, row: CampaignRow) -> float:
        """Return the quantity of a row; NaN if the run did not complete or did not observe it."""
        if not row.completed:
            return nan
        return row.observables.get(self.name, nan) if self.measure is None else self.measure(row)

    def __str__(self) -> str:
        return f"{'maximise' if self.maximise else 'minimise'} {self.name}"


def read_objective(text: str) -> Objective:
    """Return the objective that is written as ``minimise drone_1.energy`` or ``maximise delivered``.

    Raises:
        UsageError: The text has another form.
    """
    words = text.split()
    ways = {"minimise": False, "minimize": False, "maximise": True, "maximize": True}
    if len(words) != 2 or words[0] not in ways:
        raise UsageError(f"{text!r} is no objective; write `minimise drone_1.energy` or `maximise delivered`")
    return Objective(words[1], ways[words[0]])


@dataclass(frozen=True)
class Solution:
    """A variant of the front, or one that cannot be distinguished from a variant of the front.

    Attributes:
        values: What the variant sets, as of ``VariantPoint``.
        objectives: Interval of the mean of each objective, as it is observed.
        requirements: Interval of the probability to meet each constraint, by its name.
        like: Place in the front of the variant that this one cannot be distinguished from; None in the front.
    """

    values: Mapping[str, Value]
    objectives: tuple[Interval, ...]
    requirements: Mapping[str, Interval]
    like: int | None = None


@dataclass(frozen=True)
class Front:
    """Result of a search.

    Attributes:
        objectives: What was optimised.
        solutions: Variants of which none is dominated by another, with the level of confidence.
        alike: Variants that the runs cannot tell from one of them.
        evaluated: Variants that were run.
        runs: Runs, those of the judgement included.
        failed: Variants of which a run did not complete, or did not observe an objective.
        discarded: How many variants were not run, by the reason that the analysis gave.
    """

    objectives: tuple[Objective, ...]
    solutions: tuple[Solution, ...]
    alike: tuple[Solution, ...]
    evaluated: int
    runs: int
    failed: int
    discarded: Mapping[str, int] = field(default_factory=dict)

    @property
    def discarded_share(self) -> float:
        """Share of the variants that were proposed and that analysis discarded."""
        discarded = sum(self.discarded.values())
        return discarded / max(discarded + self.evaluated, 1)

    def points(self) -> Array:
        """Return the estimates of the objectives to minimise, by solution and objective."""
        signs = _signs(self.objectives)
        return (
            np.array([[objective.estimate for objective in each.objectives] for each in self.solutions])
            * signs
        )


Discard = Callable[[Mapping[str, Value]], str]
"""Returns why a variant cannot work; empty if it may."""


def search(  # noqa: PLR0913  # each is an option
    evaluate: Evaluate,
    space: Space,
    objectives: Sequence[Objective | str],
    *,
    evaluations: int,
    seed: int = 1,
    constraints: Sequence[str] = (),
    repetitions: int = 1,
    confirmations: int = CONFIRMATIONS,
    discard: Discard | None = None,
    level: float = LEVEL,
) -> Front:
    """Search a space for its Pareto front.

    Example::

        with prepare(CampaignRequest.of("model.yaml", "runs/search")) as campaign:
            front = search(
                campaign.evaluate,
                {"allocation": Choices(["one", "two"]), "environment.wind.speed": Range(0, 8, "m/s")},
                ["minimise application.computing_energy", "maximise application.delivered"],
                evaluations=200,
                constraints=["in_time"],
            )

    Args:
        evaluate: Runs points; ``Campaign.evaluate``.
        space: Parameters by the paths that they set.
        objectives: One to three quantities.
        evaluations: Variants that are run, without the judgement of the best. Where a space has no more
            variants than this, all of them are.
        seed: Seed of the search and of its runs. The same seed gives the same front.
        constraints: Requirements that a variant has to meet in each run of the search, if its model has them.
        repetitions: Runs of each variant during the search.
        confirmations: Further runs of each variant that is judged. 0 for what has no noise: then the
            means of ``repetitions`` runs are compared as they are.
        discard: Says of a variant why it cannot work, without a run; as ``analysis_discards``.
        level: Confidence that no variant of the front is dominated by another one.

    Raises:
        UsageError: No objective or more than three, one of them twice, an empty space, or numbers below 1.
    """
    stated = tuple(
        read_objective(objective) if isinstance(objective, str) else objective for objective in objectives
    )
    if not 1 <= len(stated) <= 3 or len({one.name for one in stated}) < len(stated):
        raise UsageError(f"a search has one to three different objectives, not {len(stated)}")
    if not space:
        raise UsageError("nothing is varied: the space has no parameter")
    if evaluations < 1 or repetitions < 1 or confirmations < 0 or confirmations == 1:
        raise UsageError(
            "a search needs evaluations and repetitions from 1 on, and confirmations 0 or from 2 on"
        )
    made = _Search(evaluate, stated, tuple(constraints), repetitions, seed, discard)
    size = _size(space)
    if size <= evaluations:
        every = product(*(one.grid() for one in space.values()))
        made.run([dict(zip(space, values, strict=True)) for values in every])
    else:
        made.propose(space, evaluations)
    return made.judge(confirmations, level)


def _size(space: Space) -> float:
    """Return the number of variants of a space, infinity if a parameter has no list of values."""
    if not all(isinstance(one, Choices) for one in space.values()):
        return float("inf")
    return float(np.prod([len(one.grid()) for one in space.values()], dtype=float))


@dataclass
class _Variant:
    """What is known of a variant. ``score`` is to be minimised; NaN if it was discarded or failed."""

    values: Mapping[str, Value]
    score: Array
    unmet: tuple[float, ...] = ()
    discarded: bool = False

    @property
    def usable(self) -> bool:
        return bool(np.isfinite(self.score).all())

    @property
    def feasible(self) -> bool:
        return self.usable and not any(self.unmet)


class _Search:
    """Variants by their canonical text, and how each is run."""

    def __init__(
        self,
        evaluate: Evaluate,
        objectives: tuple[Objective, ...],
        constraints: tuple[str, ...],
        repetitions: int,
        seed: int,
        discard: Discard | None,
    ) -> None:
        self._evaluate, self._objectives, self._constraints = evaluate, objectives, constraints
        self._repetitions, self._seed, self._discard = repetitions, seed, discard
        self._known: dict[str, _Variant] = {}
        self._reasons: Counter[str] = Counter()
        self._runs = 0
        self._judged: dict[str, None] = {}  # requirements, an ordered set

    def run(
        self, variants: Sequence[Mapping[str, Value]], most: float = float("inf")
    ) -> list[_Variant | None]:
        """Return what is known of variants; run those of which nothing is, at most *most* of them.

        A variant beyond that number is None.
        """
        keys = [VariantPoint(values).variant for values in variants]
        new: dict[str, Mapping[str, Value]] = {}
        for key, values in zip(keys, variants, strict=True):
            if key in self._known or key in new or len(new) >= most:
                continue
            reason = self._discard(values) if self._discard is not None else ""
            if reason:
                self._reasons[reason] += 1
                self._known[key] = _Variant(values, np.full(len(self._objectives), nan), discarded=True)
            else:
                new[key] = values
        for (key, values), rows in zip(
            new.items(), self._rows(list(new.values()), range(self._repetitions)), strict=True
        ):
            self._judged.update(dict.fromkeys(name for row in rows for name in row.verdicts))
            unmet = tuple(_unmet(rows, constraint) for constraint in self._constraints)
            self._known[key] = _Variant(values, self._scores(rows).mean(axis=0), unmet)
        return [self._known.get(key) for key in keys]

    def _rows(
        self, variants: Sequence[Mapping[str, Value]], repetitions: range
    ) -> Iterator[list[CampaignRow]]:
        """Yield the rows of each variant; a repetition has the same seed in all of them."""
        points = [
            VariantPoint(values, run_seed(self._seed, repetition))
            for values in variants
            for repetition in repetitions
        ]
        self._runs += len(points)
        rows = self._evaluate(points) if points else []
        for place in range(len(variants)):
            yield rows[place * len(repetitions) : (place + 1) * len(repetitions)]

    def _scores(self, rows: Iterable[CampaignRow]) -> Array:
        """Return what is to be minimised, by row and objective."""
        values = [[objective.value(row) for objective in self._objectives] for row in rows]
        found: Array = np.array(values, dtype=float) * _signs(self._objectives)
        return found

    @property
    def _evaluated(self) -> list[_Variant]:
        return [one for one in self._known.values() if not one.discarded]

    # -- proposals

    def propose(self, space: Space, evaluations: int) -> None:
        """Run generation after generation until so many variants are run, or no new one comes up."""
        require_extra("explore", "a search")
        import optuna  # noqa: PLC0415  # optional
        from optuna.samplers.nsgaii import PolynomialMutation, SBXCrossover  # noqa: PLC0415

        optuna.logging.set_verbosity(optuna.logging.ERROR)
        with catch_warnings():
            simplefilter(
                "ignore", optuna.exceptions.ExperimentalWarning
            )  # the bound on its version answers it
            sampler = optuna.samplers.NSGAIISampler(
                population_size=POPULATION,
                crossover=SBXCrossover(eta=CROSSOVER_ETA),
                mutation=PolynomialMutation(eta=MUTATION_ETA),
                seed=run_seed(self._seed, 0),
            )
        study = optuna.create_study(directions=["minimize"] * len(self._objectives), sampler=sampler)
        asked = _distributions(space)
        idle = 0
        while len(self._evaluated) < evaluations and idle < MOST_IDLE:
            before = len(self._known)
            trials = [study.ask(asked) for _ in range(POPULATION)]
            variants = [{path: _drawn(one, t.params[path]) for path, one in space.items()} for t in trials]
            found = self.run(variants, evaluations - len(self._evaluated))
            for trial, one in zip(trials, found, strict=True):
                _tell(study, trial, one, self._constraints)
            idle = idle + 1 if len(self._known) == before else 0

    # -- judgement

    def judge(self, confirmations: int, level: float) -> Front:
        """Run the best variants again, and return those that are not dominated."""
        for name in self._constraints if self._judged else ():
            if name not in self._judged:
                there = ", ".join(self._judged)
                raise UsageError(f"no run judges a requirement {name!r}; there is {there}")
        feasible = [one for one in self._evaluated if one.feasible]
        best = _best(feasible, JUDGED if confirmations else len(feasible))
        if not confirmations:
            best = [best[place] for place in front_of(np.array([one.score for one in best]))] if best else []
        own = range(self._repetitions)
        again = range(self._repetitions, self._repetitions + confirmations) if confirmations else own
        before = self._runs
        rows = list(self._rows([one.values for one in best], again))
        if not confirmations:
            self._runs = before  # they exist
        keep = [place for place, mine in enumerate(rows) if np.isfinite(self._scores(mine)).all()]
        lost = len(best) - len(keep)
        scores = np.array([self._scores(rows[place]) for place in keep])
        chosen, like = _separate(scores, level) if keep else ([], {})
        solutions = [self._solution(best[keep[one]], rows[keep[one]], level) for one in chosen]
        alike = [
            self._solution(best[keep[one]], rows[keep[one]], level, chosen.index(other))
            for one, other in like.items()
        ]
        failed = sum(not one.usable for one in self._evaluated) + lost
        return Front(
            self._objectives, tuple(solutions), tuple(alike), len(self._evaluated), self._runs, failed,
            dict(self._reasons),
        )  # fmt: skip

    def _solution(
        self, one: _Variant, rows: list[CampaignRow], level: float, like: int | None = None
    ) -> Solution:
        values = self._scores(rows) * _signs(self._objectives)
        return Solution(
            one.values,
            tuple(mean(column, level) for column in values.T),
            {name: met(rows, name, level) for name in self._constraints if _judged(rows, name)},
            like,
        )


def _unmet(rows: Sequence[CampaignRow], requirement: str) -> float:
    """Return the share of rows that do not meet a requirement; 0 if the variant has no such requirement."""
    if not any(row.verdicts for row in rows):
        return 1.0
    return 1.0 - met(rows, requirement).estimate if _judged(rows, requirement) else 0.0


def _judged(rows: Sequence[CampaignRow], requirement: str) -> bool:
    return any(requirement in row.verdicts for row in rows)


def _signs(objectives: Sequence[Objective]) -> Array:
    return np.array([-1.0 if objective.maximise else 1.0 for objective in objectives])


def _distributions(space: Space) -> dict[str, Any]:
    from optuna.distributions import CategoricalDistribution, FloatDistribution  # noqa: PLC0415  # optional

    return {
        path: CategoricalDistribution(range(len(one.values)))
        if isinstance(one, Choices)
        else FloatDistribution(0, 1)
        for path, one in space.items()
    }


def _drawn(parameter: Parameter, drawn: Any) -> Value:
    """Return the value of what Optuna has drawn: the number of a choice, else a share of the space."""
    return parameter.values[drawn] if isinstance(parameter, Choices) else parameter.at(drawn)


def _tell(study: Any, trial: Any, found: _Variant | None, constraints: Sequence[str]) -> None:
    """Tell the optimiser what a variant is worth; one that failed is no parent and never in the front."""
    from optuna.trial import TrialState  # noqa: PLC0415  # optional

    if found is None or not found.usable:
        study.tell(trial, state=TrialState.FAIL)
        return
    for name, unmet in zip(constraints, found.unmet, strict=True):
        trial.set_constraint(name, unmet)
    study.tell(trial, [float(one) for one in found.score])


# -- before a run


def analysis_discards(model: str | ModelBuilder, fidelity: str) -> Discard:
    """Return what discards the variants of a model that cannot work, for ``search``.

    What the model leaves open counts nothing: it discards no variant (``volery.analysis.impossible``).

    Args:
        model: The model; ``campaign.setting.model``.
        fidelity: ``campaign.setting.fidelity``.
    """

    def why(values: Mapping[str, Value]) -> str:
        try:
            system = read_variant(model, values)
        except (ModelError, CollectedModelError):
            return ""  # its run becomes a row that says what is wrong
        return next(why_impossible(system, fidelity), "")

    return why


def hardware_cost(model: str | ModelBuilder, currency: str) -> Objective:
    """Return the objective ``minimise hardware_price``: all parts of the system that have a price.

    Args:
        model: The model; ``campaign.setting.model``.
        currency: Currency of the sum, such as ``USD``. A part in another one makes it NaN: nothing is
            converted, and a sum without it would be too low.
    """

    def price(row: CampaignRow) -> float:
        sums = hardware_price(hardware(read_variant(model, row.point.values)))
        return sums[currency] if list(sums) == [currency] else nan

    return Objective("hardware_price", measure=price)


# -- dominance


def front_of(scores: Array) -> list[int]:
    """Return the places of the points that no other point dominates; of equal points the first.

    Args:
        scores: What is to be minimised, by point and objective, without NaN.
    """
    order = sorted(range(len(scores)), key=lambda place: (*scores[place], place))
    kept: list[int] = []
    for place in order:
        if not kept or not (scores[kept] <= scores[place]).all(axis=1).any():
            kept.append(place)
    return kept


def _best(variants: Sequence[_Variant], count: int) -> list[_Variant]:
    """Return the first ranks of variants until there are *count*."""
    left, found = list(variants), list[_Variant]()
    while left and len(found) < count:
        rank = front_of(np.array([one.score for one in left]))
        found += [left[place] for place in _spread(np.array([left[place].score for place in rank]), rank)]
        chosen = set(rank)
        left = [one for place, one in enumerate(left) if place not in chosen]
    return found[:count]


def _spread(scores: Array, places: Sequence[int]) -> list[int]:
    """Return *places* in the order in which each next one is farthest from those before it."""
    if len(places) < 2:
        return list(places)
    extent = np.ptp(scores, axis=0)
    scaled = (scores - scores.min(axis=0)) / np.where(extent > 0.0, extent, 1.0)
    order = [int(np.argmin(scaled[:, 0]))]
    distance = np.full(len(places), np.inf)
    while len(order) < len(places):
        distance = np.minimum(distance, np.abs(scaled - scaled[order[-1]]).max(axis=1))
        distance[order] = -1.0
        order.append(int(np.argmax(distance)))
    return [places[one] for one in order]


def _separate(scores: Array, level: float) -> tuple[list[int], dict[int, int]]:
    """Return the variants of the front, and for those that cannot be distinguished from one of them which.

    Args:
        scores: What is to be minimised, by variant, repetition and objective; the repetitions are paired.
        level: Confidence that no variant of the front is dominated by another.
    """
    from scipy.stats import t  # noqa: PLC0415  # optional

    count, repetitions, objectives = scores.shape
    means = scores.mean(axis=1)
    first = set(front_of(means))
    order = _spread(means[sorted(first)], sorted(first)) + [one for one in range(count) if one not in first]
    comparisons = max(count * (count - 1) // 2, 1) * objectives
    wide = float(t.ppf(1.0 - (1.0 - level) / 2.0 / comparisons, repetitions - 1)) if repetitions > 1 else 0.0

    def relation(one: int, other: int) -> tuple[bool, bool, bool, bool]:
        """Return whether *one* is surely somewhere better, somewhere worse, nowhere worse, nowhere better."""
        apart = scores[one] - scores[other]
        centre = apart.mean(axis=0)
        half = wide * apart.std(axis=0, ddof=1) / np.sqrt(repetitions) if repetitions > 1 else 0.0 * centre
        low, high = centre - half, centre + half
        return bool((high < 0).any()), bool((low > 0).any()), bool((high <= 0).all()), bool((low >= 0).all())

    chosen: list[int] = []
    like: dict[int, int] = {}
    for one in order:
        dominated = doubtful = None
        for other in chosen:
            better, worse, _, no_better = relation(one, other)
            if worse and no_better:
                dominated = other
                break
            if not (better and worse) and doubtful is None:
                doubtful = other
        if dominated is None and doubtful is None:
            chosen.append(one)
        elif dominated is None and doubtful is not None:
            like[one] = doubtful
    return chosen, like


# -- hypervolume


def hypervolume(scores: Array, reference: Sequence[float] | Array) -> float:
    """Return the exact hypervolume that points dominate, up to a reference point.

    Args:
        scores: What is to be minimised, by point and objective. Points beyond the reference count nothing.
        reference: The reference point.

    Raises:
        UsageError: There are more than three objectives.
    """
    end = np.asarray(reference, dtype=float)
    points = np.asarray(scores, dtype=float).reshape(-1, len(end))
    if len(end) > 3:
        raise UsageError(f"the hypervolume of {len(end)} objectives is not computed; 3 at most")
    points = points[(points < end).all(axis=1)]
    if not len(points):
        return 0.0
    if len(end) == 1:
        return float(end[0] - points.min())
    points = points[front_of(points)]
    if len(end) == 2:
        points = points[np.argsort(points[:, 0])]
        heights = np.concatenate(([end[1]], points[:-1, 1])) - points[:, 1]
        return float(((end[0] - points[:, 0]) * heights).sum())
    points = points[np.argsort(points[:, 2], kind="stable")]
    tops = np.append(points[1:, 2], end[2])
    return sum(
        (float(top) - float(point[2])) * hypervolume(points[: place + 1, :2], end[:2])
        for place, (point, top) in enumerate(zip(points, tops, strict=True))
        if top > point[2]
    )
