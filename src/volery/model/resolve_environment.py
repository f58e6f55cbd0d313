"""The environment: every point in degrees and in metres, vehicles, what breaks."""

from __future__ import annotations

from itertools import pairwise
from math import cos, hypot, pi, sin
from typing import Any

from volery.base.frames import LocalFrame
from volery.model.context import Context
from volery.model.environment import (
    Battery,
    Environment,
    Fault,
    Place,
    Prism,
    Vehicle,
    Ways,
    Wind,
    Workload,
)
from volery.model.form_environment import PlaceForm, PointForm, PrismForm, VehicleForm, WaysForm
from volery.model.problems import Path
from volery.model.resolve_platform import vehicle_processor

CIRCLE_CORNERS = 32
FARTHEST_M = 100_000.0
"""A local frame is a tangent plane: beyond this its ground has curved away by hundreds of metres."""

_ENVIRONMENT: Path = ("environment",)


class _Geography:
    """Points of the text to places of the model."""

    def __init__(self, context: Context) -> None:
        self.context = context
        origin = context.form.environment.origin
        self.frame = LocalFrame(origin.latitude, origin.longitude, origin.amsl)
        self.places: dict[str, Place] = {}

    def point(self, path: Path, name: str, form: PointForm, role: str = "") -> Place | None:
        """The place of a point; ``None``, with the problem noted, if it is not one."""
        said = {
            key
            for key in ("place", "east", "north", "latitude", "longitude")
            if getattr(form, key) is not None
        }
        if said == {"place"} and form.place is not None:
            known = self.context.known(path, form.place, "place", self.places)
            return self.places[form.place] if known else None
        if said == {"latitude", "longitude"} and form.latitude is not None and form.longitude is not None:
            east, north, _ = self.frame.to_enu(form.latitude, form.longitude, self.frame.amsl)
            latitude, longitude = form.latitude, form.longitude
        elif said <= {"east", "north"} and said:
            east, north = form.east or 0.0, form.north or 0.0
            latitude, longitude, _ = self.frame.from_enu((east, north, 0.0))
        else:
            self.context.problems.add(
                path,
                "a point is {east, north} from the origin, {latitude, longitude}, or the name of a place",
            )
            return None
        if hypot(east, north) > FARTHEST_M:
            away = hypot(east, north) / 1000.0
            what = f"{away:.0f} km from the origin; at most {FARTHEST_M / 1000:.0f} km make sense"
            self.context.problems.add(path, what)
        return Place(name, latitude, longitude, self.frame.amsl, east, north, role)

    def read_places(self, forms: dict[str, PlaceForm]) -> None:
        """Places may stand where another one does; those come after the others."""
        later = [name for name, form in forms.items() if form.place is not None]
        for name in [*(name for name in forms if name not in later), *later]:
            form = forms[name]
            made = self.point((*_ENVIRONMENT, "places", name), name, form, form.role)
            if made is not None:
                own = Place(
                    name, made.latitude, made.longitude, made.amsl_m, made.east_m, made.north_m, form.role
                )
                self.places[name] = own
        self.places = {name: self.places[name] for name in forms if name in self.places}


def environment(context: Context, found: dict[str, str]) -> Environment:
    """All of it. *found* says on which processors the vehicles' nodes are allocated."""
    form = context.form.environment
    geography = _Geography(context)
    geography.read_places(form.places)
    return Environment(
        origin=geography.frame,
        places=geography.places,
        roads=_ways(geography, (*_ENVIRONMENT, "roads"), form.roads),
        corridors=_ways(geography, (*_ENVIRONMENT, "corridors"), form.corridors),
        no_fly_zones=_prisms(geography, (*_ENVIRONMENT, "no_fly_zones"), form.no_fly_zones),
        buildings=_prisms(geography, (*_ENVIRONMENT, "buildings"), form.buildings),
        wind=Wind(form.wind.speed, form.wind.direction % 360.0, form.wind.gusts),
        vehicles=_vehicles(geography, found),
        workload=_workload(context),
        faults=_faults(context),
    )


def _workload(context: Context) -> Workload:
    form = context.form.environment.workload
    orders = form.orders
    return Workload(form.requesters, orders.rate, orders.count, orders.first, orders.seed)


