"""The driver against the simulated ArduPilot, in virtual time: whole flights, on good wires and bad ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from rigs.airstrip import FRAME, Airstrip, at
from rigs.missions import carried_out
from volery.base.errors import Failsafe, LinkLost, LinkSilent, NotArrived, Overridden, Refused
from volery.base.frames import LocalFrame
from volery.base.time import HOUR, MS, S
from volery.bridge import serve_vehicle
from volery.kernel.task import ExecutionContext
from volery.kernel.waiting import sleep
from volery.links.wire_faults import WireFaults
from volery.ros.graph import EmbeddedGraph
from volery.trace.events import LinkState, Text
from volery.vehicles import Drone, Land, Rover, TakeOff, Vehicle, Waypoint
from volery.vehicles.drivers.ardupilot import open_driver, open_mavros


class Field(Airstrip):
    """A simulated ArduPilot, over its link or over MAVROS's names."""

    firmware = "ardupilot"
    opener = staticmethod(open_driver)

    def __init__(self, kind: type[Vehicle] = Drone, *, mavros: bool = False, **stated: Any) -> None:
        self._mavros = mavros
        super().__init__(kind, **stated)

    def open(self) -> Vehicle | None:
        return None if self._mavros else super().open()

    def _over_mavros(self) -> Vehicle:
        graph = EmbeddedGraph(self.kernel)
        serve_vehicle(graph, self.link, "craft_1", ExecutionContext("vehicle node"))
        return self.commanded_by(open_mavros(self.kernel, graph.node("control"), "craft_1", {}))

    def fly(self, mission: Callable[[Any], Any]) -> Any:
        def body() -> Any:
            self.vehicle = self.vehicle or self._over_mavros()
            return mission(self.vehicle)

        return carried_out(self.kernel, body)

    def pilot_chooses(self, number: int, after_s: float) -> None:
        self.station_sends("COMMAND_LONG", after_s, command=176, param1=1.0, param2=number)

    def recorded(self, kind: type) -> Iterator[Any]:
        return (event for event in self.events if isinstance(event, kind))


def square(drone: Any) -> None:
    drone.takeoff(10)
    drone.goto(at(0, 50))
    drone.goto(at(50, 50, 15), speed=5.0)
    drone.land()


@pytest.mark.parametrize("mavros", [False, True])
def test_a_square_by_either_carrier(mavros: bool) -> None:
    field = Field(mavros=mavros)
    field.fly(square)
    done = field.operations()
    assert [(one.operation, one.outcome) for one in done] == [
        ("takeoff", "ok"),
        ("goto", "ok"),
        ("goto", "ok"),
        ("land", "ok"),
    ]
    for goto in done[1:3]:
        assert goto.estimate_horizontal < 1.0
        assert goto.estimate_vertical < 0.5
        assert goto.true_horizontal < 9.0  # three sigma of a consumer GPS
    assert not field.vehicle.telemetry.armed


def test_from_switching_on_it_waits_for_a_position() -> None:
    field = Field(warm=False)
    field.fly(square)
    takeoff = field.operations()[0]
    assert takeoff.outcome == "ok"
    assert takeoff.end > 45 * S


@pytest.mark.parametrize("mavros", [False, True])
def test_arming_too_early_is_refused_in_its_own_words(mavros: bool) -> None:
    field = Field(warm=False, mavros=mavros)
    with pytest.raises(Refused, match="Arm: "):
        field.fly(lambda drone: drone.arm())


def test_one_that_does_not_become_ready_in_time() -> None:
    field = Field(warm=False)
    with pytest.raises(NotArrived, match="ready to arm and to go by position was not seen within 15 s"):
        field.fly(lambda drone: drone.wait_ready(within=15))


