"""The page of a campaign: one HTML document that needs no network, and whose points lead to their runs."""

from __future__ import annotations

import json
from array import array
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from sys import intern
from typing import Any, Final, NamedTuple

import numpy as np
from markupsafe import Markup

from volery.base.errors import UsageError
from volery.base.files import write_text
from volery.explore.campaign import Campaign
from volery.explore.campaign_figures import (
    Axis,
    Flags,
    Values,
    distribution_plot,
    parallel_coordinates,
    pareto_plot,
    thinned,
    tornado_chart,
)
from volery.explore.points import COMPLETED, DISCARDED, CampaignRow, Value, VariantPoint
from volery.explore.search import Front, Objective, front_of
from volery.explore.sensitivity import MORRIS, FaultCampaign, Influences
from volery.explore.statistics import Interval, Until, mean, probability
from volery.report.grids import Cell, CellStatus, Column, Grid, figure
from volery.report.html_report import REPORT_FILE, Fact, environment

PAGE_FILE: Final = "campaign.html"
MOST_VARIANTS = 40
"""Variants in the table of variants, the best first."""
MOST_REASONS = 20
MOST_DISTRIBUTIONS = 8
MOST_CHOICES = 12
"""Names beside one axis."""
MOST_AXES = 9
"""Axes of the parallel coordinates: more are not read."""


@dataclass(frozen=True)
class Findings:
    """What the methods found about a campaign, for its page. Every part may be missing.

    Attributes:
        objectives: What was optimised.
        front: Variants of the Pareto front; None if the page is to compare the means of the variants.
        effects: Effect of each parameter with its interval, by the title of the chart.
        grids: Further tables, such as the faults and phases of a fault campaign.
    """

    objectives: Sequence[Objective] = ()
    front: Sequence[Mapping[str, Value]] | None = None
    effects: Mapping[str, Mapping[str, Interval]] = field(default_factory=dict)
    grids: Sequence[Grid] = ()


def of_front(front: Front) -> Findings:
    """Return what a search found."""
    shown = (*front.solutions, *front.alike)
    requirements = dict.fromkeys(name for one in shown for name in one.requirements)
    columns = (
        Column("variant"),
        *(Column(str(objective), numeric=True) for objective in front.objectives),
        *(Column(name, numeric=True) for name in requirements),
        Column("not distinguished from"),
    )
    rows = []
    for one in shown:
        like = "" if one.like is None else _values(front.solutions[one.like].values)
        rows.append(
            (
                Cell(_values(one.values)),
                *(_interval_cell(each) for each in one.objectives),
                *(_probability_cell(one.requirements.get(name)) for name in requirements),
                Cell(like, status="quiet"),
            )
        )
    discarded = tuple(
        (Cell(reason), Cell(str(count)))
        for reason, count in sorted(front.discarded.items(), key=lambda one: -one[1])
    )
    share = f"Discarded by analysis: {100.0 * front.discarded_share:.3g} % of the variants"
    grids = [
        Grid("Pareto front", columns, tuple(rows)),
        Grid(share, (Column("reason"), Column("variants", numeric=True)), discarded),
    ]
    return Findings(front.objectives, [solution.values for solution in front.solutions], grids=grids)


def _probability_cell(of: Interval | None) -> Cell:
    """Return the probability to meet a requirement; empty where the variant does not have it."""
    return Cell("" if of is None else f"{of.low:.3g} to {of.high:.3g}")


def of_influences(influences: Influences) -> Findings:
    """Return what a sensitivity analysis found."""
    title = "mean size of elementary effects" if influences.method == MORRIS else "total Sobol index"
    effect = {
        parameter.parameter: parameter.first if influences.method == MORRIS else parameter.total
        for parameter in influences.parameters
    }
    name = f"{title} on {influences.quantity}"
    columns = (Column("parameter"), Column("estimate", numeric=True), Column("95 % interval", numeric=True))
    rows = tuple(
        (Cell(path), Cell(figure(one.estimate)), Cell(f"{figure(one.low)} to {figure(one.high)}"))
        for path, one in effect.items()
    )
    return Findings(effects={name: effect}, grids=[Grid(name, columns, rows)])