def _ways(geography: _Geography, path: Path, form: WaysForm) -> Ways:
    junctions = {
        name: geography.point((*path, "junctions", name), name, point)
        for name, point in form.junctions.items()
    }
    known = {**geography.places, **{name: place for name, place in junctions.items() if place is not None}}
    edges: list[tuple[str, str, float]] = []
    for number, way in enumerate(form.ways):
        here: Path = (*path, "ways", number)
        if len(way) < 2:
            geography.context.problems.add(here, "a way joins at least two places or junctions")
        ends = [
            known[name] for name in way if geography.context.known(here, name, "place or junction", known)
        ]
        edges += [_edge(one, other) for one, other in pairwise(ends)]
    used = {name for edge in edges for name in edge[:2]}
    return Ways({name: place for name, place in known.items() if name in used}, tuple(edges), form.height)


def _edge(one: Place, other: Place) -> tuple[str, str, float]:
    return one.name, other.name, hypot(other.east_m - one.east_m, other.north_m - one.north_m)


def _prisms(geography: _Geography, path: Path, forms: dict[str, PrismForm]) -> tuple[Prism, ...]:
    found = (_prism(geography, (*path, name), name, form) for name, form in forms.items())
    return tuple(prism for prism in found if prism is not None)


def _prism(geography: _Geography, path: Path, name: str, form: PrismForm) -> Prism | None:
    ceiling = form.ceiling if form.ceiling is not None else float("inf")
    if ceiling <= form.floor:
        geography.context.problems.add(
            path, f"its ceiling ({ceiling:g} m) is not above its floor ({form.floor:g} m)"
        )
    if form.centre is not None and form.radius and not form.corners:
        centre = geography.point((*path, "centre"), name, form.centre)
        return Prism(name, _circle(centre, form.radius), form.floor, ceiling) if centre else None
    if len(form.corners) >= 3 and form.centre is None and form.radius is None:
        corners = [
            geography.point((*path, "corners", number), name, point)
            for number, point in enumerate(form.corners)
        ]
        flat = tuple((corner.east_m, corner.north_m) for corner in corners if corner is not None)
        return Prism(name, flat, form.floor, ceiling) if len(flat) == len(corners) else None
    geography.context.problems.add(path, "give at least three corners, or a centre and a radius")
    return None


def _circle(centre: Place, radius: float) -> tuple[tuple[float, float], ...]:
    """The regular polygon around the circle: no part of the circle is outside it."""
    outer = radius / cos(pi / CIRCLE_CORNERS)
    angles = [2.0 * pi * corner / CIRCLE_CORNERS for corner in range(CIRCLE_CORNERS)]
    return tuple(
        (centre.east_m + outer * cos(angle), centre.north_m + outer * sin(angle)) for angle in angles
    )


def _vehicles(geography: _Geography, found: dict[str, str]) -> tuple[Vehicle, ...]:
    forms = geography.context.form.environment.vehicles
    made = (_vehicle(geography, name, form, found) for name, form in forms.items())
    return tuple(vehicle for vehicle in made if vehicle is not None)


def _vehicle(geography: _Geography, name: str, form: VehicleForm, found: dict[str, str]) -> Vehicle | None:
    context = geography.context
    path: Path = (*_ENVIRONMENT, "vehicles", name)
    context.known((*path, "autopilot"), form.autopilot, "autopilot", sorted(context.vocabulary.autopilots))
    processor = vehicle_processor(context, name, found)
    at = geography.point((*path, "at"), name, form.at)
    if at is None:
        return None
    battery: Any = form.battery
    return Vehicle(
        name=name,
        kind=form.kind,
        autopilot=form.autopilot,
        at=at,
        heading_deg=form.heading % 360.0,
        battery=Battery(battery.capacity, battery.charge, battery.voltage) if battery else None,
        sensors=form.sensors,
        started=form.started,
        parameters=form.parameters,
        processor=processor,
        where=context.where(path),
    )


def _faults(context: Context) -> tuple[Fault, ...]:
    form = context.form.environment
    for name, fault in form.faults.items():
        path: Path = (*_ENVIRONMENT, "faults", name)
        context.known((*path, "kind"), fault.kind, "kind of fault", sorted(context.vocabulary.faults))
        context.known((*path, "vehicle"), fault.vehicle, "vehicle", form.vehicles)
    return tuple(
        Fault(name, fault.kind, fault.vehicle, fault.at, fault.duration)
        for name, fault in form.faults.items()
    )
