"""``volery explore``: a campaign of many runs over seeds and variants of a model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from volery.base.errors import UsageError
from volery.base.installed import require_extra
from volery.cli.command import FAILED, OK, Commands
from volery.cli.console import Output, make_table, number_column

if TYPE_CHECKING:
    from volery.explore.campaign import Campaign, CampaignProgress
    from volery.explore.points import Row

commands = Commands()

CAMPAIGN = Path("campaign")
SHOWN_VARIANTS = 40
SHOWN_REASONS = 8


@commands.add("quiet", "json", "debug")
def explore(
    output: Output,
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

    A campaign that was interrupted, or whose computer failed, is resumed by the same command, or by
    `volery explore --out DIR`. Exit status: 0 if every run came to its regular end, 2 for bad input,
    1 otherwise.
    """
    require_extra("simulation", "campaigns")
    from volery.cli.run_display import status_line
    from volery.explore.campaign import Campaign, prepare
    from volery.explore.campaign_page import write_page
    from volery.explore.specification import parameter_from_option, read_specification, specification_of

    if show is not None:
        return _show(output, out, show)
    with status_line(output) as line:

        def tell(progress: CampaignProgress) -> None:
            line(_progress_text(progress))

        if model is None:
            campaign = Campaign(out, on=on, workers=workers, show=tell)
        else:
            space: dict[str, Any] = dict(parameter_from_option(one) for one in varied or ())
            space |= {"allocation": allocation} if allocation else {}
            space |= {"scenario": scenario} if scenario else {}
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
            campaign = prepare(model, out, space, specification=made, on=on, workers=workers, show=tell)
        with campaign:
            try:
                campaign.run(campaign.specification.run_points())
            except KeyboardInterrupt:
                asked, finished = campaign.count()
                goes_on = f"`volery explore --out {out}` goes on"
                output.complain(f"volery: interrupted after {finished} of {asked} runs; {goes_on}")
                return FAILED
            campaign.export()
            write_page(campaign)
    return _show_summary(output, campaign.folder)


def _progress_text(progress: CampaignProgress) -> str:
    from volery.base.time import S, clock

    others = ", ".join(
        f"{count} {status}" for status, count in progress.statuses.items() if status != "completed"
    )
    left = "" if progress.left_s is None else f", {clock(round(progress.left_s * S))[:-4]} left"
    return f"{progress.finished} of {progress.asked} runs{f' ({others})' if others else ''}{left}"


def _show(output: Output, folder: Path, run: int) -> int:
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


def _values(row: Row) -> str:
    return "".join(f"{path} = {value}, " for path, value in row.point.values.items())


def _show_summary(output: Output, folder: Path) -> int:
    """Show what a campaign came to. Return the exit status."""
    from volery.explore.campaign import Campaign

    with Campaign(folder) as campaign:
        found = _summary(campaign)
    variants, reasons = found["variants"], found["reasons"]
    varied = list(dict.fromkeys(path for one in variants for path in one["values"]))
    names = list(dict.fromkeys(name for one in variants for name in one["met"]))
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