def of_intervals(until: Until, intervals: Mapping[str, Interval]) -> Findings:
    """Return what a stopping rule came to, by ``VariantPoint.variant``."""
    columns = (Column("variant"), Column("how sure"))
    rows = [
        (
            Cell(_values(json.loads(variant)) or "the model"),
            Cell(one.sentence(f"{until.name}.{until.statistic}")),
        )
        for variant, one in intervals.items()
    ]
    return Findings(grids=[Grid(f"Until {until}", columns, tuple(rows))])


def of_faults(faults: FaultCampaign) -> Findings:
    """Return what a fault campaign found: runs that met all requirements, of all runs, by fault and phase."""
    rows = []
    for (kind, subject), by_phase in faults.table().items():
        cells = []
        for phase in faults.phases:
            met, _, runs = by_phase.get(phase, "–").partition("/")
            status: CellStatus = "good" if met == runs else "bad" if met == "0" else "warn"
            cells.append(Cell(by_phase.get(phase, "–"), status=status if runs else "quiet"))
        rows.append((Cell(kind), Cell(subject), *cells))
    columns = (Column("fault"), Column("of"), *(Column(phase, numeric=True) for phase in faults.phases))
    grids = [Grid("Faults: runs that met all requirements", columns, tuple(rows))]
    if faults.without_subject:
        names = tuple((Cell(name),) for name in faults.without_subject)
        grids.append(Grid("Kinds of faults that nothing in this model can have", (Column("fault"),), names))
    return Findings(grids=grids)


def _values(values: Mapping[str, Value]) -> str:
    return ", ".join(f"{path} = {_text(value)}" for path, value in values.items())


def _text(value: Value) -> str:
    """Return a value as a reader of the page knows it: that of a fault is a mapping."""
    if isinstance(value, Mapping):
        return ", ".join(f"{key}: {_text(one)}" for key, one in value.items())
    return str(value)


def _interval_cell(one: Interval) -> Cell:
    if not one.runs:
        return Cell("–", status="quiet")
    known = 1e-9 * abs(one.estimate) < one.half_width < np.inf  # not the rounding of equal values
    return Cell(figure(one.estimate) + (f" ± {figure(float(f'{one.half_width:.2g}'))}" if known else ""))


class _Column:
    """Values of one quantity, run by run, in 8 bytes each."""

    def __init__(self) -> None:
        self._values = array("d")

    def put(self, index: int, value: float) -> None:
        """Set the value of a run; runs between have none."""
        self._values.extend([np.nan] * (index - len(self._values)))
        self._values.append(value)

    def all(self, count: int) -> Values:
        """Return the values of *count* runs, not copied; nothing can be set any more."""
        self._values.extend([np.nan] * (count - len(self._values)))
        return np.frombuffer(self._values)


class _Choices:
    """The different values of a parameter, in the order of their numbers, else of their first occurrence."""

    def __init__(self) -> None:
        self.known: dict[str, int] = {}
        self.column = _Column()

    def put(self, index: int, value: Value) -> None:
        text = _text(value)
        self.column.put(index, self.known.setdefault(text, len(self.known)))

    def axis(self, name: str, count: int) -> Axis:
        """Return the parameter as an axis: of numbers if all its values have the same unit."""
        places = self.column.all(count)
        numbers = [_number(text) for text in self.known]
        units = {unit for _, unit in numbers}
        known = np.isfinite(places)
        values = np.full(count, np.nan)
        if len(units) == 1 and None not in units:
            table = np.array([number for number, _ in numbers])
            values[known] = table[places[known].astype(np.int64)]
            (unit,) = units
            return Axis(f"{name} [{unit}]" if unit else name, values)
        return Axis(name, places, tuple(self.known))


def _number(text: str) -> tuple[float, str | None]:
    number, _, unit = text.partition(" ")
    try:
        return float(number), unit
    except ValueError:
        return np.nan, None