@pytest.mark.parametrize("mavros", [False, True])
def test_returning_home_and_a_mission_on_board(mavros: bool) -> None:
    field = Field(mavros=mavros)
    field.fly(lambda drone: (drone.takeoff(10), drone.goto(at(0, 30)), drone.return_home()))
    assert field.operations()[-1].estimate_horizontal < 1.0
    items = [TakeOff(10), Waypoint(at(20, 20)), Land()]
    field.fly(lambda drone: (drone.wait_ready(), drone.upload_mission(items), drone.start_mission()))
    assert [one.outcome for one in field.operations()] == ["ok"] * 6
    assert not field.vehicle.telemetry.armed


def test_velocity_hold_and_heading() -> None:
    field = Field()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        before = drone.position
        drone.set_velocity(north=3.0, lasting=4.0)
        sleep(field.kernel, 4 * S)
        drone.hold()
        after = drone.position
        assert LocalFrame(before.latitude, before.longitude, 0.0).to_enu(
            after.latitude, after.longitude, 0.0
        )[1] == pytest.approx(12.0, abs=4.0)
        drone.set_heading(90.0)
        assert drone.attitude.heading == pytest.approx(90.0, abs=4.0)
        drone.land()

    field.fly(mission)


def test_sticks_in_stabilize_and_altitude_hold() -> None:
    field = Field()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.manual_control(0, 0, 0.5, 0)
        drone.altitude_hold()
        sleep(field.kernel, 10 * S)
        assert drone.altitude.metres == pytest.approx(
            10.0, abs=1.0
        )  # longer than an override lasts unrefreshed
        drone.manual_control(0, 0, 0.8, 0)
        sleep(field.kernel, 4 * S)
        assert drone.altitude.metres > 11.0
        drone.manual_control(0, 0, 0.5, 0)
        drone.stabilize()
        drone.goto(at(0, 0, 10))
        drone.land()

    field.fly(mission)
    assert [one.outcome for one in field.operations()] == ["ok"] * 5


@pytest.mark.parametrize("mavros", [False, True])
def test_a_pilot_takes_over_and_hands_back(mavros: bool) -> None:
    field = Field(mavros=mavros)

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        field.pilot_chooses(5, after_s=2.0)
        with pytest.raises(Overridden, match="from GUIDED to LOITER"):
            drone.goto(at(0, 200))
        assert "LOITER" in drone.come_to_rest()
        field.pilot_chooses(4, after_s=0.0)
        sleep(field.kernel, 2 * S)
        drone.goto(at(0, 20))
        drone.land()

    field.fly(mission)


def test_a_failsafe_of_the_autopilot_is_not_fought() -> None:
    """With the failsafe of the ground station switched on, a link that is cut for 8 s ends the call."""
    field = Field(faults=WireFaults(cuts=((20 * S, 28 * S),)), parameters={"FS_GCS_ENABLE": 1.0})
    field.vehicle._executor._link_timeout = 20 * S

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        with pytest.raises(Overridden, match="from GUIDED to RTL") as caught:
            drone.goto(at(0, 300), speed=2.0)
        assert "GCS Failsafe" in str(caught.value) or isinstance(caught.value, Failsafe)
        with pytest.raises(Overridden):
            drone.goto(at(0, 20))
        assert drone.come_to_rest() == "landed by itself in RTL"

    field.fly(mission)


def test_a_link_that_drops_in_flight_and_returns() -> None:
    field = Field(faults=WireFaults(cuts=((14 * S, 18 * S),)))
    field.fly(square)
    assert [one.outcome for one in field.operations()] == ["ok"] * 4
    assert [state.state for state in field.recorded(LinkState)] == ["silent", "back"]


def test_a_vehicle_node_that_hears_its_autopilot_no_more() -> None:
    field = Field(mavros=True, faults=WireFaults(cuts=((15 * S, HOUR),)))
    with pytest.raises(LinkLost, match="no message was received for 5"):
        field.fly(square)


def test_a_vehicle_node_that_is_not_there() -> None:
    field = Field(mavros=True)
    graph = EmbeddedGraph(field.kernel)

    def absent(drone: Any) -> None:
        driver = open_mavros(field.kernel, graph.node("control"), "craft_2", {})
        Drone(field.kernel, "craft_2", driver).wait_connected(3.0)

    with pytest.raises(LinkSilent, match="no vehicle node publishes /craft_2/state"):
        field.fly(absent)


