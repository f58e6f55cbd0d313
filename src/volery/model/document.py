"""The text form of interfaces, components and their instances.

The text form of the environment. A world file holds the part of it that is geography.

The text form of a model, key by key: what may stand where. References are resolved elsewhere.

These classes are the source of the JSON Schema, so their docstrings are written for those who write models.

The JSON Schema of a model's text: for editors, for messages, and to know which paths there can be.

From a tree to its form, with pydantic's complaints put into the words of a model.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Annotated, Any, Literal, TypeVar

from pydantic import ConfigDict, Field, ValidationError
from pydantic_core import ErrorDetails

from volery.base.errors import choices, did_you_mean
from volery.model.fields import (
    SHORT,
    Bandwidth,
    Charge,
    Distance,
    Energy,
    Form,
    Frequency,
    Heading,
    Latitude,
    Length,
    Listed,
    Load,
    Longitude,
    Loss,
    Name,
    OrNothing,
    Parameters,
    Period,
    Provenance,
    Rate,
    Share,
    Short,
    Speed,
    Switch,
    Time,
    Voltage,
)
from volery.model.text import Node, Path, Problems

Language = Literal["python", "rospy", "rclpy", "c++", "roscpp", "rclcpp"]


class SignatureForm(Form):
    """An operation: its arguments by name with their types, and what it returns."""

    args: dict[Name, str] = {}
    returns: str = ""


class ReferenceForm(Form):
    """The processor of the catalogue and the frequency that a figure was stated at."""

    processor: str
    frequency: Frequency


class FigureForm(Form):
    """What an operation takes; scaled to other frequencies of the same processor, not to another."""

    time: Time
    energy: Energy | None = None
    at: ReferenceForm | None = None
    provenance: Provenance = "estimated"


class ActivityForm(Form):
    """An active component's own flow of control. A greater priority is more urgent."""

    period: Period | None = None
    deadline: Period | None = None
    priority: int = 0
    start: Time = 0


class BuildForm(Form):
    """How C++ is compiled: options for the compiler, and libraries by the names that follow `-l`."""

    flags: Annotated[list[str], Listed()] = []
    libraries: Annotated[list[str], Listed()] = []


class ComponentForm(Form):
    """A kind of component: its language and file, its ports, and what it takes in fidelity `times`."""

    language: Language
    path: str = ""
    class_name: str = Field(default="", alias="class")
    build: BuildForm = BuildForm()
    provides: dict[Name, str] = {}
    requires: dict[Name, str] = {}
    parameters: Parameters = {}
    active: Annotated[ActivityForm | None, Switch()] = None
    at: ReferenceForm | None = None
    operations: dict[Name, Annotated[list[FigureForm], Listed()]] = {}
    activation: Annotated[list[FigureForm], Listed()] = []


Targets = Annotated[list[str], Listed()]


class InstanceForm(Form):
    """A component that exists. Every other key is a required port: `routes: planner.paths`."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Targets]

    component: str = Field(alias="is")
    parameters: Parameters = {}
    active: Annotated[ActivityForm | None, Switch()] = None
    namespace: str = "/"
    remap: dict[str, str] = {}

    @property
    def ports(self) -> dict[str, list[str]]:
        """Required ports and the texts of what they are connected to."""
        return dict(self.__pydantic_extra__)


class OriginForm(Form):
    """Where the local frame has its origin, and how high the ground is there: WGS-84 degrees, metres AMSL."""

    latitude: Latitude
    longitude: Longitude
    amsl: Length = 0.0


class PointForm(Form):
    """A point on the ground: the name of a place, metres from the origin, or degrees."""

    place: str | None = None
    east: Length | None = None
    north: Length | None = None
    latitude: Latitude | None = None
    longitude: Longitude | None = None


class PlaceForm(PointForm):
    """A named point. `role` is free text that components may choose places by."""

    role: str = ""


Point = Annotated[PointForm, Short("place")]


class WaysForm(Form):
    """A graph of roads or air corridors: each way is a list of places and junctions, joined one after
    another.
    """

    height: Distance = 0.0
    junctions: dict[Name, PointForm] = {}
    ways: list[list[str]] = []


class PrismForm(Form):
    """An upright volume: over a polygon of corners, or over a circle."""

    corners: list[Point] = []
    centre: Point | None = None
    radius: Distance | None = None
    floor: Distance = 0.0
    ceiling: Distance | None = None


class WindForm(Form):
    """`direction`: where it blows from, clockwise from north. `gusts`: standard deviation of the speed."""

    speed: Speed = 0.0
    direction: Heading = 0.0
    gusts: Speed = 0.0


class BatteryForm(Form):
    """`charge` is the share that it starts with."""

    capacity: Charge
    charge: Share = 1.0
    voltage: Voltage | None = None


class VehicleForm(Form):
    """A drone or a rover with its autopilot. `parameters` are the autopilot's own."""

    kind: Literal["multirotor", "rover"]
    autopilot: str
    at: Point
    heading: Heading = 0.0
    battery: Annotated[BatteryForm | None, Short("capacity")] = None
    sensors: Literal["consumer", "rtk"] = "consumer"
    started: Literal["warm", "cold"] = "warm"
    parameters: dict[str, Annotated[float, Field(strict=False)]] = {}


