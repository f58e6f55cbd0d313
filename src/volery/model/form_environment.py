"""The text form of the environment. A world file holds the part of it that is geography."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from volery.model.fields import (
    Charge,
    Distance,
    Form,
    Heading,
    Latitude,
    Length,
    Longitude,
    Name,
    Rate,
    Share,
    Short,
    Speed,
    Time,
    Voltage,
)
from volery.model.form_component import InstanceForm


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
