"""A model file as a whole: its sections, its JSON Schema, and the paths that there can be in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Annotated, Any

from volery.base.time import Ns
from volery.model.components import COMPONENTS, INTERFACES, Component, Interface
from volery.model.data_types import DATA_TYPES, DataType
from volery.model.design import DESIGN_PARAMETERS, SUPPRESSIONS, DesignParameter, Suppression
from volery.model.environment import Environment
from volery.model.fields import (
    ANYTHING,
    AS_WRITTEN,
    PERIOD,
    SHORT,
    TEXT,
    ListOf,
    MapOf,
    NameField,
    OneOf,
    Others,
    Record,
    Schema,
)
from volery.model.instances import INSTANCES, Instance
from volery.model.resources import (
    DEVICES,
    MEMORY_SPACES,
    OPERATING_SYSTEMS,
    Device,
    MemorySpace,
    OperatingSystem,
)
from volery.model.system import (
    BOUNDS,
    CHAINS,
    NETWORKS,
    PROCESSORS,
    BoundText,
    Chain,
    NetworkSpec,
    ProcessorSpec,
    RequiredBound,
    RunLimits,
)
from volery.model.text import Path

ALLOCATION = NameField("allocation", lambda reading: reading.names(("allocations",)))
SCENARIO = NameField("scenario", lambda reading: reading.names(("scenarios",)))
PLACE = NameField(
    "processor, operating system or memory space",
    lambda reading: reading.names(
        ("platform", "processors"), ("platform", "operating_systems"), ("memory_spaces",)
    ),
)
_CHANGES = MapOf(ANYTHING, free=True)


@dataclass(frozen=True, slots=True)
class Platform:
    """The computers and what joins them."""

    catalogues: Annotated[
        tuple[str, ...],
        ListOf(TEXT, bare=True),
        "Files with kinds of processors beside the built-in ones, such as `volery cost calibrate` writes, "
        "relative to the model.",
    ] = ()
    processors: Annotated[tuple[ProcessorSpec, ...], PROCESSORS, "Computers, by name."] = ()
    networks: Annotated[tuple[NetworkSpec, ...], NETWORKS, "What joins the computers, by name."] = ()
    operating_systems: Annotated[
        tuple[OperatingSystem, ...], OPERATING_SYSTEMS, "Operating systems, by name."
    ] = ()
    devices: Annotated[tuple[Device, ...], DEVICES, "Sensors, actuators and other devices, by name."] = ()


@dataclass(frozen=True, slots=True)
class AllocationText:
    """Which instance runs on which processor, directly or through a memory space and an operating system.

    A vehicle's name states where the node runs that serves it.
    """

    extends: Annotated[str | None, ALLOCATION, "An allocation that it adds to."] = None
    set: Annotated[Mapping[str, Any], _CHANGES, "Changes to the model: paths and values."] = field(
        default_factory=dict
    )
    places: Annotated[
        Mapping[str, str],
        Others(),
        MapOf(PLACE, free=True),
        "An instance or a vehicle: its processor, operating system or memory space. A memory space or an "
        "operating system: what it is on.",
    ] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Scenario:
    """Changes to the model for some runs; later ones win."""

    extends: Annotated[str | None, SCENARIO, "A scenario that it adds to."] = None
    description: Annotated[str, TEXT, "What it is for."] = ""
    allocation: Annotated[str | None, ALLOCATION, "The allocation that it runs with."] = None
    set: Annotated[Mapping[str, Any], _CHANGES, "Changes to the model: paths and values."] = field(
        default_factory=dict
    )
    duration_ns: Annotated[Ns | None, PERIOD, "Longest simulated time, instead of `run.duration`."] = None
    until: Annotated[
        BoundText | None, Record(BoundText), "Bound that ends the run, instead of `run.until`."
    ] = None


@dataclass(frozen=True, slots=True)
class EnvironmentText(Environment):
    """The surroundings of the system. A world file may hold the geography: the first keys."""

    world: Annotated[str, TEXT, "File with the geography, relative to the model."] = ""
    terrain: Annotated[str, OneOf(("flat",)), "Shape of the ground."] = "flat"
    components: Annotated[
        tuple[Instance, ...], INSTANCES, "Instances that surround the system and cost nothing: requesters."
    ] = ()


GEOGRAPHY = ("origin", "terrain", "places", "roads", "corridors", "no_fly_zones", "buildings", "markers")
"""The keys of the environment that a world file may hold."""


@dataclass(frozen=True, slots=True)
class Document:
    """A system model."""

    volery: Annotated[int, OneOf((1,)), "Version of the model language."]
    name: Annotated[str, TEXT, "Name of the system."]
    description: Annotated[str, TEXT, "What the system does."] = ""
    interfaces: Annotated[
        Mapping[str, Interface],
        INTERFACES,
        "Interfaces and their operations; one without operations stands for publish and subscribe.",
    ] = field(default_factory=dict)
    components: Annotated[Mapping[str, Component], COMPONENTS, "The library: kinds of components."] = field(
        default_factory=dict
    )
    types: Annotated[
        Mapping[str, DataType],
        DATA_TYPES,
        "Data types of arguments and messages. If there are any, arguments have these types only.",
    ] = field(default_factory=dict)
    application: Annotated[
        tuple[Instance, ...], INSTANCES, "Component instances of the system, by name."
    ] = ()
    memory_spaces: Annotated[
        tuple[MemorySpace, ...], MEMORY_SPACES, "Processes that instances are allocated to, by name."
    ] = ()
    platform: Annotated[Platform, Record(Platform), "The computers and what joins them."] = Platform()
    allocations: Annotated[
        Mapping[str, AllocationText],
        MapOf(Record(AllocationText)),
        "Which instance runs on which processor; the first allocation is the default.",
    ] = field(default_factory=dict)
    environment: Annotated[EnvironmentText, Record(EnvironmentText), "What surrounds the system."] = (
        EnvironmentText()
    )
    scenarios: Annotated[
        Mapping[str, Scenario], MapOf(Record(Scenario)), "Changes to the model for some runs, by name."
    ] = field(default_factory=dict)
    chains: Annotated[
        tuple[Chain, ...],
        CHAINS,
        "Rows of topics by their full names, whose end-to-end latency can be observed: `NAME.latency`.",
    ] = ()
    requirements: Annotated[
        tuple[RequiredBound, ...], BOUNDS, "Bounds on observed quantities, judged at the end of each run."
    ] = ()
    run: Annotated[RunLimits, Record(RunLimits), "How long a run lasts."] = field(default_factory=RunLimits)
    design_parameters: Annotated[
        tuple[DesignParameter, ...], DESIGN_PARAMETERS, "Values that a design may vary, and their choices."
    ] = ()
    explore: Annotated[
        Mapping[str, Any],
        MapOf(AS_WRITTEN, free=True),
        "What `volery explore` varies, and how; its keys are in docs/explore.md.",
    ] = field(default_factory=dict)
    include: Annotated[
        tuple[str, ...],
        ListOf(TEXT, bare=True),
        "Files with further sections or entries of sections, relative to the model.",
    ] = ()
    files_from: Annotated[
        tuple[str, ...],
        ListOf(TEXT, bare=True),
        "Folders outside the folder of the model that its files may be in.",
    ] = ()
    suppress: Annotated[
        tuple[Suppression, ...], SUPPRESSIONS, "Rules of level warning that are not reported, with reasons."
    ] = ()


DOCUMENT = Record(Document)


@cache
def schema() -> Schema:
    """Return the JSON Schema of a model (draft 2020-12). Editors complete and check keys with it."""
    definitions: Schema = {}
    DOCUMENT.schema(definitions)
    root = definitions.pop(Document.__name__)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "volery system model",
        **root,
        "$defs": dict(sorted(definitions.items())),
    }


# -- paths


def keys_at(path: Path) -> list[str] | None:
    """Return the known keys of the mapping at *path*, None where names are free or no mapping can stand."""
    known = [key for found in _variants_at(path) for key in found.get("properties", {})]
    return list(dict.fromkeys(known)) or None


def names_are_free(path: Path) -> bool:
    """Return whether the entries of the mapping at *path* are named by the model, such as components."""
    return any(_free(found) for found in _variants_at(path))


def short_key(path: Path) -> str | None:
    """Return the key that is meant where the mapping at *path* is written as a single value, if it can be."""
    return next((str(found[SHORT]) for found in _options_at(path) if SHORT in found), None)


def _variants_at(path: Path) -> list[Schema]:
    return [found for found in _options_at(path) if "$ref" not in found and "anyOf" not in found]


def _options_at(path: Path) -> list[Schema]:
    """Return what may stand at *path*: every alternative, and the alternatives' own."""
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
    """Return the schemas of entries whose names are the model's own."""
    others = place.get("additionalProperties")
    return [*place.get("patternProperties", {}).values(), *([others] if isinstance(others, dict) else [])]


def _resolved(place: Schema) -> list[Schema]:
    if "$ref" in place:
        return [place, *_resolved(schema()["$defs"][place["$ref"].rpartition("/")[2]])]
    if "anyOf" in place:
        return [place, *(variant for option in place["anyOf"] for variant in _resolved(option))]
    return [place]
