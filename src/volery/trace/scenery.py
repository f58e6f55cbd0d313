"""The map of a run, for those who draw it: the attachment ``world.json`` of a trace.

Points are (x, y) metres east and north of the origin, as in ``VehicleState``. It is not the world that the
physics use; it is what a reader needs to understand where a vehicle is.
"""

from __future__ import annotations

from dataclasses import dataclass

from pydantic import TypeAdapter

from volery.trace import attachments

Point = tuple[float, float]
Line = tuple[Point, ...]
"""At least two points, in order."""

SCENERY_SCHEMA = "volery-scenery/1"


@dataclass(frozen=True)
class Origin:
    """Where x = y = z = 0 lies: WGS-84 degrees and metres AMSL."""

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
    """A named polygon that closes itself: ``no-fly``, ``building``, ``water``, ``park`` or your own kind."""

    name: str
    outline: Line
    kind: str = "no-fly"


@dataclass(frozen=True)
class Scenery:
    """All there is to draw. ``roads`` are for rovers, ``corridors`` are the air lanes of drones."""

    origin: Origin
    places: tuple[Place, ...] = ()
    roads: tuple[Line, ...] = ()
    corridors: tuple[Line, ...] = ()
    areas: tuple[Area, ...] = ()
    schema: str = SCENERY_SCHEMA


_ADAPTER = TypeAdapter(Scenery)


def scenery_to_json(scenery: Scenery) -> bytes:
    """The scenery as UTF-8 JSON, the same bytes for the same scenery."""
    return attachments.to_json(scenery)


def scenery_from_json(data: bytes) -> Scenery:
    """The scenery that ``scenery_to_json`` wrote. Raises ``UsageError`` if it is anything else."""
    return attachments.from_json(data, _ADAPTER, SCENERY_SCHEMA, "map")
