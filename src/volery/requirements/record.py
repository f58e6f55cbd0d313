"""``run.json``: the results of one run, as documented in ``docs/run-folder.md``.

Seconds, metres, joules, megahertz. A value that was not observed is ``null``, never zero. Wall time and
versions are stored here and nowhere else in a run folder.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from volery.base.errors import UsageError
from volery.base.files import replace_text

RUN_SCHEMA: Final = "volery-run/2"
RUN_FILE = "run.json"

DELIVERY_KIND: Final = "parcel"
"""Kind of the notes of a delivery. Version 1 of ``run.json`` had no others, and ``application.delivered`` and
its like are about them."""

DELIVERY: Final = {
    "ordered": "ordered",
    "delivered": "delivered",
    "undelivered": "failed",
    "delivery_time_max": "delivered.time_max",
    "delivery_time_mean": "delivered.time_mean",
}
"""Quantities of the application that are other names for those of a delivery's notes."""

Status = Literal["completed", "interrupted", "failed", "unfinished"]
"""``interrupted`` by the user; ``failed``: something raised; ``unfinished``: killed, known from its trace."""


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class OutcomeRecord(_Part):
    """How the run ended. ``requirements_met`` is ``null`` where there were no verdicts."""

    status: Status
    reason: str = ""
    requirements_met: bool | None = None


class ResponseRecord(_Part):
    """Response times in seconds: of an active component's activations, of a passive one's calls.

    Activations from release to end, calls as callers saw them. Where there are none, it is of the other kind.
    """

    of: Literal["activations", "calls"] | None = None
    count: int = 0
    mean: float | None = None
    p95: float | None = None
    max: float | None = None


class LatencyRecord(_Part):
    """Latencies in seconds."""

    count: int = 0
    mean: float | None = None
    p95: float | None = None
    max: float | None = None


class ChainRecord(_Part):
    """A chain of topics, the age of the data at its end, and why none was observed, if so."""

    topics: list[str]
    latency_s: LatencyRecord
    unobserved: str = ""


class PreemptionRecord(_Part):
    """How often a task was preempted by another one on a processor."""

    processor: str
    preempted: str
    by: str
    count: int


class UnservedRecord(_Part):
    """What components offered or asked for and no node took or served; see the event ``Unserved``."""

    kind: str
    name: str
    type: str
    who: str
    count: int
    since_s: float
    hint: str

    def __str__(self) -> str:
        """Return it as one sentence."""
        since = f"since {self.since_s:.1f} s"
        who = ", ".join(word.removeprefix("/") for word in self.who.split(", "))
        times = "once" if self.count == 1 else f"{self.count} times"
        said = {
            "publication": f"{self.count} messages by {who} {since}, no node takes them",
            "subscription": f"subscribed to by {who} {since}, no node publishes it",
            "transform": f"looked up {times} by {who} {since}, it was never there",
        }.get(self.kind, f"{self.kind} asked for by {who} {since}, no node serves it")
        return f"{self.name}: {said}{'; ' if self.hint else ''}{self.hint}"


class ComponentRecord(_Part):
    """The computing of a component.

    ``cpu_s`` was executed on its processor; ``ros_cpu_s`` is the part of ROS calls.
    ``energy_j`` is what the model states for its operations, else by the energy law of its processor above
    idle. ``response_bound_s`` is the bound of its response time by analysis, where there is one.
    """

    processor: str
    language: str
    cpu_s: float
    ros_cpu_s: float
    ros_calls: dict[str, int]
    energy_j: float | None
    activations: int
    deadline_misses: int
    calls: int
    response_s: ResponseRecord
    response_bound_s: float | None = None


class ProcessorRecord(_Part):
    """A processor; ``utilisation`` is the busy share of all its cores over the run, 0..1.

    ``energy_error`` is the relative band of its power figures (0.2: within 20 per cent), ``None`` where it is
    unknown.
    """

    kind: str
    frequency_mhz: float
    scheduler: str
    cores: int
    utilisation: float
    energy_j: float | None
    energy_error: float | None = None


class OffsetRecord(_Part):
    """Distance from the commanded point, in metres."""

    horizontal: float | None
    vertical: float | None


class OperationRecord(_Part):
    """One vehicle operation, and its error at the end."""

    operation: str
    asked: str
    start_s: float
    end_s: float
    outcome: str
    said: str
    error_by_estimate_m: OffsetRecord
    error_by_truth_m: OffsetRecord


