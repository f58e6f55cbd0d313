"""The library of a model: interfaces, and kinds of components with their ports and what they take.

Frozen data. Every class declares how it is written in a model; what follows from other parts of the model
(the processor that times are stated for, interfaces) is resolved while it is read.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path as FilePath
from typing import Annotated

from volery.base.errors import Location
from volery.base.time import Ns
from volery.model import rules
from volery.model.data_types import check_type
from volery.model.fields import (
    ANYTHING,
    DATA_SIZE,
    ENERGY,
    FREQUENCY,
    PERIOD,
    PROCESSOR_KIND,
    SHARE,
    TEXT,
    TIME,
    Key,
    ListOf,
    MapOf,
    OneOf,
    Record,
    Schema,
    Shared,
    Shorter,
    Syntax,
    Whole,
    WrongValueError,
    expected,
)
from volery.model.reading import PROVENANCES, ModelReading
from volery.model.text import Path, TextNode, is_inside, outside, stated_texts

Value = bool | int | float | str | None | Sequence["Value"] | Mapping[str, "Value"]
"""A parameter: what YAML can state. A number with a unit (``6 / h``) arrives as an SI number."""

VEHICLE_INTERFACES: Mapping[str, str] = {"Drone": "multirotor", "Rover": "rover"}
"""Interfaces that vehicles provide, and the kind of vehicle that does. Commands go over the ROS graph."""

ENVIRONMENT_INTERFACE = "Environment"
"""The interface whose port gives a component the ``Environment``: places, roads, zones, workload."""

SPECIAL_INTERFACES = (*VEHICLE_INTERFACES, ENVIRONMENT_INTERFACE)
"""Interfaces that exist in every model."""

LANGUAGES = ("python", "rospy", "rclpy", "c++", "roscpp", "rclcpp")
"""Languages of components."""

CPP_LANGUAGES = ("c++", "roscpp", "rclcpp")
"""Languages that are compiled."""

ROS_LANGUAGES = ("rospy", "rclpy", "roscpp", "rclcpp")
"""Languages whose components are ROS nodes."""

QUEUE_POLICIES = ("discard", "remove-first", "remove-last", "flush")
"""What a full queue does: refuse the new call, drop the oldest or the newest one that waits, or drop all."""

ROS_CALLS = ("publish", "sleep", "spin_once", "call_service")
"""Calls into ROS that ``calls`` may state by their bare names."""

LIBRARY: Path = ("components",)
_MANY = "[]"


# -- interfaces


@dataclass(frozen=True, slots=True)
class Argument:
    """An argument of an operation. ``type`` is text for people and generators: ``str``, ``Position[]``."""

    name: str
    type: str


class _Arguments(Syntax):
    """Names of arguments with their types."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> tuple[Argument, ...]:
        """See ``Syntax``."""
        types = MapOf(TEXT).read(node, path, reading)
        assert isinstance(types, dict)
        for name, type_ in types.items():
            check_type(reading, (*path, name), type_)
        return tuple(Argument(name, type_) for name, type_ in types.items())

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return MapOf(TEXT).schema(definitions)


@dataclass(frozen=True, slots=True)
class Signature:
    """An operation of an interface. ``returns`` is empty where it returns nothing."""

    name: str
    arguments: Annotated[
        tuple[Argument, ...], Key("args"), _Arguments(), "Arguments by name, and their types."
    ] = ()
    returns: Annotated[str, TEXT, "Type of the result; nothing is returned if it is not given."] = ""


OPERATIONS = Shorter(MapOf(Shorter(Record(Signature), empty=True)), empty=True)


@dataclass(frozen=True, slots=True)
class Interface:
    """A named set of operations. Without operations it stands for publish and subscribe, which needs ROS."""

    name: str
    operations: Mapping[str, Signature] = field(default_factory=dict)
    where: Location | None = field(default=None, compare=False)

    @property
    def is_publish_subscribe(self) -> bool:
        """True if ports of it are not connected: their component publishes and subscribes to topics."""
        return not self.operations


class _Interface(Syntax):
    """An interface: its operations by name."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> Interface:
        """See ``Syntax``."""
        name = str(path[-1])
        if name in SPECIAL_INTERFACES:
            reading.problems.add(
                path, f"{name} is there in every model; choose another name", rule=rules.DUPLICATE_NAME
            )
        return Interface(name, OPERATIONS.read(node, path, reading), node.where)

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return OPERATIONS.schema(definitions)


INTERFACES = MapOf(_Interface())


def _operations_of(interface: str, reading: ModelReading) -> list[str]:
    return reading.names(("interfaces", interface))


# -- what computing takes


@dataclass(frozen=True, slots=True)
class StatedAt:
    """The processor of the catalogue and the frequency that a figure was stated at."""

    processor: Annotated[str, PROCESSOR_KIND, "Kind of processor."]
    frequency_hz: Annotated[float, FREQUENCY, "Frequency of the processor."]


class _Reference(Record):
    """A reference whose frequency is within the catalogue's range."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> StatedAt:
        """See ``Syntax``."""
        made: StatedAt = super().read(node, path, reading)
        check_frequency(reading, path, made.processor, made.frequency_hz)
        return made


