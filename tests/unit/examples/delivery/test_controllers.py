"""Rover_Control, Drone_Control, Precision_Landing and the beacon, with vehicles that are made up."""

from __future__ import annotations

from math import hypot, nan
from types import ModuleType, SimpleNamespace

import pytest

from volery.base.errors import Refused
from volery.base.position import AMSL, Position
from volery.base.time import MS, S
from volery.kernel import waiting


def fake_rospy(kernel):
    """As much of rospy as the controllers use."""
    rospy = ModuleType("rospy")
    rospy.init_node = lambda name: None
    rospy.is_shutdown = lambda: False
    rospy.logerr = lambda text, *args: None
    rospy.Rate = lambda hz: waiting.Rate(kernel, round(S / hz))
    return rospy


class FakeVehicle:
    """Moves as it is told, after a while or at a velocity; ``refuses`` names operations that fail."""

    def __init__(self, bench, frame, east=0.0, north=0.0, up=0.0, refuses=()):
        self.name, self.bench, self.frame, self.refuses = "v", bench, frame, refuses
        self.enu = [east, north, up]
        self.velocity, self.since = (0.0, 0.0, 0.0), 0
        self.done = []
        self.battery = SimpleNamespace(remaining=nan)
        self.flying = up > 0.0

    @property
    def position(self):
        self._move()
        latitude, longitude, amsl = self.frame.from_enu(tuple(self.enu))
        return Position(latitude, longitude, AMSL(amsl))

    def _move(self):
        now = self.bench.kernel.now()
        self.enu = [
            here + speed * (now - self.since) / S for here, speed in zip(self.enu, self.velocity, strict=True)
        ]
        self.since = now

    def _do(self, operation, *arguments, takes=2 * S):
        waiting.sleep(self.bench.kernel, takes)
        if operation in self.refuses:
            raise Refused(self.name, operation, "PreArm: no")
        self.done.append((operation, *arguments))

    def wait_ready(self):
        self._do("wait_ready")
        self.battery.remaining = 0.9

    def takeoff(self, height):
        self.flying = True
        self._do("takeoff", round(height, 3))
        self.enu[2] = height

    def goto(self, point):
        self._do("goto")
        self.enu = list(self.frame.to_enu(point.latitude, point.longitude, point.altitude.metres))

    drive = goto

    def set_velocity(self, north, east, up):
        self._move()
        self.velocity = (east, north, up)

    def land(self, pad=None):
        self._move()
        self.velocity = (0.0, 0.0, 0.0)
        self._do("land", pad)
        self.enu[2], self.flying = 0.0, False

    @property
    def east_north(self):
        return self.enu[0], self.enu[1]


class FakeLanding:
    def __init__(self, bench, outcome="done", takes=10.0):
        self.bench, self.result, self.takes = bench, outcome, takes
        self.jobs, self.pads = {}, []

    def take_over(self, job, pad):
        self.jobs[job] = self.bench.kernel.now()
        self.pads.append(pad)

    def outcome(self, job):
        return self.result if self.bench.kernel.now() - self.jobs[job] >= self.takes * S else ""


@pytest.fixture
def bench(make_bench):
    made = make_bench()
    made.loader.replacements["rospy"] = fake_rospy(made.kernel)
    return made


def ask(bench, instance, *steps):
    """Call operations at given seconds; what they return."""
    answers = []
    for at, call in steps:
        when = round(at * S)
        body = lambda call=call: answers.append(call(instance.object))  # noqa: E731 (bound in a loop)
        bench.kernel.call_at(when, lambda body=body: bench.kernel.spawn(body, "central", instance.context))
    return answers


def test_a_rover_drives_one_job_at_a_time(bench, city):
    rover = FakeVehicle(bench, city.origin)
    control = bench.start("rover_control.py", "RoverControl", ("drive", "status"), rover=rover)
    route = [city.places[name].position for name in ("port_a", "hospital_a")]
    answers = ask(
        bench,
        control,
        (1, lambda it: it.status().position),
        (3, lambda it: it.drive("job-1", route)),
        (4, lambda it: it.drive("job-2", route)),
        (5, lambda it: (it.status().state, it.status().job, it.status().outcome)),
        (8, lambda it: it.status()),
        (9, lambda it: it.drive("job-3", [])),
    )
    bench.run(20)
    assert bench.failures == []
    assert answers[:4] == [None, True, False, ("busy", "job-1", "")]
    assert (answers[4].state, answers[4].outcome, answers[4].battery) == ("idle", "done", 0.9)
    assert answers[5] is False
    assert rover.east_north == pytest.approx((60.0, 0.0), abs=1e-3)


@pytest.mark.parametrize("refuses", ["wait_ready", "goto"])
def test_a_rover_that_fails_is_out_of_service(bench, city, refuses):
    rover = FakeVehicle(bench, city.origin, refuses=(refuses,))
    control = bench.start("rover_control.py", "RoverControl", ("drive", "status"), rover=rover)
    answers = ask(
        bench,
        control,
        (3, lambda it: it.drive("job-1", [city.places["store"].position])),
        (8, lambda it: (it.status().state, it.status().outcome)),
        (9, lambda it: it.drive("job-2", [city.places["store"].position])),
    )
    bench.run(10)
    assert answers[1] == ("failed", f"v: {refuses}: PreArm: no")
    assert answers[2] is False