def test_a_rover_over_mavros() -> None:
    field = Field(Rover, mavros=True)
    field.fly(lambda rover: (rover.drive(at(20, 10)), rover.come_to_rest()))
    assert field.operations()[0].outcome == "ok"


def test_sticks_over_mavros_are_repeated_by_the_caller() -> None:
    field = Field(mavros=True)

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.manual_control(0, 0, 0.5, 0)
        drone.altitude_hold()
        for _ in range(50):
            drone.manual_control(0, 0, 0.5, 0)
            sleep(field.kernel, 200 * MS)
        assert drone.altitude.metres == pytest.approx(10.0, abs=1.0)
        drone.goto(at(0, 10))
        drone.land()

    field.fly(mission)


def test_a_bad_wire() -> None:
    field = Field(faults=WireFaults(drop=0.1, flip=1e-4, burst=0.005, jitter=30 * MS))
    field.fly(square)
    assert [one.outcome for one in field.operations()] == ["ok"] * 4


def test_a_rover_drives_there_and_back() -> None:
    field = Field(Rover)

    def mission(rover: Any) -> str:
        rover.drive(at(30, 40))
        rover.drive(at(0, 40), speed=1.5)
        rover.return_home()
        return str(rover.come_to_rest())

    assert field.fly(mission) == "stopped and was disarmed"
    drives = [one for one in field.operations() if one.operation == "drive"]
    assert all(one.estimate_horizontal < 3.0 for one in drives)


def test_each_text_stands_in_the_trace_once() -> None:
    field = Field()
    field.fly(lambda drone: (drone.takeoff(5), drone.land()))
    texts = [event.text for event in field.recorded(Text)]
    assert texts.count("Arming motors") == 1


def test_the_same_flight_twice() -> None:
    def events() -> list[Any]:
        field = Field(faults=WireFaults(drop=0.05))
        field.fly(square)
        return field.events

    assert repr(events()) == repr(events())


def test_one_that_another_station_sends_elsewhere_is_not_sent_back() -> None:
    field = Field()
    latitude, longitude, _ = FRAME.from_enu((40.0, 0.0, 0.0))
    there = {"lat_int": round(latitude * 1e7), "lon_int": round(longitude * 1e7), "alt": 12.0}
    order = {"coordinate_frame": 6, "type_mask": 3576, **there}

    def mission(drone: Drone) -> None:
        drone.takeoff(10)
        field.station_sends("SET_POSITION_TARGET_GLOBAL_INT", 3.0, **order)
        began = field.kernel.now()
        with pytest.raises(Overridden, match="was sent elsewhere by another"):
            drone.goto(at(0, 90), speed=3.0)
        assert field.kernel.now() - began < 7 * S
        with pytest.raises(Overridden, match="another mode and then to GUIDED"):
            drone.land()
        sleep(field.kernel, 20 * S)
        east, north, _ = FRAME.to_enu(drone.position.latitude, drone.position.longitude, 900.0)
        assert (east, north) == (pytest.approx(40.0, abs=1.0), pytest.approx(0.0, abs=1.0))

    field.fly(mission)


@pytest.mark.parametrize(
    ("limits", "goal", "named"),
    [
        ({"FENCE_TYPE": 2, "FENCE_RADIUS": 60}, at(100, 0), "FENCE_RADIUS=60"),
        ({"FENCE_TYPE": 1, "FENCE_ALT_MAX": 30}, at(10, 0, 40), "FENCE_ALT_MAX=30"),
    ],
)
def test_a_goal_beyond_the_aircrafts_own_fence_is_refused_at_once(
    limits: dict[str, float], goal: Any, named: str
) -> None:
    field = Field(parameters={"FENCE_ENABLE": 1, **limits})

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        began = field.kernel.now()
        with pytest.raises(Refused, match=named):
            drone.goto(goal)
        assert field.kernel.now() - began < S
        drone.goto(at(20, 0))
        drone.land()

    field.fly(mission)