class _Table(NamedTuple):
    """All rows of a campaign as arrays."""

    numbers: np.ndarray[Any, np.dtype[np.int64]]
    statuses: list[str]
    parameters: dict[str, Axis]
    verdicts: dict[str, Values]
    observables: dict[str, Values]
    variants: np.ndarray[Any, np.dtype[np.int64]]
    variant_values: list[Mapping[str, Value]]
    causes: Counter[tuple[str, str]]
    examples: dict[tuple[str, str], tuple[int, str]]
    cpu_s: float

    @property
    def completed(self) -> Flags:
        return np.array([status == COMPLETED for status in self.statuses], dtype=bool)

    @property
    def met(self) -> Flags:
        """Which runs completed and met every requirement."""
        flags = self.completed
        for values in self.verdicts.values():
            flags = flags & (np.nan_to_num(values, nan=1.0) > 0.5)
        return flags


def _collect(rows: Iterable[CampaignRow], measured: Sequence[Objective]) -> _Table:
    numbers, statuses, variants = array("q"), [], array("q")
    parameters: dict[str, _Choices] = {}
    verdicts: dict[str, _Column] = {}
    observables: dict[str, _Column] = {}
    known: dict[str, int] = {}
    values: list[Mapping[str, Value]] = []
    causes: Counter[tuple[str, str]] = Counter()
    examples: dict[tuple[str, str], tuple[int, str]] = {}
    cpu = 0.0
    for index, row in enumerate(rows):
        numbers.append(row.run)
        statuses.append(intern(row.status))
        variant = known.setdefault(row.point.variant, len(known))
        if variant == len(values):
            values.append(row.point.values)
        variants.append(variant)
        for name, value in row.point.values.items():
            parameters.setdefault(name, _Choices()).put(index, value)
        for name, met in row.verdicts.items():
            verdicts.setdefault(name, _Column()).put(index, np.nan if met is None else float(met))
        for name, seen in row.observables.items():
            observables.setdefault(name, _Column()).put(index, seen if row.completed else np.nan)
        for objective in measured:
            observables.setdefault(objective.name, _Column()).put(index, objective.value(row))
        if not row.completed:
            causes[row.cause] += 1
            examples.setdefault(row.cause, (row.run, row.reason))
        cpu += row.cpu_s
    count = len(numbers)
    return _Table(
        np.array(numbers, dtype=np.int64),
        statuses,
        {name: one.axis(name, count) for name, one in parameters.items()},
        {name: one.all(count) for name, one in verdicts.items()},
        {name: one.all(count) for name, one in observables.items()},
        np.array(variants, dtype=np.int64),
        values,
        causes,
        examples,
        cpu,
    )


def write_page(campaign: Campaign, findings: Findings | None = None) -> Path:
    """Write the page of a campaign into its folder and return its path.

    Args:
        campaign: The campaign; what is finished of it is shown.
        findings: What a search or a sensitivity analysis found.

    Raises:
        UsageError: No run is finished, an objective is not observed, or the page cannot be written.
    """
    found = findings or Findings()
    path = campaign.folder / PAGE_FILE
    try:
        write_text(path, _render(campaign, found))
    except OSError as error:
        raise UsageError(f"cannot write {path}: {error.strerror or error}") from error
    return path


def _render(campaign: Campaign, found: Findings) -> str:
    table = _collect(
        campaign.rows(), [objective for objective in found.objectives if objective.measure is not None]
    )
    if not len(table.numbers):
        raise UsageError(f"{campaign.folder}: no run is finished yet")
    objectives = [objective.name for objective in found.objectives]
    unknown = [name for name in objectives if name not in table.observables]
    if unknown:
        raise UsageError(
            f"no run observed {unknown[0]!r}; there is {', '.join(table.observables) or 'nothing'}"
        )
    shown = objectives or _most_varied(table)
    front = _front(table, found)
    asked, finished = campaign.count()
    drawn = thinned(len(table.numbers), front)
    links = _links(campaign.folder, table, drawn)
    sections = [
        _Section(
            "Requirements",
            "the share of all runs that meet them, with 95 % intervals",
            grid=_requirements(table),
        ),
        *(_Section(grid.title, grid=grid) for grid in found.grids),
        _Section("Variants", _variants_note(table), grid=_variants(table, shown)),
        _parallel(table, shown, front),
        _pareto(table, objectives, front, links),
        *(
            _Section(
                title,
                "the bar is the estimate, the line its 95 % interval",
                [_svg(tornado_chart(effects, title))],
            )
            for title, effects in found.effects.items()
            if effects
        ),
        _distributions(table, shown),
        _Section("Runs without a regular end", grid=_reasons(table)),
    ]
    return (
        environment()
        .get_template("campaign.html.j2")
        .render(
            title=campaign.folder.resolve().name,
            subtitle=_subtitle(campaign),
            outcome=_outcome(asked, finished),
            facts=_facts(table),
            warnings=_warnings(table, asked, finished),
            sections=[section for section in sections if section.figures or section.grid],
            runs=[_run(table, int(index), shown, links) for index in drawn],
            runs_title=f"the {len(drawn)} runs that are drawn"
            if len(drawn) < len(table.numbers)
            else f"all {_counted(len(drawn), 'run')}",
            run_columns=["status", *table.parameters, *shown],
            again=f"volery explore --out {campaign.folder} --show RUN makes one again, with trace and report",
            footer="volery: one model, simulated, priced and flown",
        )
    )