class OrdersForm(Form):
    """Orders a second on average, how many in all, and the random stream they are drawn from."""

    rate: Rate = 0.0
    count: int | None = Field(default=None, ge=0)
    first: Time = 0
    seed: str = "workload"


class WorkloadForm(Form):
    """What is asked of the system."""

    requesters: int = Field(default=1, ge=0)
    orders: OrdersForm = OrdersForm()


class FaultForm(Form):
    """Something that breaks, and for how long (for good, if `duration` is not given)."""

    kind: str
    vehicle: str
    at: Time
    duration: Time | None = None


class WorldForm(Form):
    """The geography: what a world file holds."""

    origin: OriginForm = OriginForm(latitude=0.0, longitude=0.0)
    terrain: Literal["flat"] = "flat"
    places: dict[Name, PlaceForm] = {}
    roads: WaysForm = WaysForm()
    corridors: WaysForm = WaysForm()
    no_fly_zones: dict[Name, PrismForm] = {}
    buildings: dict[Name, PrismForm] = {}


class EnvironmentForm(WorldForm):
    """What surrounds the system. `components` are instances that cost nothing, such as requesters."""

    world: str = ""
    wind: Annotated[WindForm, Short("speed")] = WindForm()
    vehicles: dict[Name, VehicleForm] = {}
    components: dict[Name, InstanceForm] = {}
    workload: WorkloadForm = WorkloadForm()
    faults: dict[Name, FaultForm] = {}


class ProcessorForm(Form):
    """A computer of a kind in the catalogue.

    `context_switch` is what it takes to put another task on a core. `load` is the share of each core that
    something else takes, before all components: `20 %`.
    """

    kind: str = Field(alias="is")
    frequency: Frequency
    cores: int | None = Field(default=None, ge=1)
    scheduler: Literal["fixed-priority", "round-robin", "fifo"] = "fixed-priority"
    quantum: Period | None = None
    context_switch: Time = 0
    load: Load = 0.0
    carried_by: str | None = None
    powered_by: str | None = None


class NetworkForm(Form):
    """Joins processors."""

    between: list[str] = Field(min_length=2)
    bandwidth: Bandwidth
    latency: Time = 0
    loss: Loss = 0.0


class PlatformForm(Form):
    """The computers and what joins them.

    `catalogues` are files with kinds of processors beside those that volery knows, such as `volery calibrate`
    writes, relative to the model.
    """

    catalogues: Annotated[list[str], Listed()] = []
    processors: dict[Name, ProcessorForm] = {}
    networks: dict[Name, NetworkForm] = {}


class AllocationForm(Form):
    """Which instance runs on which processor. A vehicle's name says where the node runs that serves it."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, str]

    extends: str | None = None
    set: dict[str, Any] = {}

    @property
    def places(self) -> dict[str, str]:
        """Instances and vehicles, and their processors."""
        return dict(self.__pydantic_extra__)


class BoundForm(Form):
    """A bound on an observed quantity: exactly one of `max` and `min`, with its unit."""

    observe: str
    max: str | int | float | None = Field(default=None, union_mode="left_to_right")
    min: str | int | float | None = Field(default=None, union_mode="left_to_right")
    description: str = ""


class RunForm(Form):
    """How long a run lasts: at most `duration`, and no longer than until a bound holds."""

    duration: Period = 900_000_000_000
    until: BoundForm | None = None


class ScenarioForm(Form):
    """Changes to the model for some runs: `set` has paths and values, later ones win."""

    extends: str | None = None
    description: str = ""
    allocation: str | None = None
    set: dict[str, Any] = {}
    duration: Period | None = None
    until: BoundForm | None = None


class ModelForm(Form):
    """A system model.

    `chains` are rows of topics by their full names, `[/drone_1/mavros/state, ...]`, whose end-to-end latency
    can be observed: `observe: NAME.latency`.
    """

    volery: Literal[1]
    name: str
    description: str = ""
    interfaces: dict[Name, Annotated[dict[Name, Annotated[SignatureForm, OrNothing()]], OrNothing()]] = {}
    components: dict[Name, ComponentForm] = {}
    application: dict[Name, InstanceForm] = {}
    platform: PlatformForm = PlatformForm()
    allocations: dict[Name, AllocationForm] = {}
    environment: EnvironmentForm = EnvironmentForm()
    scenarios: dict[Name, ScenarioForm] = {}
    chains: dict[Name, Annotated[list[str], Field(min_length=1)]] = {}
    requirements: dict[Name, BoundForm] = {}
    run: RunForm = RunForm()


Schema = dict[str, Any]


@cache
def schema() -> Schema:
    """The schema of a whole model (draft 2020-12). An editor that is given it completes and checks keys."""
    made = ModelForm.model_json_schema(by_alias=True)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **_tidy(made),
        "title": "volery system model",
    }


def keys_at(path: Path) -> list[str] | None:
    """The known keys of the mapping at *path*; ``None`` where names are free or no mapping can stand."""
    known = [key for found in _variants_at(path) for key in found.get("properties", {})]
    return list(dict.fromkeys(known)) or None


def names_are_free(path: Path) -> bool:
    """True if the entries of the mapping at *path* are named by the model: components, processors, ports."""
    return any(_free(found) for found in _variants_at(path))


def short_key(path: Path) -> str | None:
    """The key that is meant where the mapping at *path* is written as a single value; ``None`` if it cannot
    be.
    """
    return next((str(found[SHORT]) for found in _options_at(path) if SHORT in found), None)


def _tidy(made: Any) -> Any:
    """Without the titles that repeat the keys."""
    if isinstance(made, dict):
        return {
            key: {name: _tidy(inner) for name, inner in value.items()}
            if key in ("properties", "$defs")
            else _tidy(value)
            for key, value in made.items()
            if key != "title"
        }
    return [_tidy(item) for item in made] if isinstance(made, list) else made


def _variants_at(path: Path) -> list[Schema]:
    return [found for found in _options_at(path) if "$ref" not in found and "anyOf" not in found]


def _options_at(path: Path) -> list[Schema]:
    """What may stand at *path*: every alternative, and the alternatives' own."""
    places = _resolved(schema())
    for step in path:
        places = [option for place in places for below in _below(place, step) for option in _resolved(below)]
    return places


