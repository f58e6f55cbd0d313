"""The JSON descriptions that are attached to a trace: the run's set-up and the map of its world.

Both are frozen dataclasses that carry the name of their schema. With the events, the set-up is all that is
needed to account for a run and to report on it. It holds no wall time and no versions, so it is the same for
the same run. The order of entries is significant: tables list things in this order.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, TypeVar

from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.trace.events import NONE

if TYPE_CHECKING:
    from _typeshed import DataclassInstance
    from pydantic import TypeAdapter

D = TypeVar("D")


def to_json(description: DataclassInstance) -> bytes:
    """Return *description* as UTF-8 JSON: the same bytes for the same description."""
    return json.dumps(asdict(description), ensure_ascii=False, separators=(",", ":")).encode()


def from_json(data: bytes, kind: type[D], schema: str, what: str) -> D:
    """Return what ``to_json`` wrote.

    Args:
        data: UTF-8 JSON.
        kind: The dataclass of the description.
        schema: The schema that the description must name.
        what: What messages call the description.

    Raises:
        UsageError: *data* is not a description of that schema.
    """
    from pydantic import ValidationError  # noqa: PLC0415  # writing a trace needs no pydantic

    try:
        raw: Any = json.loads(data)
        version = raw.get("schema") if isinstance(raw, dict) else None
        if version != schema:
            raise UsageError(f"the trace's {what} has schema {version!r}; this version reads {schema!r}")
        return _adapter(kind).validate_python(raw)
    except (ValueError, RecursionError, ValidationError) as error:
        raise UsageError(f"the trace's {what} cannot be read: {error}") from error


_ADAPTERS: dict[object, TypeAdapter[Any]] = {}


def _adapter(kind: type[D]) -> TypeAdapter[D]:
    """Return what checks descriptions of *kind*. To make one takes 5 ms."""
    from pydantic import TypeAdapter  # noqa: PLC0415

    if kind not in _ADAPTERS:
        _ADAPTERS[kind] = TypeAdapter(kind)
    return _ADAPTERS[kind]


SETUP_SCHEMA = "volery-setup/1"

SETUP_ATTACHMENT = "run-setup.json"
"""The attachment of a trace that holds a ``RunSetup``."""
MODEL_ATTACHMENT = "model.yaml"
"""The attachment that holds the text of the system model."""
WORLD_ATTACHMENT = "world.json"
"""The attachment that holds a ``Scenery``."""


@dataclass(frozen=True)
class ComponentSetup:
    """A component instance and its allocation. ``processor`` is empty where computing takes no time.

    ``period`` and ``deadline`` (relative to the release) are ``NONE`` where the model promises none.
    """

    name: str
    type: str = ""
    language: str = ""
    processor: str = ""
    active: bool = False
    period: Ns = NONE
    deadline: Ns = NONE
    priority: int = 0


@dataclass(frozen=True)
class ProcessorSetup:
    """A processor. ``idle_w`` and ``busy_w`` are watts of the whole of it, idle and with all cores busy.

    They are None where they are not stated: then its energy is not counted. ``power_error`` is their
    relative band (0.2: within 20 per cent), ``None`` where it is unknown.
    """

    name: str
    kind: str = ""
    frequency_mhz: float = 0.0
    scheduler: str = ""
    cores: int = 1
    idle_w: float | None = None
    busy_w: float | None = None
    power_error: float | None = None


@dataclass(frozen=True)
class NetworkSetup:
    """A network that joins processors."""

    name: str


@dataclass(frozen=True)
class VehicleSetup:
    """A vehicle: ``kind`` is ``multirotor`` or ``rover``; ``autopilot`` is what flies it.

    ``firmware`` is the program of real firmware, empty for a simulated autopilot and a real vehicle.
    """

    name: str
    autopilot: str = ""
    kind: str = ""
    firmware: str = ""


@dataclass(frozen=True)
class ChainSetup:
    """A chain of topics whose end-to-end latency is observed."""

    name: str
    topics: tuple[str, ...]


@dataclass(frozen=True)
class RequirementSetup:
    """A bound on an observed quantity; ``relation`` is ``max`` or ``min``."""

    name: str
    observable: str
    relation: str
    bound: float
    unit: str = ""


@dataclass(frozen=True)
class LawSetup:
    """A law of cost or physics that priced this run: its source, provenance and warning.

    ``provenance`` is ``estimated``, ``measured``, ``calculated`` or ``required``; ``validity`` is a
    text that states where the law holds; ``warning`` is empty unless the run used the law outside that range,
    or on a component that it was not measured for.
    """

    name: str
    source: str = ""
    provenance: str = ""
    validity: str = ""
    warning: str = ""


@dataclass(frozen=True)
class RunSetup:
    """The set-up of a run, without anything that depends on the machine that executes it."""

    system: str = ""
    fidelity: str = ""
    allocation: str = ""
    scenario: str = ""
    seed: int = 0
    components: tuple[ComponentSetup, ...] = ()
    processors: tuple[ProcessorSetup, ...] = ()
    networks: tuple[NetworkSetup, ...] = ()
    vehicles: tuple[VehicleSetup, ...] = ()
    chains: tuple[ChainSetup, ...] = ()
    requirements: tuple[RequirementSetup, ...] = ()
    laws: tuple[LawSetup, ...] = ()
    not_counted: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    schema: str = SETUP_SCHEMA


def setup_from_json(data: bytes) -> RunSetup:
    """Return the set-up that ``to_json`` wrote.

    Raises:
        UsageError: *data* is anything else.
    """
    return from_json(data, RunSetup, SETUP_SCHEMA, SETUP_ATTACHMENT)


Point = tuple[float, float]
Line = tuple[Point, ...]
"""At least two points, in order."""

SCENERY_SCHEMA = "volery-scenery/1"


@dataclass(frozen=True)
class Origin:
    """Origin of the coordinates: WGS-84 degrees and metres AMSL."""

    latitude: float
    longitude: float
    amsl: float = 0.0


@dataclass(frozen=True)
class Place:
    """A named point. Of all kinds, ``hospital``, ``store``, ``port`` and ``home`` have symbols."""

    name: str
    x: float
    y: float
    kind: str = ""


@dataclass(frozen=True)
class Area:
    """A named polygon, closed from its last point to the first.

    ``kind`` is ``no-fly``, ``building``, ``water``, ``park`` or another name.
    """

    name: str
    outline: Line
    kind: str = "no-fly"


@dataclass(frozen=True)
class Scenery:
    """The map of a run, for reports. Points are (x, y) metres east and north of the origin.

    It is not the world of the physics. ``roads`` are for rovers, ``corridors`` are the air lanes of drones.
    """

    origin: Origin
    places: tuple[Place, ...] = ()
    roads: tuple[Line, ...] = ()
    corridors: tuple[Line, ...] = ()
    areas: tuple[Area, ...] = ()
    schema: str = SCENERY_SCHEMA


def scenery_from_json(data: bytes) -> Scenery:
    """Return the scenery that ``to_json`` wrote.

    Raises:
        UsageError: *data* is anything else.
    """
    return from_json(data, Scenery, SCENERY_SCHEMA, "map")
