"""What a feature of the simulated ArduPilot adds to its core, and the tables that a firmware makes of them.

A feature is one module that states what it adds as ``COPTER`` and ``ROVER``, for the kinds of vehicle that
have it. ``features.py`` lists the modules: tables are merged, and work is done at each tick, in that order.

```python
def say_position(vehicle: Vehicle, position: int) -> None:
    vehicle.send_text(INFO, f"switch at {position}")

COPTER = ROVER = Feature(switches={300: say_position})
```
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, NamedTuple, Protocol, TypeVar, cast

from volery.base.frames import Vector
from volery.base.time import MS, Ns
from volery.simulation.autopilots.flight_stack.flight import Setpoint
from volery.simulation.autopilots.manoeuvres.onboard_mission_flight import Leg
from volery.simulation.autopilots.mavlink.firmware import (
    Builder,
    HighLatency,
    MessageHandler,
    QuestionHandler,
)
from volery.simulation.autopilots.mavlink.messages import Command, Fields, Handler
from volery.simulation.autopilots.onboard_log import LogRow
from volery.simulation.autopilots.onboard_mission import MissionItem
from volery.simulation.autopilots.vehicle_state import (
    AutopilotVehicle,
    Mode,
    VehicleAction,
    do_nothing,
    height_above_home,
)

T = TypeVar("T")
TICK: Ns = 100 * MS
"""Period of the work of features."""


class Kept(Generic[T]):
    """State that one module keeps about each vehicle until its next boot; a call returns that of a vehicle.

    Args:
        create: Creates the state after a boot, when it is first asked for.
    """

    def __init__(self, create: Callable[[], T]) -> None:
        self._create = create

    def __call__(self, vehicle: AutopilotVehicle) -> T:
        """Return the state of a vehicle."""
        kept = vehicle.kept.get(self)
        if kept is None:
            kept = vehicle.kept[self] = self._create()
        return cast(T, kept)


Problems = Callable[[AutopilotVehicle], list[str]]
"""Returns the texts of checks that fail."""
Switch = Callable[[AutopilotVehicle, int], None]
"""What a switch does at a position: 1 up, 0 in the middle, -1 down."""
ItemAction = Callable[[AutopilotVehicle, MissionItem], None]
ParameterMeanings = Mapping[str, tuple[str, str]]
"""Unit, and what the parameter changes, by its name in version 4.5."""


class ArmingCheck(NamedTuple):
    """One arming check: its text, and whether it fails now."""

    text: str
    fails: Callable[[AutopilotVehicle], bool]


class MissionCommand(NamedTuple):
    """A command that is a mission item."""

    name: str
    """Its name in the firmware's status texts."""
    act: ItemAction | None = None
    """Executes an item that does not navigate."""
    leg: Callable[[AutopilotVehicle, MissionItem], Leg] | None = None
    """Returns the leg of an item that does."""
    silent: bool = False
    """Whether AP_Mission itself executes it: its end is not reported."""
    placed: bool = False
    """Whether its place is checked and its frame is stored."""
    keeps_frame: bool = False
    """Whether its frame is stored though its place is not checked; other items read back frame 0."""


def as_command(handler: Handler) -> ItemAction:
    """Return an action that executes an item as the command of its number."""

    def act(vehicle: AutopilotVehicle, item: MissionItem) -> None:
        params = item.param1, item.param2, item.param3, item.param4
        handler(vehicle, Command(item.command, *params, item.x / 1e7, item.y / 1e7, item.z, item.frame, True))

    return act


class LogForm(NamedTuple):
    """A type of message of the log on board: its number, name, format letters and columns."""

    number: int
    name: str
    letters: str
    columns: str


@dataclass(frozen=True, kw_only=True)
class Feature:
    """What one feature adds to the core, for one kind of vehicle."""

    parameters: ParameterMeanings = field(default_factory=dict)
    """Parameters that it reads; their types and defaults are those of the recorded table."""
    modes: tuple[Mode, ...] = ()
    mode_switches: Mapping[int, int] = field(default_factory=dict)
    """RCn_OPTION to the number of the mode that its switch enters."""
    entries: Mapping[int, Callable[[AutopilotVehicle, Mode], bool]] = field(default_factory=dict)
    """Number of a mode to what enters it, and returns whether it is flown."""
    avoiding: tuple[str, ...] = ()
    """Names of modes whose horizontal velocity avoidance limits."""
    tumbling: tuple[str, ...] = ()
    """Names of modes without a crash check."""
    commands: Mapping[int, Handler] = field(default_factory=dict)
    nan_commands: tuple[int, ...] = ()
    """Commands of which a NaN parameter means that it is not given."""
    messages: Mapping[str, MessageHandler] = field(default_factory=dict)
    """Messages that need no answer; what several features do with one is done in list order."""
    questions: Mapping[str, QuestionHandler] = field(default_factory=dict)
    """Messages that are answered."""
    items: Mapping[int, MissionCommand] = field(default_factory=dict)
    """Mission items by their command."""
    switches: Mapping[int, Switch] = field(default_factory=dict)
    """RCn_OPTION to what its switch does; DO_AUX_FUNCTION and buttons do the same."""
    at_once: tuple[int, ...] = ()
    """Those that count as soon as the transmitter is first read."""
    checks: tuple[ArmingCheck, ...] = ()
    """Arming checks, after those of the core."""
    problems: Problems | None = None
    """Arming checks whose texts have figures, after all ``checks``."""
    at_boot: VehicleAction | None = None
    """Called once in a boot, when the outputs are set up."""
    on_tick: VehicleAction | None = None
    """Work at each ``TICK``, after the manoeuvre and the switches, before automatic disarming."""
    limit: Callable[[AutopilotVehicle, Setpoint], Setpoint] | None = None
    """Return the set-point that a manoeuvre may give."""
    return_point: Callable[[AutopilotVehicle], Vector | None] | None = None
    """Return where a return ends, see ``VehicleRules``."""
    height_above_ground: Callable[[AutopilotVehicle], float] | None = None
    """Return the height that a landing goes by [m]."""
    telemetry: Mapping[str, Builder] = field(default_factory=dict)
    """Messages that are sent."""
    amends: Mapping[str, Callable[[AutopilotVehicle, Fields], Fields]] = field(default_factory=dict)
    """What is changed in messages of the core before they are sent."""
    extends: Mapping[str, Callable[[AutopilotVehicle], list[Fields]]] = field(default_factory=dict)
    """Further messages of a name that the core or another feature sends, after that."""
    high_latency: HighLatency | None = None
    """Links that carry HIGH_LATENCY2."""
    log_forms: tuple[LogForm, ...] = ()
    log_rows: Callable[[AutopilotVehicle], tuple[LogRow, ...]] | None = None
    """Return what the log on board has beside the samples of every firmware."""


