"""What ``simulate`` and ``fly`` take and return: options, the progress they report, and the result."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from volery.base.data_frames import to_frame
from volery.base.errors import UsageError, VoleryError, choices, did_you_mean
from volery.base.time import MS, Ns, S, clock
from volery.kernel.api import Kernel
from volery.run.event_log import LEVELS, LogOptions
from volery.run.vehicle_arrays import INDEX, vehicle_arrays
from volery.trace.events import Collision, Event, Failure, Milestone, Text
from volery.vehicles.driver import LINK_LOSS_ACTIONS, LinkLossAction
from volery.vehicles.vehicle_connection import ON_LINK_LOSS

if TYPE_CHECKING:
    from volery.requirements.record import RunRecord

PERIOD: Ns = S


@dataclass(frozen=True)
class VehicleProgress:
    """Present state of a vehicle. ``height`` is metres above the ground, or above home for a real vehicle."""

    name: str
    mode: str
    armed: bool
    height: float


@dataclass(frozen=True)
class RunProgress:
    """Present state of a run.

    ``limit`` is its latest end or 0, ``notes`` the number of noted subjects by kind and present state.
    """

    now: Ns
    limit: Ns
    vehicles: tuple[VehicleProgress, ...]
    notes: dict[str, dict[str, int]]


ReadVehicles = Callable[[], tuple[VehicleProgress, ...]]
"""Returns the present state of the vehicles."""

Show = Callable[[RunProgress], None]
"""Called about once a simulated second. It must not block."""


Tell = Callable[[str], None]
"""Called with a line that the user should read at once. It must not block."""


class LostLinkReporter:
    """Stream tap that reports what each vehicle does when the link to its commander is lost."""

    def __init__(self, tell: Tell) -> None:
        self._tell = tell

    def __call__(self, event: Event) -> None:
        """Report a text about the loss of the link."""
        if isinstance(event, Text) and event.text.startswith(ON_LINK_LOSS):
            self._tell(f"{event.source}: {event.text}")


LINES_A_SECOND = 5
"""Lines of a component's log that are shown in a simulated second; the others are counted."""

_LONGEST = 300


class ComponentLogReporter:
    """Stream tap that shows warnings, errors and failures of components at once, and counts them.

    Args:
        components: Names of the components.
        tell: Shows a line, or None to count only.
    """

    def __init__(self, components: Collection[str], tell: Tell | None) -> None:
        self._tell = tell
        self._errors = dict.fromkeys(components, 0)
        self._warnings = dict.fromkeys(components, 0)
        self._first: dict[str, str] = {}
        self._last: dict[str, str] = {}
        self._second: dict[str, tuple[Ns, int]] = {}
        self._unshown = dict.fromkeys(components, 0)

    def __call__(self, event: Event) -> None:
        """Show and count the lines of severity warning and above, and failures; show collisions."""
        if isinstance(event, Text) and event.severity <= LEVELS["warning"] and event.source in self._errors:
            self._take(event.at, event.source, event.severity, event.text)
        elif (
            isinstance(event, Failure)
            and event.who in self._errors
            and not self._last.get(event.who, "").endswith(event.what)  # a client library has logged it
        ):
            self._take(event.at, event.who, LEVELS["error"], event.what)
        elif isinstance(event, Collision) and self._tell is not None:
            self._tell(f"{clock(event.at)} error   {event.vehicle}: {event}")

    def _take(self, at: Ns, who: str, severity: int, text: str) -> None:
        line = " ".join(text.split())
        self._last[who] = text
        self._first.setdefault(who, line)
        counts, word = (self._errors, "error") if severity <= LEVELS["error"] else (self._warnings, "warning")
        counts[who] += 1
        second, shown = self._second.get(who, (-1, 0))
        shown = shown if second == at // S else 0
        self._second[who] = at // S, shown + 1
        if shown >= LINES_A_SECOND:
            self._unshown[who] += 1
        elif self._tell is not None:
            self._tell(f"{clock(at)} {word:7} {who}: {line[:_LONGEST]}")

    def finish(self) -> list[str]:
        """Show how many lines were not shown; return a line for each component that logged any."""
        for who, count in self._unshown.items():
            if count and self._tell is not None:
                self._tell(f"{who}: {count} more warnings and errors; the report and --log-file have them")
        return [
            f"{who} logged {self._errors[who]} errors and {self._warnings[who]} warnings, "
            f"first: {first[:_LONGEST]}"
            for who, first in self._first.items()
        ]


class ProgressReporter:
    """Stream tap that reports the progress of a run periodically.

    Args:
        kernel: Clock of the run.
        limit: Latest end of the run, 0 for none.
        read: Returns the state of the vehicles.
        show: Receives the progress.
    """

    def __init__(self, kernel: Kernel, limit: Ns, read: ReadVehicles, show: Show) -> None:
        self._kernel = kernel
        self._limit = limit
        self._read = read
        self._show = show
        self._notes: dict[str, dict[str, str]] = {}
        kernel.every(PERIOD, self._report)

    def __call__(self, event: Event) -> None:
        """Keep the present state of what is noted."""
        if isinstance(event, Milestone):
            self._notes.setdefault(event.kind, {})[event.subject] = event.state

    def _report(self) -> None:
        notes = {kind: dict(Counter(states.values())) for kind, states in self._notes.items()}
        self._show(RunProgress(self._kernel.now(), self._limit, self._read(), notes))


