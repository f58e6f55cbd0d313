"""Whole flights of the DJI driver with the simulated aircraft, in virtual time."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from math import hypot
from typing import Any

import pytest

from rigs.missions import carried_out
from volery.base.errors import Failsafe, NotArrived, Overridden, Refused, UsageError, VehicleError
from volery.base.frames import LocalFrame
from volery.base.position import AMSL, AboveHome, Position
from volery.base.time import MS, S
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.run.assembly.vehicles import VehicleSettings, open_vehicles
from volery.trace.events import Operation
from volery.vehicles import Drone, Land, TakeOff, Vehicle, Waypoint

HOME = Position(46.0825, -103.8995, AMSL(900.0))
FRAME = LocalFrame(HOME.latitude, HOME.longitude, 900.0)
NEAR_M, NEAR_UP_M = 0.6, 0.3


class Flown:
    """One vehicle at an address, and all that was recorded of it."""

    def __init__(self, options: str = "", seed: int = 1) -> None:
        opened = open_vehicles(
            {"d": f"sim:dji?start=warm{options}"}, {"d": Drone}, VehicleSettings(seed=seed)
        )
        assert isinstance(opened.kernel, VirtualKernel)
        assert opened.fleet is not None
        self.kernel, self.fleet = opened.kernel, opened.fleet
        (vehicle,) = opened.vehicles
        assert isinstance(vehicle, Drone)
        self.drone: Drone = vehicle
        self.events: list[Any] = []
        self.kernel.record = self.events.append

    def fly(self, mission: Callable[[Drone], None]) -> list[Operation]:
        """Carry it out; what it raises comes out here."""

        def flow() -> None:
            self.drone.wait_connected()
            mission(self.drone)

        try:
            carried_out(self.kernel, flow, step=500 * MS)
        finally:
            self.drone.close()
            self.kernel.close()
        return [event for event in self.events if isinstance(event, Operation)]

    def wait(self, seconds: float) -> None:
        self.kernel.sleep_until(self.kernel.now() + round(seconds * S))

    def later(self, seconds: float, action: Callable[[], None]) -> None:
        self.kernel.call_at(self.kernel.now() + round(seconds * S), action)

    def switch(self, pulse: int) -> None:
        """The pilot's mode switch."""
        self.fleet.autopilots["d"].vehicle.rc.transmitter[4] = pulse

    @property
    def height(self) -> float:
        """True metres above where it stood."""
        return float(self.fleet.flights["d"].truth().position[2])


def at(east: float, north: float, height: float) -> Position:
    latitude, longitude, _ = FRAME.from_enu((east, north, 0.0))
    return Position(latitude, longitude, AboveHome(height))


def tour(drone: Drone) -> None:
    drone.takeoff(10.0)
    drone.goto(at(15.0, 20.0, 12.0))
    drone.goto(at(-10.0, 5.0, 8.0), speed=3.0)
    drone.set_heading(120.0)
    drone.return_home()


@pytest.mark.parametrize(
    "options",
    ["", "&names=dji_osdk_ros", "&parameters=AIRCRAFT:2", "&wire=bytes&drop=0.02&flip=1e-4&jitter=0.01"],
    ids=["3.8", "4.1", "M100", "a bad wire"],
)
def test_a_tour_arrives_by_the_aircrafts_own_estimate(options: str) -> None:
    flown = Flown(options)
    done = flown.fly(tour)
    assert [one.outcome for one in done] == ["ok"] * 5
    for one in done[:3]:
        assert one.estimate_horizontal <= NEAR_M
        assert one.estimate_vertical <= NEAR_UP_M
    assert done[-1].estimate_horizontal < 20.0  # so near, going home lands on the spot
    assert not flown.drone.armed


@pytest.mark.parametrize("options", ["", "&parameters=AIRCRAFT:2"], ids=["3.8", "M100"])
def test_motors_start_again_just_after_a_landing(options: str) -> None:
    flown = Flown(options)

    def mission(drone: Drone) -> None:
        drone.takeoff(5.0)
        drone.land()
        assert not drone.armed
        drone.arm()
        assert drone.armed
        drone.disarm()

    assert [one.outcome for one in flown.fly(mission)] == ["ok"] * 4


