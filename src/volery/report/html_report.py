"""The report of a run as one HTML file that needs no network.

A report is made from the events of a run: while it runs, or later from the trace of its folder alone. If the
folder has a ``run.json``, its figures are shown, since only ``run.json`` has the wall time; else the accounts
are computed again from the trace, as for a run that was killed.
"""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple, get_args

from volery.base.errors import UsageError
from volery.base.files import read_text, write_text
from volery.base.installed import require_extra
from volery.report.digest import Digest, Json
from volery.report.grids import (
    Cell,
    CellStatus,
    Column,
    Grid,
    added_grids,
    by_state,
    chains_grid,
    cost_grid,
    energy,
    last_states,
    laws_grid,
    moment,
    number,
    operations_grid,
    plural,
    preemptions_grid,
    processors_grid,
    requirements_grid,
    ros_calls_grid,
    total,
    vehicles_grid,
    widest_band,
)
from volery.requirements.accounts import Accounts
from volery.requirements.record import RUN_FILE, RunRecord, Status, read_record, write_record
from volery.trace.attachments import WORLD_ATTACHMENT, RunSetup, scenery_from_json
from volery.trace.events import Event, Record, Verdict
from volery.trace.mcap_writer import OUTCOME, TRACE_FILE, Attachment
from volery.trace.reader import OpenTrace
from volery.trace.timeline import TimelineWriter

try:
    from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
    from markupsafe import Markup
except ModuleNotFoundError:
    require_extra("report", "HTML reports")
    raise

REPORT_FILE = "report.html"
_MOST_OTHERS = 3  # states in a figure of the headline beside the most frequent one


@dataclass(frozen=True)
class Fact:
    """Figure in the headline of the report."""

    name: str
    value: str
    note: str = ""
    status: CellStatus = ""


@dataclass(frozen=True)
class ReportContent:
    """Content of a report. ``lost`` describes what is missing from the trace."""

    record: RunRecord
    data: Json
    lost: str = ""


class HtmlReport:
    """Reporter of a run that is in progress: keeps what its report draws, and writes the report at its end.

    The report is that which ``recover`` makes of the run's trace, without reading the trace.
    """

    def __init__(self, setup: RunSetup, attachments: Iterable[Attachment]) -> None:
        self._digest = _digest(setup, {attachment.name: attachment for attachment in attachments})

    def __call__(self, event: Event) -> None:
        """Take an event."""
        self._digest(event)

    def listener(self, kind: type[Any]) -> Record | None:
        """Return what takes events of a kind; None if they do not matter to the report."""
        return self._digest.listener(kind)

    def write(self, record: RunRecord, folder: Path) -> Path:
        """Write ``report.html`` into a finished run folder and return its path."""
        return write_document(ReportContent(record, self._digest.data(record.sim_s)), folder)


def _digest(setup: RunSetup, attachments: Mapping[str, Attachment]) -> Digest:
    world = attachments.get(WORLD_ATTACHMENT)
    return Digest(setup, scenery_from_json(world.data) if world else None)


def gather(folder: Path, *taps: Record) -> ReportContent:
    """Read the trace of a run, and its ``run.json`` if there is one.

    Without ``run.json`` the accounts are computed again, and requirements without a verdict are judged by the
    events of the trace.

    Args:
        folder: Run folder.
        taps: Receive every event, if there is no ``run.json``.

    Raises:
        UsageError: There is no trace, or it ends before its header.
    """
    with OpenTrace(folder / TRACE_FILE) as reading:
        digest = _digest(reading.setup, reading.attachments)
        if (folder / RUN_FILE).exists():
            record = read_record(folder)
            for event in reading.events(digest.takers):
                digest(event)
        else:
            record = _account(reading, (digest, *taps))
    return ReportContent(record, digest.data(record.sim_s), reading.lost)


def _account(reading: OpenTrace, taps: Iterable[Record]) -> RunRecord:
    from volery.requirements.verdicts import Observers, bounds_of

    accounts = Accounts(reading.setup)
    observers = Observers(bounds_of(reading.setup), reading.setup)
    receivers: tuple[Record, ...] = (accounts, observers, *taps)
    judged = False
    for event in reading.events():
        judged = judged or isinstance(event, Verdict)
        for tap in receivers:
            tap(event)
    for verdict in () if judged else observers.verdicts(accounts.last):
        accounts(verdict)
    ending = reading.metadata.get(OUTCOME, {})
    return accounts.record(status_of(ending), ending.get("reason", "") or reading.lost)


def status_of(ending: Mapping[str, str]) -> Status:
    """Return the status of a run from its trace; ``unfinished`` if the run was killed."""
    known = (status for status in get_args(Status) if status == ending.get("status"))
    return next(known, "unfinished")


def write_document(material: ReportContent, folder: Path) -> Path:
    """Write ``report.html`` from gathered content and return its path."""
    path = folder / REPORT_FILE
    try:
        write_text(path, render(material))
    except OSError as error:
        raise UsageError(f"cannot write {path}: {error.strerror or error}") from error
    return path


SCRIPTS = ("stage", "map", "charts", "pictures", "player")
"""Scripts of a page, in the order in which they run."""


