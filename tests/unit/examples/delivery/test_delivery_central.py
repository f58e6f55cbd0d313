"""The central's state machine, with vehicles that are made up and fail when they like."""

from __future__ import annotations

from itertools import pairwise
from math import inf

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from volery.base.errors import LinkSilent
from volery.base.time import S

NEXT = {
    "ordered": {"to_port", "last_mile", "failed"},
    "to_port": {"at_port", "stranded"},
    "at_port": {"in_flight", "last_mile", "failed"},
    "in_flight": {"arrived", "stranded"},
    "arrived": {"last_mile", "failed"},
    "last_mile": {"delivered", "stranded"},
    "stranded": {"to_port", "last_mile", "failed", "stranded"},
    "delivered": set(),
    "failed": set(),
}


class Controller:
    """A vehicle's controller whose jobs take a while and whose vehicle may fail at a given time."""

    def __init__(self, bench, name, at, **faults):
        self.bench, self.component, self.position = bench, name, at
        self.takes = faults.get("takes", 20.0)
        self.fails_at = faults.get("fails_at")
        self.battery = faults.get("battery", 1.0)
        self.answers_from = faults.get("answers_from", 0.0)
        self.knows_itself_at = faults.get("knows_itself_at", 0.0)
        self.job, self.goal, self.until, self.jobs = "", None, 0.0, []

    @property
    def now(self):
        return self.bench.kernel.now() / S

    @property
    def failed(self):
        return self.fails_at is not None and self.now >= self.fails_at

    def drive(self, job, route):
        if self.now < self.until or self.failed:
            return False
        self.job, self.goal, self.until = job, route[-1], self.now + self.takes
        self.jobs.append(job)
        return True

    fly = drive

    def status(self):
        if self.now < self.answers_from:
            raise LinkSilent("no answer")
        busy = bool(self.job) and self.now < self.until
        if self.goal is not None and not busy and not self.failed:
            self.position = self.goal
        state = "failed" if self.failed else "busy" if busy else "idle"
        outcome = "motor stopped" if self.failed else "" if busy or not self.job else "done"
        position = self.position if self.now >= self.knows_itself_at else None
        return self.bench.types.VehicleStatus(
            self.component, state, self.job, outcome, position, self.battery
        )


class Routes:
    def __init__(self, closed=()):
        self.closed = closed

    def get_route(self, start, goal, vehicle):
        return [] if vehicle in self.closed else [start, goal]


class Provider:
    def __init__(self):
        self.log = []

    def report(self, subject, state, detail):
        self.log.append((subject, state, detail))


class Service:
    """The central with two rovers and two drones."""

    def __init__(self, bench, city, routes=None, **changes):
        places = city.places
        homes = {"rover_a": "store", "rover_b": "port_b", "drone_a": "port_a", "drone_b": "port_b"}
        self.bench = bench
        self.vehicles = {
            name: Controller(bench, name, places[home].position, **changes.get(name, {}))
            for name, home in homes.items()
        }
        self.provider = Provider()
        self.central = bench.start(
            "delivery_central.py",
            "DeliveryCentral",
            ("order",),
            routes=routes or Routes(),
            rovers=[self.vehicles["rover_a"], self.vehicles["rover_b"]],
            drones=[self.vehicles["drone_a"], self.vehicles["drone_b"]],
            provider=self.provider,
            city=city,
            stock={"blood": 3, "vaccine": 9, "nothing": 0},
        )
        self.receipts = []

    def order_at(self, seconds, good="vaccine", destination="hospital_b"):
        def body():
            self.receipts.append(self.central.object.order(good, destination))

        when = round(seconds * S)
        self.bench.kernel.call_at(
            when, lambda: self.bench.kernel.spawn(body, "requester", self.central.context)
        )

    def run(self, seconds=600):
        self.bench.run(seconds)
        assert self.bench.failures == []
        return self.bench.parcels()


@pytest.fixture
def service(make_bench, city):
    return lambda **changes: Service(make_bench(), city, **changes)


THE_WAY = ["ordered", "to_port", "at_port", "in_flight", "arrived", "last_mile", "delivered"]


def test_a_parcel_goes_by_rover_drone_and_rover(service):
    running = service()
    running.order_at(1)
    assert running.run() == {"parcel-1": THE_WAY}
    assert [len(running.vehicles[name].jobs) for name in ("rover_a", "drone_a", "rover_b", "drone_b")] == [
        2,
        1,
        2,
        0,
    ]
    assert [state for subject, state, _ in running.provider.log if subject == "parcel-1"] == THE_WAY