class _Section(NamedTuple):
    title: str
    note: str = ""
    figures: Sequence[Any] = ()
    grid: Grid | None = None
    wide: bool = False
    folded: str = ""


def _svg(text: str) -> Markup:
    return Markup(text)  # drawn by matplotlib, which escapes every name


def _subtitle(campaign: Campaign) -> str:
    stated = campaign.stated
    model = stated["model"] or "a model built in Python"
    return (
        f"{model} · {_counted(campaign.specification.seeds, 'seed')} a variant · volery {stated['version']}"
    )


def _outcome(asked: int, finished: int) -> Fact:
    if finished < asked:
        return Fact("unfinished", f"{finished} of {asked} runs", status="warn")
    return Fact("finished", _counted(finished, "run"), status="good")


def _facts(table: _Table) -> list[Fact]:
    count, completed = len(table.numbers), int(table.completed.sum())
    discarded = sum(status == DISCARDED for status in table.statuses)
    failed = count - completed - discarded
    facts = [
        Fact("runs", str(count), _counted(len(table.variant_values), "variant")),
        Fact("completed", str(completed)),
        Fact("met all requirements", _share(int(table.met.sum()), count)),
        Fact(
            "computing time",
            _duration(table.cpu_s),
            f"{1e3 * table.cpu_s / max(count - discarded, 1):.0f} ms a run",
        ),
    ]
    if failed:
        facts.append(Fact("without a regular end", str(failed), status="bad"))
    if discarded:
        facts.append(Fact("discarded", _share(discarded, count), "by analysis, not run"))
    return facts


def _duration(seconds: float) -> str:
    for size, unit in ((3600.0, "h"), (60.0, "min")):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.1f} {unit}"
    return f"{seconds:.1f} s"


def _share(part: int, whole: int) -> str:
    return f"{100.0 * part / whole:.3g} %" if whole else "–"


def _warnings(table: _Table, asked: int, finished: int) -> list[str]:
    said = []
    if finished < asked:
        said.append(f"{asked - finished} runs are not finished; the same command goes on.")
    few = [name for name, values in table.verdicts.items() if _judged(values).too_few]
    if few:
        said.append(f"Too few runs to know the probability well of: {', '.join(few)}.")
    return said


def _judged(values: Values) -> Interval:
    judged = values[np.isfinite(values)]
    return probability(int(judged.sum()), len(judged))


def _requirements(table: _Table) -> Grid:
    columns = (
        Column("requirement"),
        Column("met", numeric=True),
        Column("probability", numeric=True),
        Column("95 % interval", numeric=True),
        Column("method"),
    )
    rows = [(name, _judged(values)) for name, values in table.verdicts.items()]
    rows.append(("all, and a regular end", probability(int(table.met.sum()), len(table.numbers))))
    return Grid("Requirements", columns, tuple(_probability_row(name, one) for name, one in rows))


def _probability_row(name: str, one: Interval) -> tuple[Cell, ...]:
    if not one.runs:
        return (Cell(name), Cell("never judged", status="quiet"), Cell("–"), Cell("–"), Cell(""))
    successes = round(one.estimate * one.runs)
    status: CellStatus = "good" if successes == one.runs else "warn" if successes else "bad"
    return (
        Cell(name),
        Cell(f"{successes} of {one.runs}", status=status),
        Cell(f"{one.estimate:.4g}", share=one.estimate),
        Cell(f"{one.low:.4g} to {one.high:.4g}"),
        Cell(f"{one.method}{'; ' if one.too_few else ''}{one.too_few}", status="quiet"),
    )