REFERENCE = _Reference(StatedAt)


def check_frequency(reading: ModelReading, path: Path, kind: str, frequency_hz: float) -> None:
    """Report it if *frequency_hz*, stated in the mapping at *path*, is outside the range of the processor."""
    known = reading.vocabulary.processors.get(kind)
    if known is not None and not known.least_hz <= frequency_hz <= known.greatest_hz:
        reading.problems.add(
            (*path, "frequency"),
            f"{frequency_hz / 1e6:g} MHz is outside what is known of {kind}: "
            f"{known.least_hz / 1e6:g} to {known.greatest_hz / 1e6:g} MHz",
            rule=rules.FREQUENCY_RANGE,
        )


@dataclass(frozen=True, slots=True)
class StatedFigure:
    """What an operation or an activation takes, stated at a processor of the catalogue and a frequency.

    ``energy_j`` is None where the model states none. A law scales it to other frequencies of the processor.
    """

    time_ns: Annotated[Ns, TIME, "Execution time."]
    at: Annotated[StatedAt, REFERENCE, "Where it was taken; that of the component if it is not given."]
    energy_j: Annotated[float | None, ENERGY, "Energy; by the processor's law if it is not given."] = None
    provenance: Annotated[str, OneOf(PROVENANCES), "Where the figure comes from."] = "estimated"
    best_ns: Annotated[Ns | None, TIME, "Shortest time; `time`, the mean, if it is not given."] = None
    worst_ns: Annotated[
        Ns | None, TIME, "Longest time, for static analysis; `time`, the mean, if it is not given."
    ] = None
    uncertainty: Annotated[float | None, SHARE, "Relative standard uncertainty of the time."] = None
    where: Location | None = field(default=None, compare=False)

    @property
    def longest_ns(self) -> Ns:
        """The time that static analysis counts."""
        return self.time_ns if self.worst_ns is None else self.worst_ns

    @property
    def processor(self) -> str:
        """The kind of processor that it was stated for."""
        return self.at.processor

    @property
    def frequency_hz(self) -> float:
        """The frequency that it was stated at."""
        return self.at.frequency_hz


def _with_reference(node: TextNode, path: Path, reading: ModelReading) -> TextNode:
    """Add the component's reference to a figure without one of its own."""
    if "at" in node.items:
        return node
    default = reading.root.at((*path[:2], "at"))
    if default is None:
        what = "a time means nothing without where it was taken: add `at: {processor: ..., frequency: ...}`"
        reading.problems.add(path, what, rule=rules.NO_REFERENCE)
        raise WrongValueError("")
    reading.problems.copied((*path, "at"), (*path[:2], "at"))
    return replace(node, value={**node.items, "at": default})