def test_within_one_district_a_rover_is_enough(service):
    running = service()
    running.order_at(1, destination="hospital_a")
    assert running.run() == {"parcel-1": ["ordered", "last_mile", "delivered"]}


def test_orders_are_checked(service):
    running = service()
    running.order_at(1, destination="nowhere")
    running.order_at(2, good="gold")
    running.order_at(3, good="nothing")
    for number in range(4):
        running.order_at(4 + number, good="blood")
    assert len(running.run(1200)) == 3
    assert [receipt.parcel for receipt in running.receipts] == [
        "",
        "",
        "",
        "parcel-4",
        "parcel-5",
        "parcel-6",
        "",
    ]
    assert running.receipts[0].reason == "'nowhere' is no hospital of this city: hospital_a, hospital_b"
    assert running.receipts[1].reason == "'gold' is not traded: blood, vaccine, nothing"
    assert running.receipts[2].reason == "'nothing' is out of stock"
    assert running.receipts[6].reason == "'blood' is out of stock"


def test_three_parcels_share_two_drones(service):
    running = service()
    for at in (1, 2, 3):
        running.order_at(at)
    assert list(running.run(1200).values()) == [THE_WAY] * 3


def test_a_vehicle_that_does_not_know_yet_where_it_is_is_waited_for(service):
    running = service(rover_a={"knows_itself_at": 6.0})
    running.order_at(1)
    assert running.run() == {"parcel-1": THE_WAY}
    assert running.vehicles["rover_a"].jobs
    assert len(running.vehicles["rover_b"].jobs) == 2  # the last mile, and home again


@pytest.mark.parametrize(
    ("changes", "states"),
    [
        ({"drone_a": {"fails_at": 10.0}}, THE_WAY),  # before it has the parcel: the other drone comes
        ({"drone_a": {"battery": 0.2}}, THE_WAY),
        ({"drone_a": {"answers_from": inf}}, THE_WAY),
        # nodes that start slowly: it waits for them
        ({name: {"answers_from": 8.0} for name in ("rover_a", "rover_b", "drone_a", "drone_b")}, THE_WAY),
        ({"rover_a": {"fails_at": 3.0}}, THE_WAY),  # while it loads
        (
            {
                "drone_a": {"fails_at": 45.0}
            },  # in flight: a rover fetches the parcel where the drone came down
            ["ordered", "to_port", "at_port", "in_flight", "stranded", "last_mile", "delivered"],
        ),
        (
            {"rover_a": {"fails_at": 15.0}},
            ["ordered", "to_port", "stranded", *THE_WAY[1:]],
        ),
        (
            {"drone_a": {"fails_at": 5.0}, "drone_b": {"fails_at": 5.0}},
            ["ordered", "to_port", "at_port", "last_mile", "delivered"],
        ),
        ({"rover_a": {"fails_at": 0.0}, "rover_b": {"fails_at": 0.0}}, ["ordered", "failed"]),
    ],
)
def test_a_failed_vehicle_is_replaced(service, changes, states):
    running = service(**changes)
    running.order_at(1)
    assert running.run(1200) == {"parcel-1": states}
    for name in changes:
        if "fails_at" in changes[name]:
            assert (name, "failed", "motor stopped") in running.provider.log


def test_where_there_is_no_way_the_parcel_is_reported(service):
    running = service(routes=Routes(closed=("drone",)))
    running.order_at(1)
    assert running.run() == {"parcel-1": ["ordered", "to_port", "at_port", "failed"]}
    assert running.provider.log[-1] == ("parcel-1", "failed", "drone_a finds no way")


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    faults=st.dictionaries(
        st.sampled_from(["rover_a", "rover_b", "drone_a", "drone_b"]), st.floats(0.0, 300.0)
    ),
    takes=st.floats(2.0, 40.0),
    orders=st.lists(
        st.tuples(st.floats(0.0, 100.0), st.sampled_from(["hospital_a", "hospital_b"])), max_size=5
    ),
)
def test_every_parcel_is_in_one_state_and_comes_to_an_end(service, faults, takes, orders):
    changes = {name: {"takes": takes} for name in ("rover_a", "rover_b", "drone_a", "drone_b")}
    for name, at in faults.items():
        changes[name]["fails_at"] = at
    running = service(**changes)
    for at, destination in orders:
        running.order_at(at, destination=destination)
    parcels = running.run(4000)
    assert len(parcels) == len(orders)
    for states in parcels.values():
        assert states[0] == "ordered"
        assert states[-1] in ("delivered", "failed")
        assert all(after in NEXT[before] for before, after in pairwise(states))
    if not faults:
        assert all(states[-1] == "delivered" for states in parcels.values())
