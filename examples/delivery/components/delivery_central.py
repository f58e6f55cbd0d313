"""Delivery_Central: takes orders, picks rovers and drones, asks for routes, follows every parcel to its end.

A parcel goes over *legs*: by rover from the store to the drone port, by drone to the port of its district, by
rover to the requester. Each leg has a carrier of its own. Step by step the central asks every vehicle how it
stands and moves on what can be moved on; nothing it calls waits for a vehicle.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import hypot

from delivery_types import DONE, FAILED, IDLE, Receipt, VehicleStatus

import volery
from volery import Position, VoleryError

ROVER, DRONE = "rover", "drone"

OPEN, APPROACH, THERE, LOADING, CARRY, UNLOADING = (
    "open",
    "approach",
    "there",
    "loading",
    "carry",
    "unloading",
)
"""How a leg stands: without a carrier; a carrier on its way, or waiting, to fetch the parcel; and so on."""

ORDERED, DELIVERED, GIVEN_UP, STRANDED = "ordered", "delivered", "failed", "stranded"
LAST = 2
WAITS = {0: ORDERED, 1: "at_port", LAST: "arrived"}
MOVES = {0: "to_port", 1: "in_flight", LAST: "last_mile"}
"""The state of a parcel that waits for its carrier, or travels, by leg."""

NEAR_M = {ROVER: 6.0, DRONE: 12.0}
"""A vehicle that stands this close to a place is there."""

LEAST_CHARGE = 0.3
"""Share of its battery that a vehicle needs to be sent out."""

SILENT_POLLS = 3
"""After so many questions without an answer a vehicle counts as failed."""
START_POLLS = 60
"""The same of a vehicle that has never answered: its node may still be starting."""


@dataclass
class Leg:
    """A part of a parcel's way. ``number`` says which, for the parcel's state."""

    number: int
    kind: str
    start: Position
    goal: Position
    stage: str = OPEN
    carrier: str = ""
    job: str = ""
    since: float = 0.0


@dataclass
class Parcel:
    """An order that was accepted. Its state changes through ``DeliveryCentral._enter`` only."""

    name: str
    good: str
    destination: str
    legs: list[Leg]
    state: str = ""

    @property
    def ended(self):
        """Whether nothing will happen to it any more."""
        return self.state in (DELIVERED, GIVEN_UP)


@dataclass
class Vehicle:
    """A vehicle with its controller and its last reported state."""

    name: str
    kind: str
    port: object
    status: VehicleStatus | None = None
    base: Position | None = None
    silent: int = 0
    failed: bool = False
    serves: Leg | None = field(default=None, repr=False)

    @property
    def idle(self):
        """Whether it has nothing to do and nothing before it."""
        return not self.failed and self.serves is None and self.base is not None and self.status.state == IDLE


class DeliveryCentral:
    """``order`` is called by requesters, ``run`` follows the parcels."""

    def __init__(self, routes, rovers, drones, provider, city, *, stock, poll_s=1.0, handling_s=3.0):
        self._routes = routes
        self._provider = provider
        self._city = city
        self._stock = dict(stock)
        self._poll_s = poll_s
        self._handling_s = handling_s
        self._vehicles = [Vehicle(port.component, ROVER, port) for port in rovers]
        self._vehicles += [Vehicle(port.component, DRONE, port) for port in drones]
        self._parcels = []
        self._orders = 0
        self._jobs = 0

    # -- orders

    def order(self, good, destination):
        """Check the order and the stock; the answer names the parcel, or says why there is none."""
        self._orders += 1
        refused = self._refuse(good, destination)
        if refused:
            self._provider.report(f"order {self._orders}", "rejected", refused)
            return Receipt("", refused)
        self._stock[good] -= 1
        parcel = Parcel(f"parcel-{self._orders}", good, destination, self._plan(destination))
        self._parcels.append(parcel)
        self._enter(parcel, ORDERED, f"{good} for {destination}")
        return Receipt(parcel.name)

    def _refuse(self, good, destination):
        hospitals = [place.name for place in self._city.places_with("hospital")]
        if destination not in hospitals:
            return f"{destination!r} is no hospital of this city: {', '.join(hospitals)}"
        if good not in self._stock:
            return f"{good!r} is not traded: {', '.join(self._stock)}"
        if self._stock[good] <= 0:
            return f"{good!r} is out of stock"
        return ""

    def _plan(self, destination):
        """Store to port, port to port, port to requester; by rover alone if both are in one district."""
        store = self._city.places_with("store")[0]
        goal = self._city.places[destination]
        here, there = self._port_near(store), self._port_near(goal)
        if here.name == there.name:
            return [Leg(LAST, ROVER, store.position, goal.position)]
        return [
            Leg(0, ROVER, store.position, here.position),
            Leg(1, DRONE, here.position, there.position),
            Leg(LAST, ROVER, there.position, goal.position),
        ]

    def _port_near(self, place):
        ports = self._city.places_with("port")
        return min(ports, key=lambda port: hypot(port.east_m - place.east_m, port.north_m - place.north_m))

    # -- the loop

    def run(self):
        """Step by step, with a pause between."""
        while True:
            self.step()
            volery.sleep(self._poll_s)

    def step(self):
        """Ask every vehicle, then move every parcel on as far as it goes now."""
        for vehicle in self._vehicles:
            self._poll(vehicle)
        for parcel in [parcel for parcel in self._parcels if not parcel.ended]:
            self._advance(parcel)
        for vehicle in self._vehicles:
            self._send_home(vehicle)

    def _poll(self, vehicle):
        if vehicle.failed:
            return
        try:
            vehicle.status = vehicle.port.status()
        except VoleryError as error:
            vehicle.silent += 1
            if vehicle.silent >= (SILENT_POLLS if vehicle.base else START_POLLS):
                self._fail(vehicle, f"does not answer: {error}")
            return
        vehicle.silent = 0
        vehicle.base = vehicle.base or vehicle.status.position
        if vehicle.status.state == FAILED:
            self._fail(vehicle, vehicle.status.outcome)

    def _fail(self, vehicle, why):
        """Take a vehicle out of service; what it was to do, or carries, is planned anew."""
        vehicle.failed = True
        self._provider.report(vehicle.name, "failed", why)
        leg, vehicle.serves = vehicle.serves, None
        if leg is None:
            return
        parcel = next(parcel for parcel in self._parcels if leg in parcel.legs)
        if leg.stage in (CARRY, UNLOADING):
            self._strand(parcel, leg, vehicle)
        else:
            leg.stage, leg.carrier, leg.job = OPEN, "", ""

    def _strand(self, parcel, leg, vehicle):
        """The parcel is where the vehicle failed. A rover has to fetch it there; from a drone it goes on by
        road.
        """
        where = vehicle.status.position
        rest = parcel.legs[parcel.legs.index(leg) + 1 :]
        goal = leg.goal if leg.kind == ROVER else parcel.legs[-1].goal
        for later in rest:
            self._release(later)
        fresh = [Leg(later.number, later.kind, later.start, later.goal) for later in rest]
        if leg.kind == ROVER:
            parcel.legs = [Leg(leg.number, ROVER, where, goal), *fresh]
        else:
            parcel.legs = [Leg(LAST, ROVER, where, goal)]
        self._enter(parcel, STRANDED, f"{vehicle.name} failed with it")

    def _release(self, leg):
        """Release the vehicle that was assigned to *leg*."""
        for vehicle in self._vehicles:
            if vehicle.serves is leg:
                vehicle.serves = None

    # -- parcels

    def _enter(self, parcel, state, detail=""):
        """The one place where the state of a parcel changes."""
        parcel.state = state
        volery.note("parcel", parcel.name, state, detail)
        self._provider.report(parcel.name, state, detail)

    def _advance(self, parcel):
        """Move the first leg on that is not done, and call a carrier for the one after it."""
        while parcel.legs and self._advance_leg(parcel, parcel.legs[0]):
            parcel.legs.pop(0)
            if not parcel.legs:
                self._enter(parcel, DELIVERED, parcel.destination)
            else:
                self._enter(parcel, WAITS[parcel.legs[0].number])
        if len(parcel.legs) > 1 and parcel.legs[0].carrier:
            self._fetch(parcel, parcel.legs[1])

    def _advance_leg(self, parcel, leg):
        """One leg as far as it goes now; True if its goal is reached and the parcel unloaded."""
        self._fetch(parcel, leg)
        vehicle = next((vehicle for vehicle in self._vehicles if vehicle.serves is leg), None)
        if vehicle is None or parcel.ended:
            return False
        if leg.stage == THERE:
            leg.stage, leg.since = LOADING, volery.now()
        if leg.stage == LOADING and volery.now() - leg.since >= self._handling_s:
            self._depart(parcel, leg, vehicle)
        if leg.stage == CARRY and self._done(leg, vehicle):
            leg.stage, leg.since = UNLOADING, volery.now()
        if leg.stage == UNLOADING and volery.now() - leg.since >= self._handling_s:
            vehicle.serves = None
            return True
        return False

    def _fetch(self, parcel, leg):
        """See that a carrier comes to where *leg* starts, as far as that is possible now."""
        if parcel.ended:
            return
        if leg.stage == OPEN:
            vehicle = self._choose(parcel, leg)
            if vehicle is not None:
                leg.carrier, vehicle.serves = vehicle.name, leg
                leg.stage = APPROACH
                if self._near(vehicle, leg.start):
                    leg.stage = THERE
        if leg.stage == APPROACH:
            vehicle = next(vehicle for vehicle in self._vehicles if vehicle.serves is leg)
            if not leg.job:
                leg.job = self._command(vehicle, leg.start, parcel)
            elif self._done(leg, vehicle):
                leg.stage, leg.job = THERE, ""

    def _depart(self, parcel, leg, vehicle):
        job = self._command(vehicle, leg.goal, parcel)
        if job:
            leg.stage, leg.job = CARRY, job
            self._enter(parcel, MOVES[leg.number], vehicle.name)

    # -- vehicles

    def _choose(self, parcel, leg):
        """The vehicle for *leg*: the nearest that is idle, able and charged. ``None`` if it has to wait.

        A rover is fetched from another district only if the nearest one is out of service.
        """
        in_service = [
            vehicle for vehicle in self._vehicles if vehicle.kind == leg.kind and not vehicle.failed
        ]
        if any(vehicle.base is None for vehicle in in_service):
            return None  # it has not said yet where it is
        able = [vehicle for vehicle in in_service if vehicle.status.battery >= LEAST_CHARGE]
        if not able and leg is parcel.legs[0]:
            self._without(parcel, leg)
        if leg.kind == ROVER and able:
            able = [min(able, key=lambda vehicle: self._distance(vehicle.base, leg.start))]
        idle = [vehicle for vehicle in able if vehicle.idle]
        return min(idle, key=lambda vehicle: self._distance(vehicle.status.position, leg.start), default=None)

    def _without(self, parcel, leg):
        """No vehicle of the kind that *leg* needs is left: go by road, or give up."""
        if leg.kind == DRONE:
            goal = parcel.legs[-1].goal
            for later in parcel.legs:
                self._release(later)
            parcel.legs = [Leg(LAST, ROVER, leg.start, goal)]
            self._provider.report(parcel.name, "re-planned", "no drone is left: by road")
        else:
            self._give_up(parcel, "no rover is left")

    def _give_up(self, parcel, why):
        for leg in parcel.legs:
            self._release(leg)
        self._enter(parcel, GIVEN_UP, why)

    def _command(self, vehicle, goal, parcel=None):
        """Send *vehicle* to *goal*; the job's name, empty if it does not go now."""
        route = self._routes.get_route(vehicle.status.position, goal, vehicle.kind)
        if not route:
            if parcel is not None:
                self._give_up(parcel, f"{vehicle.name} finds no way")
            return ""
        self._jobs += 1
        job = f"{parcel.name if parcel else 'home'}/{self._jobs}"
        try:
            if vehicle.kind == ROVER:
                return job if vehicle.port.drive(job, [*route, goal]) else ""
            return job if vehicle.port.fly(job, route) else ""
        except VoleryError:
            return ""  # it is asked again, and out of service if it stays silent

    def _done(self, leg, vehicle):
        status = vehicle.status
        return bool(leg.job) and status.job == leg.job and status.outcome == DONE

    def _send_home(self, vehicle):
        """A rover that has nothing to do goes back to where it began."""
        if vehicle.kind == ROVER and vehicle.idle and not self._near(vehicle, vehicle.base):
            self._command(vehicle, vehicle.base)

    def _near(self, vehicle, place):
        return self._distance(vehicle.status.position, place) <= NEAR_M[vehicle.kind]

    def _distance(self, one, other):
        """Metres over the ground."""
        frame = self._city.origin
        east_1, north_1, _ = frame.to_enu(one.latitude, one.longitude, frame.amsl)
        east_2, north_2, _ = frame.to_enu(other.latitude, other.longitude, frame.amsl)
        return hypot(east_1 - east_2, north_1 - north_2)
