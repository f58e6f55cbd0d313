"""``volery explore``: a campaign of many runs over seeds and variants of a model."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from volery.base import units
from volery.base.errors import UsageError, choices, did_you_mean
from volery.base.installed import require_extra
from volery.cli.command import FAILED, OK, Commands
from volery.cli.console import CommandOutput, make_table, number_column

if TYPE_CHECKING:
    from collections.abc import Mapping

    from volery.base.time import Ns
    from volery.explore.campaign import Campaign, CampaignProgress
    from volery.explore.campaign_page import Findings
    from volery.explore.flight_phases import Phases
    from volery.explore.points import CampaignRow
    from volery.explore.search import Objective

commands = Commands()

CAMPAIGN = Path("campaign")
ALL = "all"
SHOWN_VARIANTS = 40
SHOWN_REASONS = 8


@commands.add("quiet", "json", "debug")
def explore(
    output: CommandOutput,
    model: Annotated[
        Path | None,
        typer.Argument(help="Model file, or folder with a model.yaml; none to resume a campaign."),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder of the campaign.")] = CAMPAIGN,
    seeds: Annotated[int | None, typer.Option(help="Runs of each variant, with different seeds.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the campaign.")] = None,
    varied: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="PATH=VALUES",
            help="Vary a value of the model: `600 MHz, 1 GHz`, `0 m/s .. 8 m/s`, or YAML; may be repeated.",
        ),
    ] = None,
    allocation: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Allocation of the model; may be repeated.")
    ] = None,
    scenario: Annotated[
        list[str] | None, typer.Option(help="Scenario of the model; may be repeated.")
    ] = None,
    plan: Annotated[
        str | None,
        typer.Option(
            metavar="grid|random|latin-hypercube|sobol", help="How the space is sampled; by default a grid."
        ),
    ] = None,
    points: Annotated[int | None, typer.Option(help="Variants of a plan that is no grid.")] = None,
    fidelity: Annotated[
        str | None, typer.Option(metavar="times|code", help="As of `volery simulate`.")
    ] = None,
    spec: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="YAML file with `explore:`; by default explore.yaml beside the model."
        ),
    ] = None,
    until: Annotated[
        str | None,
        typer.Option(
            metavar="TEXT",
            help="Run seeds of each variant, at most --seeds, until an interval is narrow: "
            "`delivery_time.p95 within 5 %`.",
        ),
    ] = None,
    minimise: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME", help="Search: an observable, or hardware_price; up to three, with --maximise."
        ),
    ] = None,
    maximise: Annotated[list[str] | None, typer.Option(metavar="NAME", help="Search: an observable.")] = None,
    evaluations: Annotated[int, typer.Option(help="Search: variants that are run.")] = 100,
    influence: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Which parameters influence this observable, and how much."),
    ] = None,
    method: Annotated[str, typer.Option(metavar="morris|sobol", help="Method of --influence.")] = "morris",
    faults: Annotated[
        list[str] | None,
        typer.Option(
            metavar="all|PHASE|PHASE=TIME",
            help="Try every kind of fault on everything in this phase of a flight: take-off, cruise, "
            "hover or landing, or at this time of the run; may be repeated.",
        ),
    ] = None,
    on: Annotated[
        str,
        typer.Option(metavar="ENGINE", help="processes, dask://HOST:PORT or ray://HOST:PORT."),
    ] = "processes",
    workers: Annotated[int, typer.Option(help="Runs at a time; 0 for one on each processor.")] = 0,
    limit: Annotated[str | None, typer.Option(metavar="TIME", help="Wall time that a run may take.")] = None,
    memory: Annotated[
        str | None, typer.Option(metavar="SIZE", help="Resident memory that a run may use, such as `2 GB`.")
    ] = None,
    show: Annotated[
        int | None,
        typer.Option(metavar="RUN", help="Make this run of the campaign again, with trace and report."),
    ] = None,
) -> int:
    """Run a model over seeds and variants, and record a row for each run.

    A campaign that was interrupted, or whose computer failed, is resumed by the same command; one without a
    search, an analysis or faults also by `volery explore --out DIR`. Exit status: 0 if every run came to its
    regular end, 2 for bad input, 1 otherwise.
    """
    require_extra("simulation", "campaigns")
    from volery.cli.run_display import status_line
    from volery.explore.campaign import Campaign, CampaignRequest, prepare
    from volery.explore.campaign_page import write_page
    from volery.explore.space import Choices
    from volery.explore.specification import parameter_from_option, read_specification, specification_of

    if show is not None:
        return _show(output, out, show)
    objectives = [(name, False) for name in minimise or ()] + [(name, True) for name in maximise or ()]
    study = _Study(until, objectives, evaluations, influence, method, faults or [])
    study.check()
    with status_line(output) as line:

        def tell(progress: CampaignProgress) -> None:
            line(_progress_text(progress))

        if model is None:
            campaign = Campaign(out, on=on, workers=workers, show=tell)
        else:
            space: dict[str, Any] = dict(parameter_from_option(one) for one in varied or ())
            space |= {"allocation": Choices(allocation)} if allocation else {}
            space |= {"scenario": Choices(scenario)} if scenario else {}
            stated = {
                "seeds": seeds,
                "seed": seed,
                "plan": plan,
                "points": points,
                "fidelity": fidelity,
                "limit": limit,
                "memory": memory,
            }
            made = specification_of(model, spec)
            changed = {name: value for name, value in stated.items() if value is not None}
            made = read_specification({**made.plain(), **changed})
            made = replace(made, space={**made.space, **space})
            campaign = prepare(CampaignRequest(model, out, made, on, workers, tell))
        with campaign:
            try:
                findings = _study(campaign, study)
            except KeyboardInterrupt:
                asked, finished = campaign.count()
                output.complain(
                    f"volery: interrupted after {finished} of {asked} runs; the same command goes on"
                )
                return FAILED
            campaign.export()
            write_page(campaign, findings)
    return _show_summary(output, campaign.folder, findings)


class _Study(NamedTuple):
    """The method of a campaign: a stopping rule, a search, an analysis or faults; at most one of them."""

    until: str | None
    objectives: list[tuple[str, bool]]
    evaluations: int
    influence: str | None
    method: str
    faults: list[str]

    def check(self) -> None:
        """Read what is written as text. Raises ``UsageError`` for a wrong text or for several methods."""
        from volery.explore.statistics import read_until

        methods = {
            "--until": self.until,
            "--minimise or --maximise": self.objectives,
            "--influence": self.influence,
            "--faults": self.faults,
        }
        stated = [option for option, value in methods.items() if value]
        if len(stated) > 1:
            raise UsageError(f"{' and '.join(stated)}: a campaign has one of them at a time")
        if self.until:
            read_until(self.until)
        for phase in self.faults:
            _phase(phase)


def _study(campaign: Campaign, study: _Study) -> Findings:
    """Run what a campaign is to run, and return what was found."""
    from volery.explore.campaign_page import Findings, of_faults, of_front, of_influences, of_intervals
    from volery.explore.run_process import read_variant
    from volery.explore.search import analysis_discards, search
    from volery.explore.sensitivity import fault_campaign, sensitivity
    from volery.explore.statistics import read_until

    space, seed = campaign.specification.space, campaign.specification.seed
    if study.until:
        until = read_until(study.until)
        return of_intervals(until, campaign.run_until(until))
    if study.objectives:
        front = search(
            campaign.evaluate,
            space,
            [_objective(campaign, name, maximise) for name, maximise in study.objectives],
            evaluations=study.evaluations,
            seed=seed,
            constraints=_requirements(campaign),
            repetitions=campaign.specification.seeds,
            discard=analysis_discards(campaign.setting.model, campaign.setting.fidelity),
        )
        if front.discarded and not front.evaluated:
            reasons = "; ".join(f"{why} ({count})" for why, count in front.discarded.items())
            raise UsageError(f"the analysis discards every variant, so none is run: {reasons}")
        return of_front(front)
    if study.influence:
        found = sensitivity(campaign.evaluate, space, study.influence, method=study.method, seed=seed)
        return of_influences(found)
    if study.faults:
        phases = _phases(campaign, study.faults)
        system = read_variant(campaign.setting.model, {})
        repetitions = campaign.specification.seeds
        return of_faults(
            fault_campaign(campaign.evaluate, system, phases, repetitions=repetitions, seed=seed)
        )
    campaign.run(campaign.specification.run_points())
    return Findings()


def _requirements(campaign: Campaign) -> list[str]:
    """Return the names of the requirements that the variants have, of which each may have others."""
    from volery.base.errors import ModelError
    from volery.explore.run_process import read_variant
    from volery.explore.space import Choices
    from volery.model.text import CollectedModelError

    names: dict[str, None] = {}
    for path, one in campaign.specification.space.items():
        for value in one.values if isinstance(one, Choices) else [one.at(0.5)]:
            with suppress(ModelError, CollectedModelError):  # its runs say what is wrong
                system = read_variant(campaign.setting.model, {path: value})
                names |= {each.name: None for each in system.requirements}
    return list(names)


def _objective(campaign: Campaign, name: str, maximise: bool) -> Objective:
    """Return the objective of a name; the price of the hardware is one that no run observes."""
    from volery.analysis.hardware import hardware, hardware_price
    from volery.explore.run_process import read_variant
    from volery.explore.search import Objective, hardware_cost

    model = campaign.setting.model
    if name != "hardware_price":
        return Objective(name, maximise)
    currencies = list(hardware_price(hardware(read_variant(model, {}))))
    if len(currencies) != 1 or maximise:
        there = ", ".join(currencies) or "no price"
        raise UsageError(f"hardware_price is minimised in one currency; this model has {there}")
    return hardware_cost(model, currencies[0])


def _phases(campaign: Campaign, texts: list[str]) -> Phases:
    """Return the phases that are stated, and those that are to be found in a run without faults."""
    from volery.explore.flight_phases import EVERYWHERE

    stated = [_phase(text) for text in texts]
    if all(at is not None for _, at in stated):
        found: Phases = {}
    else:
        found = campaign.flight_phases()
    phases: dict[str, Mapping[str, Ns]] = {}
    for name, at in stated:
        if at is not None:
            phases[name] = {EVERYWHERE: at}
        elif name == ALL:
            phases |= found
        elif name in found:
            phases[name] = found[name]
        else:
            raise UsageError(
                f"--faults {name}: the flight has no such phase{did_you_mean(name, found)}; "
                f"there is {choices((ALL, *found))}, or write a time: `{name}=5 s`"
            )
    return phases


def _phase(text: str) -> tuple[str, Ns | None]:
    """Return the name and the time of a phase that is written as ``landing`` or ``landing=5 s``."""
    name, found, at = text.partition("=")
    if not name.strip():
        raise UsageError(f"--faults {text!r}: write a phase, such as `landing`, or with a time `landing=5 s`")
    try:
        return name.strip(), units.read_ns(at.strip()) if found else None
    except units.QuantityError as error:
        raise UsageError(f"--faults {text!r}: {error}") from None


def _progress_text(progress: CampaignProgress) -> str:
    from volery.base.time import S, clock

    others = ", ".join(
        f"{count} {status}" for status, count in progress.statuses.items() if status != "completed"
    )
    left = "" if progress.left_s is None else f", {clock(round(progress.left_s * S))[:-4]} left"
    return f"{progress.finished} of {progress.asked} runs{f' ({others})' if others else ''}{left}"


def _show(output: CommandOutput, folder: Path, run: int) -> int:
    """Make a run again."""
    from volery.cli.run_display import show_outcome
    from volery.explore.campaign import Campaign

    with Campaign(folder) as campaign:
        row = campaign.row(run)
        output.note(f"run {run}: {_values(row)}seed {row.point.seed}")
        made = campaign.show(run, folder / f"run-{run}")
        if row.status and row.completed != made.completed:
            raise UsageError(f"run {run} was {row.status} ({row.reason}) and is not now")
    return show_outcome(output, made)


def _values(row: CampaignRow) -> str:
    return "".join(f"{path} = {value}, " for path, value in row.point.values.items())


def _show_summary(output: CommandOutput, folder: Path, findings: Findings) -> int:
    """Show what a campaign came to, and what its method found. Return the exit status."""
    from volery.explore.campaign import Campaign
    from volery.report.terminal import GridTable

    with Campaign(folder) as campaign:
        found = _summary(campaign)
    variants, reasons = found["variants"], found["reasons"]
    varied = list(dict.fromkeys(path for variant in variants for path in variant["values"]))
    names = list(dict.fromkeys(name for variant in variants for name in variant["met"]))
    table = make_table(*varied, number_column("runs"), number_column("completed"), *map(number_column, names))
    for one in variants[:SHOWN_VARIANTS]:
        shares = [f"{one['met'].get(name, 0)}/{one['judged'].get(name, 0)}" for name in names]
        values = [str(one["values"].get(path, "")) for path in varied]
        table.add_row(*values, str(one["runs"]), str(one["completed"]), *shares)
    output.show(table)
    if len(variants) > SHOWN_VARIANTS:
        output.show(f"and {len(variants) - SHOWN_VARIANTS} more variants: see {found['table']}")
    for one in reasons[:SHOWN_REASONS]:
        again = f"`volery explore --out {folder} --show {one['first']}`"
        output.note(f"{one['runs']} {one['status']}, such as: {one['reason']}; {again}")
    for grid in findings.grids:
        if grid:
            output.show(GridTable(grid))
    found["findings"] = [grid.plain() for grid in findings.grids if grid]
    output.give(found)
    output.note(f"report: {found['report']}\ntable: {found['table']}")
    return OK if set(found["statuses"]) <= {"completed", "discarded"} else FAILED


def _summary(campaign: Campaign) -> dict[str, Any]:
    """Return what the rows come to: counts by variant, and reasons of runs without a regular end."""
    from volery.explore.campaign import TABLE_FILE
    from volery.explore.campaign_page import PAGE_FILE

    variants: dict[str, dict[str, Any]] = {}
    reasons: dict[tuple[str, str], dict[str, Any]] = {}
    for row in campaign.rows():
        one = variants.setdefault(
            row.point.variant,
            {"values": dict(row.point.values), "runs": 0, "completed": 0, "met": {}, "judged": {}},
        )
        one["runs"] += 1
        one["completed"] += row.completed
        for name, met in row.verdicts.items():
            one["judged"][name] = one["judged"].get(name, 0) + (met is not None)
            one["met"][name] = one["met"].get(name, 0) + bool(met)
        if not row.completed:
            like = {"status": row.status, "reason": row.reason, "runs": 0, "first": row.run}
            reasons.setdefault(row.cause, like)["runs"] += 1
    return {
        "folder": str(campaign.folder),
        "table": str(campaign.folder / TABLE_FILE),
        "report": str(campaign.folder / PAGE_FILE),
        "statuses": dict(campaign.statuses()),
        "variants": list(variants.values()),
        "reasons": sorted(reasons.values(), key=lambda one: -one["runs"]),
    }