def _below(place: Schema, step: str | int) -> list[Schema]:
    if step in place.get("properties", {}):
        return [place["properties"][step]]
    if _free(place):
        return _free(place)
    if "items" in place and str(step).isdigit():
        return [place["items"]]
    return []


def _free(place: Schema) -> list[Schema]:
    """What entries with names of the model's own are."""
    others = place.get("additionalProperties")
    return [*place.get("patternProperties", {}).values(), *([others] if isinstance(others, dict) else [])]


def _resolved(place: Schema) -> list[Schema]:
    if "$ref" in place:
        return [place, *_resolved(schema()["$defs"][place["$ref"].rpartition("/")[2]])]
    if "anyOf" in place:
        return [place, *(variant for option in place["anyOf"] for variant in _resolved(option))]
    return [place]


F = TypeVar("F", bound=Form)

_EXPECTED = {
    "string_type": "text",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "float_parsing": "a number",
    "bool_type": "true or false",
    "dict_type": "a mapping of keys",
    "model_type": "a mapping of keys",
    "model_attributes_type": "a mapping of keys",
    "list_type": "a list",
}


def validate(form: type[F], node: Node, problems: Problems, prefix: Path = ()) -> F | None:
    """The form of *node*, which stands at *prefix*; ``None``, with *problems* noted, if it is not one."""
    try:
        return form.model_validate(node.plain())
    except ValidationError as error:
        for path, what in _complaints(error, prefix):
            problems.add(path, what)
        return None


def _complaints(error: ValidationError, prefix: Path) -> Iterator[tuple[Path, str]]:
    for details in error.errors(include_url=False):
        path: Path = (*prefix, *details["loc"])
        if path and path[-1] == "[key]":
            name = details["input"]
            yield path[:-1], f"{name!r} is no name: letters, digits, _ and -, starting with a letter"
        else:
            yield path, _complaint(details, path)


def _complaint(details: ErrorDetails, path: Path) -> str:
    kind, written, context = details["type"], details["input"], details.get("ctx", {})
    if kind == "extra_forbidden":
        known = keys_at(path[:-1]) or []
        return f"unknown key{did_you_mean(str(path[-1]), known)}; valid here: {choices(known)}"
    if kind == "missing":
        return "this key is missing"
    if kind == "literal_error":
        return _not_one_of(written, str(context.get("expected", "")))
    if kind == "value_error":
        return str(context["error"])
    if kind in _EXPECTED:
        return f"{_EXPECTED[kind]} is expected, not {_shown(written)}"
    return f"{details['msg'][0].lower()}{details['msg'][1:]}, not {_shown(written)}"


def _not_one_of(written: Any, expected: str) -> str:
    names = [name.strip("' ") for name in expected.replace(" or ", ", ").split(",")]
    return f"{_shown(written)} is not one of {choices(names)}{did_you_mean(str(written), names)}"


def _shown(written: Any) -> str:
    if written is None:
        return "nothing"
    if isinstance(written, dict):
        return "a mapping"
    if isinstance(written, list):
        return "a list"
    return repr(str(written)) if isinstance(written, str) else str(written)