def above(city, name, height=25.0):
    place = city.places[name]
    return Position(place.latitude, place.longitude, AMSL(place.amsl_m + height))


def test_a_drone_flies_its_route_and_hands_over_above_its_pad(bench, city):
    drone, landing = FakeVehicle(bench, city.origin), FakeLanding(bench)
    control = bench.start(
        "drone_control.py",
        "DroneControl",
        ("fly", "status"),
        drone=drone,
        landing=landing,
        city=city,
        pad_east_m=3.0,
    )
    route = [above(city, name) for name in ("port_a", "aside", "port_b")]
    answers = ask(
        bench,
        control,
        (3, lambda it: it.fly("job-1", route)),
        (12, lambda it: it.status().outcome),
        (25, lambda it: (it.status().state, it.status().outcome)),
    )
    bench.run(30)
    assert bench.failures == []
    assert answers == [True, "", ("idle", "done")]
    assert [entry[0] for entry in drone.done] == ["wait_ready", "takeoff", "goto", "goto"]
    assert drone.done[1] == ("takeoff", 25.0)
    assert drone.east_north == pytest.approx((3.0, 400.0), abs=0.01)
    east, north, _ = city.origin.to_enu(landing.pads[0].latitude, landing.pads[0].longitude, 45.0)
    assert (east, north) == pytest.approx((3.0, 400.0), abs=0.01)


def test_a_drone_whose_landing_fails_comes_down_by_itself(bench, city):
    drone, landing = FakeVehicle(bench, city.origin), FakeLanding(bench, "v: land: lost")
    control = bench.start(
        "drone_control.py", "DroneControl", ("fly", "status"), drone=drone, landing=landing, city=city
    )
    answers = ask(
        bench,
        control,
        (3, lambda it: it.fly("job-1", [above(city, "port_a"), above(city, "port_b")])),
        (25, lambda it: (it.status().state, it.status().outcome)),
    )
    bench.run(30)
    assert answers[1] == ("failed", "v: land: lost")
    assert drone.done[-1][0] == "land"
    assert not drone.flying


class Landing:
    """Precision_Landing over the beacon of port_b, with a drone that follows velocities."""

    def __init__(self, bench, city, east=2.0, north=402.0, up=25.0, **drone):
        self.bench = bench
        self.drone = FakeVehicle(bench, city.origin, east, north, up, **drone)
        self.beacon = bench.start(
            "landing_beacon.py", "LandingBeacon", ("look",), active=False, body=self.drone, city=city
        )
        self.component = bench.start(
            "precision_landing.py",
            "PrecisionLanding",
            ("take_over", "outcome"),
            drone=self.drone,
            beacon=SimpleNamespace(look=self._look),
            image_ms=55,
            gain=0.7,
        )
        self.pad = city.places["port_b"].position

    def _look(self):
        return self.beacon.object.look()

    def land(self, seconds=60):
        answers = ask(
            self.bench,
            self.component,
            (0.5, lambda it: it.outcome("job")),
            (1, lambda it: it.take_over("job", self.pad)),
            (2, lambda it: it.outcome("job")),
            (seconds - 1, lambda it: it.outcome("job")),
        )
        self.bench.run(seconds)
        assert self.bench.failures == []
        return [answer for answer in answers if answer is not None]


def test_it_lands_on_the_beacon(bench, city):
    landing = Landing(bench, city)
    assert landing.land() == ["this landing was not requested", "", "done"]
    assert hypot(landing.drone.enu[0], landing.drone.enu[1] - 400.0) < 0.3
    assert landing.drone.done == [("land", landing.pad)]


def test_the_noise_of_the_beacon_repeats_with_the_seed(make_bench, city):
    ends = []
    for seed in (1, 1, 2):
        bench = make_bench(seed)
        bench.loader.replacements["rospy"] = fake_rospy(bench.kernel)
        landing = Landing(bench, city)
        landing.land()
        ends.append(landing.drone.east_north)
    assert ends[0] == ends[1] != ends[2]


def test_without_a_beacon_it_lands_by_position(bench, city):
    landing = Landing(bench, city, east=60.0)
    assert landing.land()[-1] == "done"
    assert landing.drone.east_north == pytest.approx((60.0, 402.0))
    assert "the beacon is not seen: landing by position" in bench.texts()


def test_a_drone_that_cannot_land_is_reported(bench, city):
    landing = Landing(bench, city, refuses=("land",))
    assert landing.land()[-1] == "v: land: PreArm: no"


def test_requesters_order_as_the_workload_says(make_bench, city):
    def orders(seed):
        bench = make_bench(seed)
        told = []

        def order(good, destination):
            told.append((bench.kernel.now() // MS, good, destination))
            return SimpleNamespace(parcel=f"parcel-{len(told)}", reason="")

        bench.start("requesters.py", "Requesters", orders=SimpleNamespace(order=order), city=city)
        bench.run(3000)
        assert bench.failures == []
        return told, bench.texts()

    told, texts = orders(1)
    assert len(told) == city.workload.count == len(texts)
    assert told[0][0] == 3000
    assert {destination for _, _, destination in told} <= {"hospital_a", "hospital_b"}
    assert orders(1)[0] == told != orders(2)[0]