class ArmingProblems(Protocol):
    """Returns the texts of all checks that forbid arming now."""

    def __call__(self, vehicle: AutopilotVehicle, *, by_rudder: bool = False) -> list[str]:
        """Return them; *by_rudder*: for arming with the yaw stick, which then is not checked."""


class FeatureSet:
    """One firmware: the tables of its core and of its features, merged in their order.

    Args:
        features: What the core adds by itself, then the features in list order.
        arming_problems: Returns the texts that forbid arming.
        words: Status texts of arming and disarming.
    """

    def __init__(
        self, features: Sequence[Feature], arming_problems: ArmingProblems, words: tuple[str, str]
    ) -> None:
        self.features = features
        self.arming_problems = arming_problems
        self.words = words
        self.parameters = merged([feature.parameters for feature in features])
        self.modes = {mode.number: mode for feature in features for mode in feature.modes}
        self.mode_switches = merged([feature.mode_switches for feature in features])
        self.entries = merged([feature.entries for feature in features])
        self.avoiding = frozenset(name for feature in features for name in feature.avoiding)
        self.tumbling = frozenset(name for feature in features for name in feature.tumbling)
        self.commands = merged([feature.commands for feature in features])
        self.nan_commands = frozenset(number for feature in features for number in feature.nan_commands)
        self.messages = {name: self._handler(name) for feature in features for name in feature.messages}
        self.questions = merged([feature.questions for feature in features])
        self.items = merged([feature.items for feature in features])
        self.switches = merged([feature.switches for feature in features])
        self.at_once = frozenset(option for feature in features for option in feature.at_once)
        self.checks = [check for feature in features for check in feature.checks]
        self.problems = [feature.problems for feature in features if feature.problems is not None]
        self.boots = [feature.at_boot for feature in features if feature.at_boot is not None]
        self.ticks = [feature.on_tick for feature in features if feature.on_tick is not None]
        self.limits = [feature.limit for feature in features if feature.limit is not None]
        self.high_latency = next((feature.high_latency for feature in features if feature.high_latency), None)
        self.return_point = next(
            (feature.return_point for feature in features if feature.return_point), do_nothing
        )
        self.height_above_ground = next(
            (feature.height_above_ground for feature in features if feature.height_above_ground),
            height_above_home,
        )
        self.log_forms = [form for feature in features for form in feature.log_forms]
        self.logs = [feature.log_rows for feature in features if feature.log_rows is not None]
        self.telemetry = {
            name: self._builder(name, build)
            for feature in features
            for name, build in feature.telemetry.items()
        }

    def _handler(self, name: str) -> MessageHandler:
        """Return what handles a message: all features that know it, in their order."""
        handlers = [feature.messages[name] for feature in self.features if name in feature.messages]

        def handle(vehicle: AutopilotVehicle, fields: dict[str, Any], sender: int) -> None:
            for handler in handlers:
                handler(vehicle, fields, sender)

        return handlers[0] if len(handlers) == 1 else handle

    def _builder(self, name: str, build: Builder) -> Builder:
        """Return the builder of a message with what the features change in it and add to it."""
        amends = [feature.amends[name] for feature in self.features if name in feature.amends]
        extends = [feature.extends[name] for feature in self.features if name in feature.extends]

        def amended(vehicle: AutopilotVehicle) -> list[Fields]:
            built = build(vehicle)
            found = built if isinstance(built, list) else [] if built is None else [built]
            for amend in amends:
                found = [amend(vehicle, fields) for fields in found]
            return [*found, *(fields for extend in extends for fields in extend(vehicle))]

        return amended if amends or extends else build

    def limit(self, vehicle: AutopilotVehicle, setpoint: Setpoint) -> Setpoint:
        """Return the set-point that is given."""
        for limit in self.limits:
            setpoint = limit(vehicle, setpoint)
        return setpoint

    def log_rows(self, vehicle: AutopilotVehicle) -> tuple[LogRow, ...]:
        """Return what the log has beside the samples of every firmware."""
        return tuple(row for rows in self.logs for row in rows(vehicle))


def build_of(vehicle: AutopilotVehicle) -> FeatureSet:
    """Return the firmware of a vehicle as it was built."""
    return cast(FeatureSet, vehicle.firmware_state)


def merged(tables: Sequence[Mapping[Any, T]]) -> dict[Any, T]:
    """Return one table of several, later entries in place of earlier ones."""
    return {key: value for table in tables for key, value in table.items()}