def _variants_note(table: _Table) -> str:
    count = len(table.variant_values)
    return f"the best {MOST_VARIANTS} of {count}" if count > MOST_VARIANTS else ""


def _variants(table: _Table, shown: Sequence[str]) -> Grid:
    """Return the variants, those that meet the requirements most often first, and the cheapest of them."""
    count = len(table.variant_values)
    if count < 2:
        return Grid("Variants", (), ())
    places = table.variants
    met, completed = table.met, table.completed
    runs = np.bincount(places, minlength=count)
    good = np.bincount(places, weights=met, minlength=count).astype(int)
    first = _means(table, shown[0]) if shown else np.zeros(count)
    ranked = np.lexsort((np.nan_to_num(first, nan=np.inf), -good / np.maximum(runs, 1)))[:MOST_VARIANTS]
    columns = (
        *(Column(name) for name in table.parameters),
        Column("runs", numeric=True),
        Column("met all", numeric=True),
        Column("95 % interval", numeric=True),
        *(Column(name, numeric=True, hint="mean and the half width of its 95 % interval") for name in shown),
    )
    rows = []
    for variant in ranked:
        inside = places == variant
        judged = probability(int(good[variant]), int(runs[variant]))
        values = table.variant_values[variant]
        rows.append(
            (
                *(Cell(_text(values.get(name, ""))) for name in table.parameters),
                Cell(str(runs[variant])),
                Cell(f"{good[variant]}", status="good" if good[variant] == runs[variant] else "warn"),
                Cell(f"{judged.low:.3g} to {judged.high:.3g}"),
                *(_interval_cell(mean(table.observables[name][inside & completed])) for name in shown),
            )
        )
    return Grid("Variants", columns, tuple(rows))


def _means(table: _Table, name: str) -> Values:
    """Return the mean of an observable by variant; NaN where no run completed."""
    places, values = table.variants, table.observables[name]
    known = np.isfinite(values)
    count = len(table.variant_values)
    sums = np.bincount(places[known], weights=values[known], minlength=count)
    runs = np.bincount(places[known], minlength=count)
    means: Values = np.divide(sums, runs, out=np.full(count, np.nan), where=runs > 0)
    return means


def _most_varied(table: _Table, most: int = 3) -> list[str]:
    """Return the observables that vary most from run to run, by their coefficient of variation."""
    scores = {}
    for name, values in table.observables.items():
        known = values[np.isfinite(values)]
        if len(known) > 1 and np.ptp(known) > 0.0:
            scores[name] = float(np.std(known) / (np.mean(np.abs(known)) or 1.0))
    ranked = sorted(scores, key=lambda name: (-min(scores[name], 1.0), name))
    return ranked[:most]


def _front(table: _Table, found: Findings) -> Flags:
    """Return which runs belong to the front: as it was found, else to variants with means none dominates."""
    if found.front is not None:
        wanted = {VariantPoint(values).variant for values in found.front}
        best = {
            index
            for index, values in enumerate(table.variant_values)
            if VariantPoint(values).variant in wanted
        }
    elif len(found.objectives) < 2:
        best = set()
    else:
        signs = [-1.0 if objective.maximise else 1.0 for objective in found.objectives]
        means = [sign * _means(table, one.name) for sign, one in zip(signs, found.objectives, strict=True)]
        scores = np.column_stack(means)
        met = np.bincount(table.variants, weights=table.met, minlength=len(scores))
        runs = np.bincount(table.variants, minlength=len(scores))
        usable = np.flatnonzero(np.isfinite(scores).all(axis=1) & (met == runs))
        best = {int(usable[place]) for place in front_of(scores[usable])} if len(usable) else set()
    return np.isin(table.variants, list(best))