def environment() -> Environment:
    """Return the template environment; it escapes every value, and the pages allow its own scripts only."""
    made = Environment(
        loader=PackageLoader("volery.report"),
        autoescape=select_autoescape(default=True, default_for_string=True),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    templates = files("volery.report") / "templates"
    scripts = [(templates / f"{name}.js").read_text(encoding="utf-8") for name in SCRIPTS]
    made.globals["scripts"] = [Markup(script) for script in scripts]
    made.globals["script_hashes"] = " ".join(map(_content_hash, scripts))
    return made


def _content_hash(script: str) -> str:
    """Return how a content security policy names a script that may run."""
    return f"'sha256-{b64encode(sha256(script.encode()).digest()).decode()}'"


def render(material: ReportContent) -> str:
    """Return the HTML of a report."""
    record, data = material.record, material.data
    return (
        environment()
        .get_template("report.html.j2")
        .render(
            title=record.system or "A run",
            subtitle=_subtitle(record),
            outcome=_outcome(record),
            facts=_facts(record),
            troubles=_troubles(record, material.lost),
            requirements=requirements_grid(record),
            moving=bool(data["vehicles"]),
            computing=any(processor["components"] for processor in data["processors"]),
            end=data["end"],
            maps=data["maps"],
            layers=_layers(data),
            pictures=[{"topic": one["topic"], "at": moment(one["t"])} for one in data["pictures"]],
            cost=cost_grid(record),
            chains=chains_grid(record),
            preemptions=preemptions_grid(record),
            ros_calls=ros_calls_grid(record),
            processors=processors_grid(record),
            vehicles=vehicles_grid(record),
            operations=operations_grid(record),
            notes=[_lanes(kind, record.sim_s) for kind in data["notes"]],
            added=added_grids(record),
            ticks=_ticks(record.sim_s),
            not_counted=record.not_counted,
            warnings=record.warnings,
            unserved=[str(one) for one in record.unserved],
            omitted=_omitted(data["omitted"]),
            laws=laws_grid(record),
            remarks=_remarks(data["remarks"]),
            left_out=data["left_out"],
            footer=_footer(record),
            data=embedded(data),
        )
    )


def _omitted(topics: list[Json]) -> list[str]:
    """Return a line for each topic whose messages are in the trace without their content."""
    return [
        f"{topic['topic']}: {topic['messages']} messages of {topic['bytes'] / 1e6:.1f} MB; "
        f"volery simulate --record {topic['topic']} records their content, too"
        for topic in topics
    ]


def _layers(data: Json) -> list[dict[str, str]]:
    """Return the legend of what nodes published of maps: colours and words."""
    layers = []
    for one in data["maps"]:
        fit = f", within {100.0 * one['error']:.0f} cm of the track of {one['vehicle']}"
        layers.append(_layer("ink", one, f"map{fit if one['vehicle'] else ''}"))
    for one in data["paths"]:
        layers.append(
            _layer("accent", one, "way come") if one["past"] else _layer("warn", one, "planned path")
        )
    return layers + [_layer("noflight", one, "scan") for one in data["scans"]]


def _layer(colour: str, one: Json, words: str) -> dict[str, str]:
    return {"colour": colour, "text": f"{one['topic']} at {moment(one['t'])[:-4]}: {words}"}


def embedded(data: Any) -> Markup:
    """Return JSON that is safe within a script element."""
    text = json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return Markup(text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e"))


def _subtitle(record: RunRecord) -> str:
    named = (("allocation", record.allocation), ("scenario", record.scenario), ("fidelity", record.fidelity))
    return " · ".join([*(f"{what} {name}" for what, name in named if name), f"seed {record.seed}"])


def _outcome(record: RunRecord) -> Fact:
    outcome = record.outcome
    if outcome.status != "completed":
        return Fact(outcome.status, outcome.reason, status="bad")
    if outcome.requirements_met is None:
        return Fact("completed", "no requirement was judged", status="warn")
    if outcome.requirements_met:
        return Fact("completed", "all requirements met", status="good")
    missed = sum(1 for requirement in record.requirements.values() if requirement.met is False)
    return Fact("completed", f"{missed} of {len(record.requirements)} requirements not met", status="bad")


def _facts(record: RunRecord) -> list[Fact]:
    facts = [Fact("lasted" if record.is_real else "simulated", moment(record.sim_s)[:-4], "h:mm:ss")]
    if record.wall_s is not None and not record.is_real:
        speed = number(record.real_time_factor, 0, "× real time")
        facts.append(Fact("it took", number(record.wall_s, 1, "s"), speed))
    for kind, subjects in record.notes.items():
        (state, most), *others = last_states(subjects).most_common()
        value, rest = f"{most} of {len(subjects)}", by_state(dict(others[:_MOST_OTHERS]))
        facts.append(Fact(f"{plural(kind)} {state}", value, rest))
    if record.vehicles:
        flown = sum(vehicle.distance_m for vehicle in record.vehicles.values())
        facts.append(
            Fact("driven and flown", number(flown / 1000.0, 2, "km"), _many(len(record.vehicles), "vehicle"))
        )
    computers = total([processor.energy_j for processor in record.processors.values()])
    vehicles = total([vehicle.energy_j for vehicle in record.vehicles.values()])
    if computers is not None:
        facts.append(Fact("energy of computers", energy(computers), widest_band(record)))
    if vehicles is not None:
        facts.append(Fact("energy of vehicles", energy(vehicles)))
    misses = sum(component.deadline_misses for component in record.components.values())
    if any(component.activations for component in record.components.values()):
        facts.append(Fact("missed deadlines", str(misses), status="bad" if misses else ""))
    return facts


def _many(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def _troubles(record: RunRecord, lost: str) -> list[str]:
    said = [f"{moment(failure.at_s)}  {failure.who}: {failure.what}" for failure in record.failures]
    if record.outcome.status != "completed" and record.outcome.reason != lost:
        said.insert(0, f"{record.outcome.status}: {record.outcome.reason}")
    return [*said, f"the trace: {lost}"] if lost else said


def _lanes(kind: Json, end: float) -> Json:
    """Return the notes of one kind: each state's colour, each subject as spans of a row that is 100 wide."""
    names = dict.fromkeys(step["state"] for subject in kind["subjects"] for step in subject["steps"])
    colours = {name: index % 8 + 1 for index, name in enumerate(names)}
    return {
        **kind,
        "states": [{"name": name, "colour": colour} for name, colour in colours.items()],
        "lanes": [_lane(one["name"], one["steps"], colours, end) for one in kind["subjects"]],
    }


def _lane(name: str, steps: list[Json], colours: Mapping[str, int], end: float) -> Json:
    ends = [*(step["t"] for step in steps[1:]), max(end, steps[-1]["t"])]
    whole = max(end, 1e-9)
    spans = [
        {
            "left": 100.0 * step["t"] / whole,
            "width": 100.0 * (until - step["t"]) / whole,
            "colour": colours[step["state"]],
            "state": step["state"],
            "title": f"{step['state']} until {moment(until)} by {step['by']}  {step['detail']}".strip(),
        }
        for step, until in zip(steps, ends, strict=True)
    ]
    columns = (Column("at"), Column("state"), Column("where"), Column("by"), Column("detail"))
    rows = tuple(
        (
            Cell(moment(step["t"])),
            Cell(step["state"]),
            Cell(step["vehicle"] or step["place"]),
            Cell(step["by"]),
            Cell(step["detail"], status="quiet"),
        )
        for step in steps
    )
    return {"name": name, "state": steps[-1]["state"], "spans": spans, "history": Grid(name, columns, rows)}


def _ticks(end: float) -> list[dict[str, Any]]:
    steps = (1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 43200)
    step = next((step for step in steps if end / step <= 8), 86400)
    count = int(end // step) if end > 0 else 0
    return [
        {"left": 100.0 * index * step / end, "text": moment(index * step)[:-4]}
        for index in range(count + 1)
        if end
    ]


def _remarks(remarks: list[Json]) -> Grid:
    statuses: dict[str, CellStatus] = {"failure": "bad", "refused": "bad", "warning": "warn"}
    rows = tuple(
        (
            Cell(moment(remark["t"])),
            Cell(remark["who"]),
            Cell(remark["kind"], status=statuses.get(remark["kind"], "quiet")),
            Cell(remark["what"]),
        )
        for remark in remarks
    )
    return Grid("Remarks", (Column("at"), Column("who"), Column("kind"), Column("what")), rows)


def _footer(record: RunRecord) -> str:
    made = [f"{name} {version}" for name, version in record.versions.items()]
    return " · ".join(["volery: one model, simulated, priced and flown", *made])


TIMELINE_FILE = "timeline.json"


class Recovered(NamedTuple):
    """Recovered documents. ``lost`` describes what is missing from the trace, empty if nothing is."""

    record: RunRecord
    report: Path
    lost: str


def _is_cut(file: Path) -> bool:
    """Return whether a file is not even JSON: a full disk has cut it off."""
    try:
        json.loads(read_text(file))
    except (ValueError, RecursionError):
        return True
    except OSError:
        return False
    return False


def recover(folder: Path) -> Recovered:
    """Write ``report.html``, and ``run.json`` and ``timeline.json`` if the run did not write them.

    A recovered record has no wall time and no versions, since the trace does not contain them. A ``run.json``
    that was cut off counts as none. Raises ``UsageError`` as ``gather`` does.
    """
    cut = (folder / RUN_FILE).exists() and (folder / TRACE_FILE).exists() and _is_cut(folder / RUN_FILE)
    if (folder / RUN_FILE).exists() and not cut:
        material = gather(folder)
    else:
        if cut:
            (folder / RUN_FILE).unlink()
        with OpenTrace(folder / TRACE_FILE):
            pass  # raises before a file is made
        timeline = TimelineWriter(folder / TIMELINE_FILE)
        try:
            material = gather(folder, timeline)
        finally:
            timeline.close()
        write_record(material.record, folder)
    return Recovered(material.record, write_document(material, folder), material.lost)