@dataclass(frozen=True)
class Run:
    """One execution.

    Attributes:
        record: Contents of ``run.json``.
        folder: Run folder, or None if nothing was kept.
        error: The error that ended the run early, or None.
        left: Names of tasks that did not end when they were cancelled.
        problems: Files of the run folder that could not be written, in words.
        notes: Documents that were left out because an optional dependency is missing, in words.
        observables: Every observed quantity by its name, such as ``drone_1.energy``, in SI units. What was
            not observed is missing; quantities of single operations are there if a requirement bounds them.
    """

    record: RunRecord
    folder: Path | None = None
    error: VoleryError | None = None
    left: tuple[str, ...] = ()
    problems: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    observables: Mapping[str, float] = field(default_factory=dict)

    @property
    def completed(self) -> bool:
        """True if the run came to its regular end."""
        return self.record.outcome.status == "completed"

    @property
    def ok(self) -> bool:
        """True if the run completed, met every requirement and could be written."""
        return self.completed and self.record.outcome.requirements_met is not False and not self.problems

    def arrays(self, vehicle: str) -> dict[str, NDArray[Any]]:
        """Return the recorded states of a vehicle as numpy arrays by name; see ``vehicle_arrays``.

        Args:
            vehicle: Name of the vehicle in the model.
        """
        return vehicle_arrays(self.folder, vehicle)

    def to_pandas(self, vehicle: str) -> Any:
        """Return the recorded states of a vehicle as a ``pandas.DataFrame`` with the index ``time_s``.

        Args:
            vehicle: Name of the vehicle in the model.
        """
        return to_frame(self.arrays(vehicle), INDEX)


SAMPLING_PERIOD: Ns = 200 * MS
"""Period at which the state of every vehicle is recorded."""


FULL, TRACE, SUMMARY, NOTHING = "full", "trace", "summary", "none"
"""What is recorded of a run. ``NOTHING`` is stated by ``Options.out = None``."""


def check_record(record: str, levels: Collection[str], option: str = "record") -> None:
    """Raise ``UsageError`` unless *record* is one of *levels* or names topics: ``/scan,/camera/image``."""
    names = record.split(",")
    if record not in levels and not all(name.startswith("/") and name.strip("/ ") for name in names):
        what = f"there is {choices(levels)}, or names of topics as /camera/image_raw,/scan"
        raise UsageError(f"{option} {record}: {what}")


@dataclass(frozen=True)
class Options:
    """Options of a run.

    Attributes:
        fidelity: ``times`` (stated execution times), ``code`` (cost of the components' own code) or
            ``firmware`` (that of ``code``, and vehicles on programs of real firmware).
        seed: Seed of every random stream.
        pace: Simulated seconds per wall second, or None for as fast as possible.
        out: Run folder, or None to keep nothing.
        record: What the run folder gets: ``trace`` is everything but the content of messages with an array of
            4096 bytes and more (images, point clouds), ``/camera/image_raw,/scan`` also that of these topics,
            ``full`` that of all topics; ``summary`` is ``run.json`` alone, without trace and report. The
            figures of ``run.json`` are the same. Taps get the content of ``full`` and of topics without a
            folder, too.
        show: Receives the progress about once a simulated second.
        tell: Receives single lines that the user should read at once.
        graph: ``ros1`` or ``ros2`` to run the components as processes on that graph, at a pace of 1 unless
            ``pace`` is given; empty for the embedded graph.
        deployed: The components on ``graph`` are started by others, from packages of ``volery ros deploy``.
        log: File into which the run writes what happens, line by line, or None.
        if_killed: What the autopilot of a flight does by itself if this program is killed: ``return``,
            ``land`` or ``hover``; None leaves its parameters as they are.
        traces: Folder in which C++ components record the basic blocks that they enter, without being charged.
    """

    fidelity: str = "code"
    seed: int = 1
    pace: float | None = None
    out: Path | None = None
    record: str = TRACE
    show: Show | None = None
    tell: Tell | None = None
    graph: str = ""
    deployed: bool = False
    traces: Path | None = None
    log: LogOptions | None = None
    if_killed: LinkLossAction | None = None

    def __post_init__(self) -> None:
        check_record(self.record, (FULL, TRACE, SUMMARY))
        if self.if_killed is not None and self.if_killed not in LINK_LOSS_ACTIONS:
            hint = did_you_mean(self.if_killed, LINK_LOSS_ACTIONS)
            raise UsageError(f"no action {self.if_killed!r}{hint}; there is {choices(LINK_LOSS_ACTIONS)}")

    @property
    def folder(self) -> Path | None:
        """The run folder."""
        return None if self.out is None else Path(self.out)

    @property
    def traced(self) -> bool:
        """Whether the run writes a trace."""
        return self.out is not None and self.record != SUMMARY

    @property
    def record_topics(self) -> tuple[str, ...]:
        """The topics that ``record`` names."""
        return tuple(self.record.split(",")) if self.record.startswith("/") else ()


DEFAULT_OPTIONS = Options()