def test_the_same_seed_is_the_same_flight() -> None:
    bad = "&wire=bytes&drop=0.05&jitter=0.02"
    first, again, other = (Flown(bad, seed) for seed in (3, 3, 4))
    for one in (first, again, other):
        one.fly(tour)
    assert repr(first.events) == repr(again.events)
    assert repr(first.events) != repr(other.events)


def test_sticks_fly_it_without_satellites_from_the_ground_and_back() -> None:
    flown = Flown()

    def mission(drone: Drone) -> None:
        flown.wait(1.0)
        flown.fleet.flights["d"].block_gps()
        flown.wait(12.0)
        assert not drone.ready
        drone.manual_control(0.0, 0.0, 0.0, 0.0)
        drone.altitude_hold()
        assert drone.armed
        drone.manual_control(0.0, 0.0, 0.8, 0.0)
        flown.wait(8.0)
        assert flown.height > 4.0
        drone.manual_control(0.0, 0.0, 0.5, 0.0)
        flown.wait(1.0)
        drone.stabilize()
        flown.wait(1.0)
        flown.fleet.flights["d"].block_gps(False)
        flown.wait(5.0)
        drone.goto(at(5.0, 5.0, 6.0))  # by position again, in flight
        flown.fleet.flights["d"].block_gps()
        flown.wait(12.0)
        drone.land()

    flown.fly(mission)
    assert flown.height == pytest.approx(0.0, abs=0.2)


def test_the_pilot_takes_it_and_gives_it_back() -> None:
    flown = Flown()

    def mission(drone: Drone) -> None:
        drone.takeoff(6.0)
        flown.later(2.0, lambda: flown.switch(2000))
        with pytest.raises(Overridden, match="by RC"):
            drone.goto(at(40.0, 0.0, 6.0))
        flown.wait(4.0)
        speed = drone.velocity
        assert hypot(speed.north, speed.east) < 0.5  # it hovers, and no one overrides it
        with pytest.raises(Overridden):
            drone.land()
        flown.switch(1000)
        flown.wait(0.5)
        drone.land()

    flown.fly(mission)


@pytest.mark.parametrize("names", ["", "&names=dji_osdk_ros"], ids=["3.8", "4.1"])
def test_an_altitude_above_the_sea_is_flown_with_an_altimeter_that_is_60_m_off(names: str) -> None:
    flown = Flown(f"{names}&parameters=PRESSURE_OFFSET:-60")

    def mission(drone: Drone) -> None:
        drone.takeoff(10.0)
        assert flown.height == pytest.approx(10.0, abs=0.6)
        place = at(10.0, 0.0, 0.0)
        drone.goto(Position(place.latitude, place.longitude, AMSL(915.0)))
        assert flown.height == pytest.approx(15.0, abs=0.6)
        assert drone.position.altitude.metres == pytest.approx(915.0, abs=0.6)

    flown.fly(mission)


def test_an_m210_whose_downward_range_latches_keeps_its_heights() -> None:
    flown = Flown("&parameters=AIRCRAFT:4")

    def mission(drone: Drone) -> None:
        drone.takeoff(10.0)
        assert flown.height == pytest.approx(10.0, abs=0.6)
        drone.goto(at(20.0, 0.0, 12.0), speed=3.0)
        assert flown.height == pytest.approx(12.0, abs=0.6)

    flown.fly(mission)


@pytest.mark.parametrize("speed", [None, 3.0])
def test_without_satellites_a_goto_ends_and_does_not_go_on(speed: float | None) -> None:
    flown = Flown()

    def mission(drone: Drone) -> None:
        drone.takeoff(6.0)
        flown.later(5.0, flown.fleet.flights["d"].block_gps)
        with pytest.raises(VehicleError, match="position: GPS"):
            drone.goto(at(60.0, 0.0, 6.0), speed)
        assert flown.fleet.flights["d"].truth().position[0] < 60.0
        drone.land()

    flown.fly(mission)
    assert flown.height == pytest.approx(0.0, abs=0.2)