class VehicleRecord(_Part):
    """The motion of a vehicle; the errors are the largest of all operations that succeeded.

    ``airborne_s`` is the time armed and more than 0.3 m above where it last stood disarmed. ``landed`` is
    true if it stands still, disarmed, at the end. ``firmware`` is the program of real firmware that flew it,
    empty for a simulated autopilot and a real vehicle.
    """

    autopilot: str
    firmware: str = ""
    kind: str
    distance_m: float
    armed_s: float
    airborne_s: float
    energy_j: float | None
    battery: float | None
    landed: bool | None
    battery_swaps: int = 0
    charging_s: float = 0.0
    error_by_estimate_m: OffsetRecord
    error_by_truth_m: OffsetRecord
    operations: list[OperationRecord]


class StepRecord(_Part):
    """A state that a subject entered, and the component that noted it."""

    at_s: float
    state: str
    component: str
    detail: str


class NoteRecord(_Part):
    """A subject of ``volery.note()``: its state at the end, and its history. It is always in one state."""

    state: str
    history: list[StepRecord]


class TableRecord(_Part):
    """A table for the report; each row has a text, a number or nothing for each column."""

    title: str
    columns: list[str]
    rows: list[list[str | float | None]]


class AddedRecord(_Part):
    """What the observables of a package came to: values by ``<subject>.<quantity>``, and its table."""

    values: dict[str, float | None]
    table: TableRecord | None = None


class RequirementRecord(_Part):
    """A bound, the observed value (``null``: none) and whether it was met."""

    observable: str
    relation: str
    bound: float
    unit: str
    observed: float | None
    met: bool | None


class FailureRecord(_Part):
    """A failure."""

    at_s: float
    who: str
    what: str


class LawRecord(_Part):
    """A law that priced the run."""

    name: str
    source: str
    provenance: str
    validity: str
    warning: str


class RunRecord(_Part):
    """The whole of ``run.json``; a document of version 1 is read as one of version 2.

    ``notes`` are by kind and subject, ``added`` by the name of the entry point.
    """

    schema_: Literal["volery-run/2"] = Field(default=RUN_SCHEMA, alias="schema")
    system: str
    fidelity: str
    allocation: str
    scenario: str
    seed: int
    outcome: OutcomeRecord
    components: dict[str, ComponentRecord]
    processors: dict[str, ProcessorRecord]
    vehicles: dict[str, VehicleRecord]
    notes: dict[str, dict[str, NoteRecord]]
    requirements: dict[str, RequirementRecord]
    added: dict[str, AddedRecord] = {}
    chains: dict[str, ChainRecord] = {}
    preemptions: list[PreemptionRecord] = []
    failures: list[FailureRecord]
    laws: list[LawRecord]
    not_counted: list[str]
    warnings: list[str]
    unserved: list[UnservedRecord] = []
    versions: dict[str, str]
    sim_s: float
    wall_s: float | None
    real_time_factor: float | None

    @model_validator(mode="before")
    @classmethod
    def _from_version_1(cls, document: Any) -> Any:
        if not isinstance(document, dict) or document.get("schema") != "volery-run/1":
            return document
        notes = {DELIVERY_KIND: subjects} if (subjects := document.get("parcels")) else {}
        kept = {name: part for name, part in document.items() if name != "parcels"}
        return {**kept, "schema": RUN_SCHEMA, "notes": notes}

    @property
    def parcels(self) -> dict[str, NoteRecord]:
        """Return the notes of a delivery, by the name that version 1 gave them."""
        return self.notes.get(DELIVERY_KIND, {})

    @property
    def is_real(self) -> bool:
        """True for a flight of real vehicles, in real time."""
        return self.fidelity == "hardware"


def write_record(record: RunRecord, folder: Path) -> Path:
    """Write ``run.json`` into *folder*.

    Raises:
        UsageError: the file cannot be written.
    """
    path = folder / RUN_FILE
    try:
        replace_text(path, record.model_dump_json(by_alias=True, indent=2) + "\n")
    except OSError as error:
        raise UsageError(f"cannot write {path}: {error.strerror or error}") from error
    return path


def read_record(folder: Path) -> RunRecord:
    """Read the ``run.json`` of *folder*.

    Raises:
        UsageError: there is none, or it is of another version.
    """
    path = folder / RUN_FILE
    try:
        return RunRecord.model_validate_json(path.read_bytes())
    except OSError as error:
        raise UsageError(f"cannot read {path}: {error.strerror or error}") from error
    except ValidationError as error:
        raise UsageError(f"{path} is not a {RUN_SCHEMA} document: {error}") from error