def _parallel(table: _Table, shown: Sequence[str], front: Flags) -> _Section:
    varied = [
        axis
        for axis in table.parameters.values()
        if len(np.unique(axis.values)) > 1 and len(axis.choices) <= MOST_CHOICES
    ]
    results = [Axis(name, table.observables[name]) for name in shown]
    kept = _most_related(varied, results, MOST_AXES - len(results))
    axes = [*kept, *results]
    if len(axes) < 2:
        return _Section("")
    note = "one line a run; red: a requirement is not met" + ("; strong: the front" if front.any() else "")
    if len(kept) < len(varied):
        note += f"; the {len(kept)} of {len(varied)} parameters that go most with {shown[0]}" if shown else ""
    picture = _svg(parallel_coordinates(axes, table.met, front))
    return _Section("All runs", note, [picture], wide=True)


def _most_related(axes: Sequence[Axis], results: Sequence[Axis], most: int) -> list[Axis]:
    """Return the axes that have the greatest correlation with the first result, in their own order."""
    if len(axes) <= most or not results:
        return list(axes[:most])

    def relation(axis: Axis) -> float:
        known = np.isfinite(axis.values) & np.isfinite(results[0].values)
        one, other = axis.values[known], results[0].values[known]
        if len(one) < 2 or not np.ptp(one) or not np.ptp(other):
            return 0.0
        return abs(float(np.corrcoef(one, other)[0, 1]))

    kept = sorted(range(len(axes)), key=lambda place: -relation(axes[place]))[:most]
    return [axes[place] for place in sorted(kept)]


def _counted(count: int, noun: str) -> str:
    """Return a number with its noun."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def _pareto(table: _Table, objectives: Sequence[str], front: Flags, links: Mapping[int, str]) -> _Section:
    pictures = []
    for across, up in combinations(objectives, 2):
        bands = _bands(table, front, across, up)
        axes = (Axis(across, table.observables[across]), Axis(up, table.observables[up]))
        pictures.append(_svg(pareto_plot(*axes, front, links, bands)))
    note = "coloured: variants that no other dominates and that meet all requirements, with 95 % intervals"
    return _Section("Objectives", note, pictures)


def _bands(table: _Table, front: Flags, *names: str) -> dict[int, tuple[Interval, Interval]]:
    """Return the intervals of two objectives at the first run of each variant of the front."""
    places = table.variants
    bands = {}
    for variant in np.unique(places[front]):
        inside = np.flatnonzero(places == variant)
        x, y = (mean(table.observables[name][inside]) for name in names)
        if np.isfinite([x.low, x.high, y.low, y.high]).all():
            bands[int(inside[0])] = (x, y)
    return bands


def _distributions(table: _Table, shown: Sequence[str]) -> _Section:
    pictures = [
        _svg(distribution_plot(Axis(name, table.observables[name]))) for name in shown[:MOST_DISTRIBUTIONS]
    ]
    return _Section("Distributions", "over all completed runs", pictures)


def _reasons(table: _Table) -> Grid:
    columns = (
        Column("status"),
        Column("runs", numeric=True),
        Column("reason"),
        Column("such as run", numeric=True),
    )
    rows = []
    for cause, count in table.causes.most_common(MOST_REASONS):
        run, reason = table.examples[cause]
        status: CellStatus = "quiet" if cause[0] == DISCARDED else "bad"
        rows.append((Cell(cause[0], status=status), Cell(str(count)), Cell(reason or "–"), Cell(str(run))))
    return Grid("Runs without a regular end", columns, tuple(rows))


def _links(folder: Path, table: _Table, drawn: Iterable[int]) -> dict[int, str]:
    """Return where each run leads that is drawn: to its report if it was made again, else to its row."""
    made = {path.parent.name for path in folder.glob(f"run-*/{REPORT_FILE}")}
    links = {}
    for index in drawn:
        name = f"run-{table.numbers[index]}"
        links[index] = f"{name}/{REPORT_FILE}" if name in made else f"#{name}"
    return links


def _run(table: _Table, index: int, shown: Sequence[str], links: Mapping[int, str]) -> dict[str, Any]:
    status = table.statuses[index]
    values = table.variant_values[table.variants[index]]
    return {
        "number": int(table.numbers[index]),
        "link": "" if links[index].startswith("#") else links[index],
        "cells": [
            Cell(status, status="quiet" if status == COMPLETED else "bad"),
            *(Cell(_text(values.get(name, ""))) for name in table.parameters),
            *(Cell(figure(_known(table.observables[name][index]))) for name in shown),
        ],
    }


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
