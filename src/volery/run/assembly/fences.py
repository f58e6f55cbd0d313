"""Geofences from a GeoJSON file and from the no-fly zones of a model.

The file is GeoJSON (RFC 7946) as map editors write it; longitude comes before latitude.

| in the file | in the fence |
|---|---|
| a polygon; its properties ``floor``, ``ceiling`` | inclusion polygon; metres above home |
| holes of that polygon | no-fly zones at any height |
| a polygon whose property ``no_fly`` is true; ``name``, ``floor``, ``ceiling`` | a no-fly zone |
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from math import isfinite, isinf
from pathlib import Path
from typing import TYPE_CHECKING, Any

from volery.base.errors import UsageError, choices
from volery.base.files import read_text
from volery.base.position import AMSL, AboveHome
from volery.vehicles import Fence, Zone
from volery.vehicles.limits import Corner

if TYPE_CHECKING:
    from volery.model.environment import Environment, Prism

_MAX_BYTES = 4_000_000


def read_fence(path: Path) -> Fence:
    """Read a fence from a GeoJSON file. Raises ``UsageError`` that names the file and the polygon."""
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise UsageError(
                f"{path}: the file is larger than {_MAX_BYTES // 1_000_000} MB; simplify the outline"
            )
        text = read_text(path)
    except OSError as error:
        raise UsageError(f"cannot read the fence {str(path)!r}: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise UsageError(f"{path}: this is no text file; a fence is GeoJSON") from None
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise UsageError(f"{path}: this is no JSON; a fence is GeoJSON: {error}") from None
    return _Reader(path).read(document)


class _Reader:
    """Reader of one document. ``_where`` names the file in messages."""

    def __init__(self, path: Path) -> None:
        self._where = str(path)

    def read(self, document: object) -> Fence:
        """Return the fence of all polygons in *document*."""
        outline: tuple[Corner, ...] = ()
        heights: tuple[AboveHome | None, AboveHome | None] = None, None
        zones: list[Zone] = []
        for number, (rings, properties) in enumerate(self._polygons(document), 1):
            what = str(properties.get("name", f"polygon {number}"))
            low, high = self._metres(what, properties, "floor"), self._metres(what, properties, "ceiling")
            corners, *holes = (self._ring(what, ring) for ring in rings)
            if properties.get("no_fly", False) is True:
                zones.append(Zone(what, corners, low, high))
                continue
            if outline:
                raise self._wrong(f"{what}: a second inclusion polygon; mark no-fly zones with no_fly: true")
            outline, heights = corners, (low, high)
            zones += [Zone(f"hole {n} of {what}", hole) for n, hole in enumerate(holes, 1)]
        if not outline and not zones:
            raise self._wrong("it contains no polygon")
        return Fence(outline, *heights, no_fly=tuple(zones))

    def _polygons(self, thing: object) -> Iterator[tuple[Sequence[object], Mapping[str, Any]]]:
        if not isinstance(thing, Mapping):
            raise self._wrong("a GeoJSON object is expected: Polygon, Feature or FeatureCollection")
        kind = thing.get("type")
        if kind == "FeatureCollection":
            for feature in self._list(thing, "features"):
                yield from self._polygons(feature)
        elif kind == "Feature":
            properties = thing.get("properties") or {}
            if not isinstance(properties, Mapping):
                raise self._wrong("properties: a mapping is expected")
            for rings, _ in self._polygons(thing.get("geometry")):
                yield rings, properties
        elif kind == "Polygon":
            yield self._list(thing, "coordinates"), {}
        elif kind == "MultiPolygon":
            for polygon in self._list(thing, "coordinates"):
                yield self._listed("coordinates", polygon), {}
        else:
            valid = choices(("Feature", "FeatureCollection", "MultiPolygon", "Polygon"))
            raise self._wrong(f"type {kind!r}; there is {valid}")

    def _list(self, thing: Mapping[Any, Any], key: str) -> Sequence[object]:
        return self._listed(key, thing.get(key))

    def _listed(self, what: str, found: object) -> Sequence[object]:
        if not isinstance(found, list) or not found:
            raise self._wrong(f"{what}: a list with at least one entry is expected")
        return found

    def _ring(self, what: str, ring: object) -> tuple[Corner, ...]:
        corners = [self._corner(what, point) for point in self._listed(what, ring)]
        if len(corners) > 1 and corners[0] == corners[-1]:
            corners.pop()  # a ring repeats its first point at the end
        return tuple(corners)

    def _corner(self, what: str, point: object) -> Corner:
        if not isinstance(point, list) or len(point) < 2 or not all(map(_is_number, point)):
            raise self._wrong(f"{what}: {point!r} is no [longitude, latitude] in degrees")
        longitude, latitude = float(point[0]), float(point[1])
        if abs(latitude) > 90.0 >= abs(longitude):
            raise self._wrong(f"{what}: {point!r}: GeoJSON has longitude first; are they swapped?")
        return latitude, longitude

    def _metres(self, what: str, properties: Mapping[str, Any], key: str) -> AboveHome | None:
        found = properties.get(key)
        if found is None:
            return None
        if not _is_number(found):
            raise self._wrong(f"{what}: {key}: {found!r} is no number of metres above home")
        return AboveHome(float(found))

    def _wrong(self, what: str) -> UsageError:
        return UsageError(f"{self._where}: {what}")


def _is_number(thing: object) -> bool:
    return isinstance(thing, int | float) and not isinstance(thing, bool) and isfinite(thing)


def fence_of(environment: Environment) -> Fence | None:
    """Return a fence of the model's no-fly zones, or None if there are none."""
    if not environment.no_fly_zones:
        return None
    return Fence(no_fly=tuple(_zone(prism, environment) for prism in environment.no_fly_zones))


def _zone(prism: Prism, environment: Environment) -> Zone:
    """Return a zone. One that starts at the ground has no floor, so a drone on lower ground is inside it."""
    origin = environment.origin
    places = [origin.from_enu((east, north, 0.0)) for east, north in prism.corners]
    return Zone(
        prism.name,
        tuple((latitude, longitude) for latitude, longitude, _ in places),
        AMSL(origin.amsl + prism.floor_m) if prism.floor_m > 0.0 else None,
        None if isinf(prism.ceiling_m) else AMSL(origin.amsl + prism.ceiling_m),
    )