@pytest.mark.parametrize("names", ["", "&names=dji_osdk_ros"], ids=["3.8", "4.1"])
def test_a_landing_cannot_be_left_and_hold_does_not_say_so(names: str) -> None:
    flown = Flown(names)
    refused: list[str] = []

    def mission(drone: Drone) -> None:
        drone.takeoff(10.0)

        def hold() -> None:
            with pytest.raises(Refused) as error:
                drone.hold()
            refused.append(str(error.value))

        def land() -> None:
            with suppress(Overridden):
                drone.land()

        flown.kernel.spawn(land, "lands", ExecutionContext("lands"))
        flown.wait(3.0)
        hold()
        flown.wait(20.0)
        assert not drone.armed

    flown.fly(mission)
    assert "only the pilot can" in refused[0]


def test_a_refusal_of_the_node_of_4_1_is_one() -> None:
    """There it is a failed call, not an answer."""
    flown = Flown("&names=dji_osdk_ros")

    def mission(drone: Drone) -> None:
        drone.wait_ready()
        flown.switch(2000)
        flown.wait(0.5)
        with pytest.raises(Refused, match="refused to give the program the authority"):
            drone.takeoff(5.0)

    flown.fly(mission)


@pytest.mark.parametrize("options", ["", "&parameters=AIRCRAFT:2", "&names=dji_osdk_ros"])
def test_armed_first_it_takes_off_all_the_same(options: str) -> None:
    flown = Flown(options)

    def mission(drone: Drone) -> None:
        drone.wait_ready()
        drone.arm()
        drone.takeoff(5.0)
        assert flown.height == pytest.approx(5.0, abs=0.6)

    flown.fly(mission)


def test_a_lost_transmitter_is_a_failsafe() -> None:
    flown = Flown()

    def mission(drone: Drone) -> None:
        drone.takeoff(6.0)
        lose = flown.fleet.autopilots["d"].vehicle.set_parameter
        flown.later(3.0, lambda: lose("RC_CONNECTED", 0.0) and None)
        with pytest.raises(Failsafe, match="the transmitter is lost"):
            drone.goto(at(80.0, 0.0, 6.0))
        assert drone.mode in {"AUTO_LANDING", "NAVI_GO_HOME"}

    flown.fly(mission)


def test_a_low_battery_is_its_own_business() -> None:
    flown = Flown()

    def mission(drone: Drone) -> None:
        drone.takeoff(6.0)
        flown.later(3.0, lambda: flown.fleet.flights["d"].set_charge(0.2))
        with pytest.raises(Failsafe, match="NAVI_GO_HOME"):
            drone.goto(at(90.0, 0.0, 6.0))
        assert "NAVI_GO_HOME" in drone.come_to_rest()

    flown.fly(mission)
    assert flown.height == pytest.approx(0.0, abs=0.2)


def test_a_mission_on_board() -> None:
    flown = Flown()

    def mission(drone: Drone) -> None:
        drone.wait_ready()
        route = [TakeOff(6.0), Waypoint(at(0.0, 15.0, 8.0), stay_s=1.0), Land(at(12.0, 15.0, 0.0))]
        drone.upload_mission(route)
        drone.start_mission()
        assert not drone.armed

    flown.fly(mission)
    east, north, _ = flown.fleet.flights["d"].truth().position
    assert (east, north) == pytest.approx((12.0, 15.0), abs=1.5)


def test_a_mission_on_board_of_an_m300() -> None:
    flown = Flown("&names=dji_osdk_ros&parameters=AIRCRAFT:5")

    def mission(drone: Drone) -> None:
        drone.wait_ready()
        assert drone.telemetry.autopilot == "DJI M300"
        with pytest.raises(UsageError, match="does not stay"):
            drone.upload_mission([TakeOff(6.0), Waypoint(at(0.0, 15.0, 8.0), stay_s=1.0), Land()])
        drone.upload_mission([TakeOff(6.0), Waypoint(at(0.0, 15.0, 8.0)), Land(at(12.0, 15.0, 0.0))])
        drone.start_mission()
        assert not drone.armed

    flown.fly(mission)
    east, north, _ = flown.fleet.flights["d"].truth().position
    assert (east, north) == pytest.approx((12.0, 15.0), abs=1.5)