class _Figure(Record):
    """A figure whose times are in order."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> StatedFigure:
        """See ``Syntax``."""
        made: StatedFigure = super().read(node, path, reading)
        best = made.time_ns if made.best_ns is None else made.best_ns
        if not best <= made.time_ns <= made.longest_ns:
            what = "its times are out of order: best is at most time, and time at most worst"
            reading.problems.add(path, what, rule=rules.TIME_ORDER)
        return made


FIGURES = ListOf(_Figure(StatedFigure, prepare=_with_reference, supplied=("at",)), bare=True)


@dataclass(frozen=True, slots=True)
class Activity:
    """An active component's flow of control. Releases are checked against its period.

    ``deadline_ns`` counts from each release; ``start_ns`` delays the first one.
    """

    period_ns: Annotated[Ns | None, PERIOD, "Time between releases."] = None
    deadline_ns: Annotated[Ns | None, PERIOD, "Time from a release to its end; by default, the period."] = (
        None
    )
    priority: Annotated[int, Whole(), "Priority; a greater number is more urgent."] = 0
    start_ns: Annotated[Ns, TIME, "Delay of the first release."] = 0
    jitter_ns: Annotated[Ns, TIME, "Most that a release comes after it is due."] = 0


def _with_deadline(node: TextNode, path: Path, reading: ModelReading) -> TextNode:
    """Make the period the deadline where none is stated."""
    if "period" in node.items and "deadline" not in node.items:
        reading.problems.copied((*path, "deadline"), (*path, "period"))
        return replace(node, value={**node.items, "deadline": node.items["period"]})
    return node


ACTIVITY = Shorter(Record(Activity, prepare=_with_deadline), switch=True)


@dataclass(frozen=True, slots=True)
class Assumptions:
    """What static analysis takes for granted of a component, and no run is changed by.

    A flow of control without a period is released on demand: ``period_ns`` or ``pause_ns`` limit how often.
    """

    period_ns: Annotated[Ns | None, PERIOD, "Least time between two releases."] = None
    pause_ns: Annotated[
        Ns | None, PERIOD, "Least time from the end of an activation to the next release."
    ] = None
    beside: Annotated[
        tuple[StatedFigure, ...],
        FIGURES,
        "What an activation executes at most beside its stated time: the driver of a vehicle, or what its "
        "code charges by `volery.add_time`. `best` is what it executes at least when it does its work.",
    ] = ()
    waits_ns: Annotated[
        Ns | None, TIME, "Most that an activation waits for answers of vehicles and of other computers."
    ] = None


# -- topics and calls


@dataclass(frozen=True, slots=True)
class PublishedTopic:
    """A topic that a component publishes, by its name before remapping."""

    name: str
    type: Annotated[str, TEXT, "Message type, such as `sensor_msgs/Image`."]
    on: Annotated[
        str, TEXT, "The subscribed topic in whose callback it is published; by default, in an activation."
    ] = ""
    count: Annotated[int, Whole(least=1), "Messages in one activation or callback, at most."] = 1
    size_b: Annotated[float | None, DATA_SIZE, "Greatest size of a message."] = None


@dataclass(frozen=True, slots=True)
class SubscriptionSpec:
    """A topic that a component subscribes to, by its name before remapping."""

    name: str
    type: Annotated[str, TEXT, "Message type, such as `sensor_msgs/Image`; its callback is an activation."]


@dataclass(frozen=True, slots=True)
class QueueSpec:
    """What a port does with calls that wait (S3D's ClientServerQueuePort)."""

    size: Annotated[int | None, Whole(least=1), "Calls that may wait; any number if it is not given."] = None
    full: Annotated[str, OneOf(QUEUE_POLICIES), "What happens to a call when the queue is full."] = "discard"
    timeout_ns: Annotated[Ns | None, PERIOD, "Time after which a call fails; never if it is not given."] = (
        None
    )
    retries: Annotated[int, Whole(least=0), "How often a failed call is repeated."] = 0


class _Queues(Syntax):
    """Queues by the names of the component's ports."""

    below = MapOf(Record(QueueSpec))

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> dict[str, QueueSpec]:
        """See ``Syntax``."""
        made = self.below.read(node, path, reading)
        assert isinstance(made, dict)
        ports = reading.names((*path[:-1], "provides"), (*path[:-1], "requires"))
        return {
            name: queue for name, queue in made.items() if reading.known((*path, name), name, "port", ports)
        }

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return self.below.schema(definitions)


CALLS = MapOf(MapOf(Whole(least=0), free=True))
ACTIVATION = "activation"
"""What ``calls`` are stated for, beside operations."""


# -- components


@dataclass(frozen=True, slots=True)
class RequiredPort:
    """What a component needs: one provider of an interface, or any number (``many``: a list is injected)."""

    name: str
    interface: str
    many: bool = False


class _RequiredPort(Syntax):
    """The name of an interface; ``Name[]`` for any number of providers."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> RequiredPort:
        """See ``Syntax``."""
        if not isinstance(node.value, str):
            raise expected("text", node)
        interface, port = node.value.removesuffix(_MANY).strip(), str(path[-1])
        reading.known(path, interface, "interface", [*reading.names(("interfaces",)), *SPECIAL_INTERFACES])
        if port in INSTANCE_KEYS:
            what = f"a required port cannot be called {port!r}: instances have a key of that name"
            reading.problems.add(path, what, rule=rules.DUPLICATE_NAME)
        return RequiredPort(port, interface, node.value.endswith(_MANY))

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return {"type": "string"}


INSTANCE_KEYS = ("is", "component", "parameters", "arguments", "active", "namespace", "node_name", "remap")
"""Keys of an instance. Every other key of an instance is a required port."""


class _ProvidedPort(Syntax):
    """The name of an interface of the model."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> str:
        """See ``Syntax``."""
        if not isinstance(node.value, str):
            raise expected("text", node)
        interface = node.value
        if interface in SPECIAL_INTERFACES:
            provider = "the environment" if interface == ENVIRONMENT_INTERFACE else "a vehicle"
            what = f"{interface} is provided by {provider}, not by a component"
            reading.problems.add(path, what, rule=rules.INTERFACE_MISMATCH)
        else:
            reading.known(path, interface, "interface", reading.names(("interfaces",)))
        return interface

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return {"type": "string"}


def check_inside(reading: ModelReading, path: Path, name: str) -> None:
    """Report a file outside the model's folder and the folders of ``files_from``."""
    allowed = [reading.folder, *(reading.folder / text for text in stated_texts(reading.root, "files_from"))]
    if not is_inside(reading.folder / name, allowed):
        reading.problems.add(path, outside(name), rule=rules.OUTSIDE)


class FileBeside(Syntax):
    """A file beside the model, which has to be there."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> FilePath:
        """See ``Syntax``."""
        if not isinstance(node.value, str):
            raise expected("text", node)
        check_inside(reading, path, node.value)
        file = reading.folder / node.value
        if not file.is_file():
            what = f"there is no file {node.value!r} beside the model"
            raise WrongValueError(what, rules.MISSING_FILE)
        return file

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return {"type": "string"}


class _File(Syntax):
    """A file beside the model; a folder, too, for C++."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> str:
        """See ``Syntax``."""
        if not isinstance(node.value, str):
            raise expected("text", node)
        check_inside(reading, path, node.value)
        file = reading.folder / node.value
        language = reading.root.at((*path[:-1], "language"))
        folder = language is not None and language.value in CPP_LANGUAGES and file.is_dir()
        if node.value and not file.is_file() and not folder:
            there = sorted(found.name for found in file.parent.glob("*") if found.is_file())
            beside = f"; in that folder there is {', '.join(there[:8])}" if there else ""
            what = f"there is no file {node.value!r} beside the model{beside}"
            reading.problems.warn(path, what, rules.UNWRITTEN_CODE)
        return node.value

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return {"type": "string"}


@dataclass(frozen=True, slots=True)
class CompilerOptions:
    """How C++ is compiled."""

    flags: Annotated[tuple[str, ...], ListOf(TEXT, bare=True), "Options for the compiler."] = ()
    libraries: Annotated[
        tuple[str, ...], ListOf(TEXT, bare=True), "Libraries, by the names that follow `-l`."
    ] = ()


STOP, RESTART, END_RUN = "stop", "restart", "end_run"


@dataclass(frozen=True, slots=True)
class OnFailure:
    """What follows when a component fails. Without ``most``, it is started again each time."""

    action: Annotated[
        str,
        OneOf((STOP, RESTART, END_RUN)),
        "`stop`: it is stopped and the run goes on; `restart`: it is started again; `end_run`: the run ends.",
    ] = STOP
    most: Annotated[
        int | None, Key("max"), Whole(least=1), "Starts again at most; any number if it is not given."
    ] = None
    delay_ns: Annotated[Ns, TIME, "Time until it is started again."] = 0


ON_FAILURE = Shorter(Record(OnFailure), key="action")


@dataclass(frozen=True, slots=True)
class Component:
    """A kind of component: its language and file, its ports, and what it takes in fidelity `times`.

    ``path`` is relative to the model's folder (``System.file_of`` resolves it) and empty where there is no
    code yet. ``activity`` is None for a passive component. ``operations`` and ``activation`` hold the figures
    of fidelity ``times``, one per processor kind.
    """

    name: str
    language: Annotated[str, OneOf(LANGUAGES), "Language, with its ROS client library."]
    path: Annotated[str, _File(), "File with its code, relative to the model; of C++, maybe a folder."] = ""
    stated_class: Annotated[
        str, Key("class"), TEXT, "Class in the file; by default, the name of the component in camel case."
    ] = ""
    package: Annotated[
        str, TEXT, "ROS package of its program, in place of `path`: beside the model, or sourced."
    ] = ""
    executable: Annotated[
        str,
        TEXT,
        "Program of the `package`, as `ros2 run` and `rosrun` name it; of C++ by `CMakeLists.txt`.",
    ] = ""
    main: Annotated[
        str,
        TEXT,
        "Function of a script that is called after the file was executed; by default, that of an entry point "
        "of its package.",
    ] = ""
    arguments: Annotated[
        tuple[str, ...],
        ListOf(TEXT, bare=True),
        "Command-line arguments of a script; those of ROS (`a:=b`, `--ros-args`) among them.",
    ] = ()
    on_failure: Annotated[OnFailure, ON_FAILURE, "What follows when it fails."] = OnFailure()
    build: Annotated[CompilerOptions, Record(CompilerOptions), "How C++ is compiled."] = CompilerOptions()
    files: Annotated[
        Mapping[str, str],
        MapOf(TEXT, free=True),
        "Files of the same component in other languages, by language; a scenario selects one by setting "
        "`language` and `path`.",
    ] = field(default_factory=dict)
    provides: Annotated[
        Mapping[str, str], MapOf(_ProvidedPort()), "Provided ports, and the interface of each."
    ] = field(default_factory=dict)
    requires: Annotated[
        Mapping[str, RequiredPort],
        MapOf(_RequiredPort()),
        "Required ports, and the interface of each; `Name[]` for any number of providers.",
    ] = field(default_factory=dict)
    parameters: Annotated[
        Mapping[str, Value], MapOf(ANYTHING, free=True), "Parameters, and their defaults."
    ] = field(default_factory=dict)
    activity: Annotated[
        Activity | None,
        Key("active"),
        ACTIVITY,
        "Its own flow of control; `true` for one without a period. Passive if it is not given.",
    ] = None
    at: Annotated[StatedAt | None, REFERENCE, "Where its figures were taken that do not state it."] = None
    operations: Annotated[
        Mapping[str, tuple[StatedFigure, ...]],
        MapOf(FIGURES),
        "What each operation of its provided ports takes, one figure for each kind of processor.",
    ] = field(default_factory=dict)
    activation: Annotated[
        tuple[StatedFigure, ...], FIGURES, "What an activation takes, one figure for each kind of processor."
    ] = ()
    queues: Annotated[
        Mapping[str, QueueSpec], _Queues(), "What a port does with calls that wait, by port."
    ] = field(default_factory=dict)
    calls: Annotated[
        Mapping[str, Mapping[str, int]],
        CALLS,
        "Most calls of an `activation` or of an operation: `<required port>.<operation>`, or a ROS call such "
        "as `publish`, and how many. Static analysis needs it.",
    ] = field(default_factory=dict)
    publishes: Annotated[
        Mapping[str, PublishedTopic], MapOf(Record(PublishedTopic), free=True), "Topics that it publishes."
    ] = field(default_factory=dict)
    subscribes: Annotated[
        Mapping[str, SubscriptionSpec],
        MapOf(Record(SubscriptionSpec), free=True),
        "Topics that it subscribes to.",
    ] = field(default_factory=dict)
    memory_b: Annotated[float | None, DATA_SIZE, "Greatest memory of its process that it takes."] = None
    assume: Annotated[
        Assumptions, Record(Assumptions), "What static analysis takes for granted; no run is changed by it."
    ] = Assumptions()
    where: Location | None = field(default=None, compare=False)

    @property
    def class_name(self) -> str:
        """The class that its file is expected to define: ``drone_control`` gives ``DroneControl``."""
        parts = re.split(r"[_-]+", self.name)
        return self.stated_class or "".join(part[:1].upper() + part[1:] for part in parts)


class _Component(Record):
    """A component whose figures are of operations that it provides."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> Component:
        """See ``Syntax``."""
        made: Component = super().read(node, path, reading)
        offered = [name for provide in made.provides.values() for name in _operations_of(provide, reading)]
        for operation in made.operations:
            at = (*path, "operations", operation)
            reading.known(at, operation, "operation of its provided ports", offered)
        for caller, calls in made.calls.items():
            at = (*path, "calls", caller)
            reading.known(at, caller, "operation of its provided ports", [ACTIVATION, *offered])
            for call in calls:
                _check_call((*at, call), call, made, reading)
        for publication in made.publishes.values():
            if publication.on:
                at = (*path, "publishes", publication.name, "on")
                reading.known(at, publication.on, "subscribed topic", made.subscribes)
        return made


def _check_call(path: Path, call: str, component: Component, reading: ModelReading) -> None:
    """Report a call that is neither of a required port nor a ROS call."""
    port, dot, operation = call.partition(".")
    if not dot:
        reading.known(path, call, "call", ROS_CALLS)
    elif reading.known(path, port, "required port", component.requires):
        offered = _operations_of(component.requires[port].interface, reading)
        reading.known(path, operation, "operation of that port", offered)


def library(reading: ModelReading) -> dict[str, Component]:
    """Return the components of the model. Use with ``ModelReading.once``."""
    node = reading.root.at(LIBRARY)
    if node is None or not isinstance(node.value, dict):
        return {}
    made = _ALL.read(node, LIBRARY, reading)
    assert isinstance(made, dict)
    return made


_ALL = MapOf(_Component(Component))
COMPONENTS = Shared(_ALL, library)