def test_a_cut_link_ends_in_a_hover_and_then_the_way_goes_on() -> None:
    """The cut is shorter than the patience of the caller: nothing is raised."""
    flown = Flown("&wire=bytes&cut=14-16")

    def mission(drone: Drone) -> None:
        drone.takeoff(6.0)
        drone.goto(at(0.0, 60.0, 6.0))

    assert [one.outcome for one in flown.fly(mission)] == ["ok", "ok"]


def test_two_in_one_world_do_not_hear_each_other() -> None:
    urls = {"one": "sim:dji?start=warm", "two": "sim:dji?start=warm"}
    opened = open_vehicles(urls, dict.fromkeys(urls, Drone), VehicleSettings(seed=1))
    ended: list[str] = []

    def flow(vehicle: Vehicle, height: float) -> None:
        assert isinstance(vehicle, Drone)
        vehicle.wait_connected()
        vehicle.takeoff(height)
        ended.append(vehicle.name)

    for vehicle, height in zip(opened.vehicles, (4.0, 8.0), strict=True):
        opened.kernel.spawn(
            lambda v=vehicle, h=height: flow(v, h), vehicle.name, ExecutionContext(vehicle.name)
        )
    opened.kernel.run(30 * S)
    assert sorted(ended) == ["one", "two"]
    heights = [vehicle.altitude.metres for vehicle in opened.vehicles]
    assert heights == [pytest.approx(4.0, abs=0.6), pytest.approx(8.0, abs=0.6)]
    opened.kernel.close()


def test_what_never_arrives_is_said_so() -> None:
    flown = Flown("&parameters=MAX_SPEED:0.1")

    def mission(drone: Drone) -> None:
        drone.takeoff(3.0)
        with pytest.raises(NotArrived):
            drone.goto(at(0.0, 80.0, 3.0))

    flown.fly(mission)


def _farthest(options: str, metres: float) -> tuple[list[Operation], float, str]:
    """Fly north until something ends it; return the operations, the greatest true distance, and the error."""
    flown, reached, said = Flown(options), [0.0], [""]

    def mission(drone: Drone) -> None:
        drone.takeoff(10)
        truth = flown.fleet.flights["d"]

        def look() -> None:
            reached[0] = max(reached[0], float(truth.truth().position[1]))

        watch = flown.kernel.every(100 * MS, look)
        latitude, longitude, _ = FRAME.from_enu((0.0, metres, 0.0))
        try:
            drone.goto(Position(latitude, longitude, AboveHome(10)), speed=5.0)
        except VehicleError as error:
            said[0] = str(error)
        watch.cancel()
        drone.land()

    return flown.fly(mission), reached[0], said[0]


def test_it_hovers_at_the_border_of_a_no_fly_zone() -> None:
    operations, reached, said = _farthest("&parameters=NO_FLY_NORTH:60,NO_FLY_RADIUS:20", 60.0)
    assert 34.0 < reached < 41.0
    assert [one.outcome for one in operations] == ["ok", "NotArrived", "ok"]
    assert "no-fly zone" in said


def test_without_a_transmitter_it_stops_at_fifty_metres() -> None:
    operations, reached, _ = _farthest("&parameters=RC_CONNECTED:0", 80.0)
    assert 44.0 < reached < 51.0
    assert operations[1].outcome == "NotArrived"


def test_it_does_not_start_in_a_no_fly_zone() -> None:
    flown = Flown("&parameters=NO_FLY_RADIUS:30")
    with pytest.raises(VehicleError):
        flown.fly(lambda drone: drone.takeoff(10))
    assert not flown.drone.armed
