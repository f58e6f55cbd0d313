"""Thrust at its limit, the distance from what was commanded, and jumps of the estimate."""

from __future__ import annotations

from typing import Any

import pytest

from volery.base.errors import PositionLost, ThrustSaturated, VehicleError
from volery.base.frames import HomeFrame, LocalFrame
from volery.base.position import AMSL, Position
from volery.base.time import MS, S
from volery.kernel.virtual import VirtualKernel
from volery.testing.stage import SimulatedStage
from volery.trace.events import Operation, Text
from volery.vehicles import Drone, Limits, Velocity
from volery.vehicles.address import parse
from volery.vehicles.limits import Bounds
from volery.vehicles.monitors import FollowMonitor, StreamedSetpoint, ThrustMonitor, TrackMonitor
from volery.vehicles.telemetry import Attitude, Telemetry

HOME = Position(46.0825, -103.8995, AMSL(900.0))
FRAME = LocalFrame(HOME.latitude, HOME.longitude, 900.0)
BOUNDS = Bounds(HomeFrame(HOME), Limits(), None)
HOVERS_ONLY = 0.37
"""Share of the thrust of each motor that just carries the simulated airframe."""


def place(east: float, north: float, up: float = 10.0) -> Position:
    latitude, longitude, _ = FRAME.from_enu((east, north, 0.0))
    return Position(latitude, longitude, AMSL(900.0 + up))


class Reported:
    """A drone that reports its position ten times a second, in virtual time."""

    def __init__(self) -> None:
        self.kernel = VirtualKernel()
        self.kernel.every(10 * MS, lambda: None)  # time passes
        self.seen = Telemetry(self.kernel, "craft_1")
        self.seen.kind, self.seen.armed, self.seen.flying = "drone", True, True
        self.track = TrackMonitor(self.seen)
        self.at(0.0, 0.0)

    def at(self, east: float, north: float, up: float = 10.0, speed: float = 0.0) -> None:
        self.kernel.run(self.kernel.now() + 100 * MS)
        self.seen.note_message(self.kernel.now())
        self.seen.velocity = Velocity(speed, 0.0, 0.0)
        self.seen.update_position(place(east, north, up))

    def found(self, seconds: float, *where: float) -> VehicleError | None:
        """Return what is found in so many seconds at one place, to which its speed explains the way."""
        error = None
        for _ in range(round(seconds * 10)):
            self.at(*where, speed=500.0)
            error = error or self.track.check("go", self.kernel.now(), BOUNDS)
        return error


def test_off_the_path_for_three_seconds() -> None:
    drone = Reported()
    drone.track.follow(BOUNDS.path(place(0, 0), place(0, 100)))
    assert drone.found(5.0, 14.0, 40.0, 60.0) is None  # however high
    assert drone.found(2.5, 17.0, 40.0) is None
    assert drone.found(1.0, 3.0, 40.0) is None
    error = drone.found(3.5, 17.0, 40.0)
    assert "it is 17 m off its commanded path, beyond 15 m (Limits.off_track)" in str(error)


def test_a_vehicle_in_motion_may_overshoot_by_its_stopping_distance() -> None:
    drone = Reported()
    drone.at(0.0, 0.0, speed=12.0)
    drone.track.follow(BOUNDS.path(place(0, 0), place(100, 0)))
    assert drone.found(5.0, 0.0, 45.0) is None  # 12 m/s at 2 m/s^2: 36 m
    assert "beyond 51 m" in str(drone.found(5.0, 0.0, 53.0))


def test_at_a_place_the_height_counts() -> None:
    drone = Reported()
    drone.track.stay(BOUNDS)
    assert drone.found(5.0, 0.0, 0.0, 20.0) is None
    assert "off its commanded place" in str(drone.found(5.0, 0.0, 0.0, 30.0))


def test_a_jump_of_the_estimate_is_a_new_reference() -> None:
    drone = Reported()
    drone.track.stay(BOUNDS)
    drone.found(1.0, 0.0, 0.0)
    drone.at(0.0, 30.0)
    assert drone.track.check("go", drone.kernel.now(), BOUNDS) is None
    assert drone.track.jumped_m == pytest.approx(30.0, abs=0.1)
    assert drone.found(5.0, 0.0, 30.0) is None
    assert drone.track.jumped_m == 0.0


def test_what_its_velocity_explains_is_no_jump() -> None:
    drone = Reported()
    drone.track.stay(BOUNDS)
    for step in range(20):
        drone.at(0.0, 2.0 * step, speed=20.0)
        drone.track.check("go", drone.kernel.now(), BOUNDS)
        assert drone.track.jumped_m == 0.0


def test_the_way_of_a_vehicle_that_is_thrice_as_fast_is_no_jump() -> None:
    drone = Reported()
    drone.track.stay(BOUNDS)
    for step in range(80):
        drone.seen.update_clock(3 * drone.kernel.now())
        drone.at(0.0, 9.0 * step, speed=30.0)
        drone.track.check("go", drone.kernel.now(), BOUNDS)
        assert step < 60 or drone.track.jumped_m == 0.0  # the clocks are compared by then


def test_a_target_of_another_station_ends_it() -> None:
    drone = Reported()
    drone.track.stay(BOUNDS)
    drone.seen.target = place(60, 0)
    assert drone.found(10.0, 60.0, 0.0) is None


def test_an_old_or_unfixed_position_is_no_control_error() -> None:
    drone = Reported()
    drone.track.stay(BOUNDS)
    drone.seen.fix = "3d_fix"
    drone.seen.fix = "no_fix"
    assert drone.found(5.0, 60.0, 0.0) is None


def test_an_invalid_estimate_is_a_lost_position() -> None:
    drone = Reported()
    drone.seen.note_estimate(False)
    assert drone.seen.position_lost_for(drone.kernel.now()) == 0  # it never was valid
    drone.seen.note_estimate(True)
    drone.seen.note_estimate(False)
    drone.found(2.0, 0.0, 0.0)
    assert drone.seen.position_lost_for(drone.kernel.now()) == 2 * S
    assert not drone.seen.located
    drone.seen.note_estimate(True)
    assert drone.seen.located


@pytest.mark.parametrize(
    ("thrust", "up", "flying", "said"),
    [
        (0.97, 0.0, True, "it has been at 97% thrust for 3 s and does not climb"),
        (0.97, 0.0, False, "it has been at 97% thrust for 3 s and does not lift off"),
        (0.97, 3.0, True, ""),
        (0.90, -2.0, True, ""),
        (float("nan"), 0.0, True, ""),
    ],
)
def test_full_thrust_without_a_climb(thrust: float, up: float, flying: bool, said: str) -> None:
    drone = Reported()
    seen = drone.seen
    monitor, error = ThrustMonitor(seen), None
    for _ in range(40):
        drone.at(0.0, 0.0)
        seen.thrust, seen.flying, seen.velocity = thrust, flying, Velocity(0.0, 0.0, up)
        error = error or monitor.check("go", drone.kernel.now())
    assert (said in str(error)) if said else error is None


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4", "paparazzi"])
def test_a_drone_without_the_thrust_to_climb_is_landed(autopilot: str) -> None:
    stage = SimulatedStage(parse(f"sim:{autopilot}"), Drone, 3)
    raised: list[VehicleError] = []

    def flight() -> None:
        stage.drone.takeoff(10)
        for motor in range(4):
            stage.flight.weaken_motor(motor, HOVERS_ONLY)
        try:
            stage.drone.goto(stage.at(0.0, 0.0, 60.0))
        except VehicleError as error:
            raised.append(error)

    stage.perform(flight)
    assert isinstance(raised[0], ThrustSaturated), raised
    assert "it is on the ground" in str(raised[0])
    assert not stage.drone.armed
    stage.close()


@pytest.mark.parametrize("autopilot", ["paparazzi"])
def test_a_drone_that_loses_its_position_between_two_calls_is_landed(autopilot: str) -> None:
    stage = SimulatedStage(parse(f"sim:{autopilot}"), Drone, 3)
    raised: list[Any] = []

    def flight() -> None:
        stage.drone.takeoff(10)
        stage.flight.block_gps()
        stage.sleep(60.0)
        raised.append(stage.drone._operations.bounds_error)

    stage.perform(flight)
    assert isinstance(raised[0], PositionLost), raised
    landed = [one.asked for one in stage.events if isinstance(one, Operation) and one.operation == "land"]
    assert landed == ["land"]
    assert not [event for event in stage.events if isinstance(event, Text) and "jumped" in event.text]
    stage.close()


class Streamed(Reported):
    """A set-point each 200 ms for some seconds, and what the vehicle does meanwhile."""

    def __init__(self) -> None:
        super().__init__()
        self.follow = FollowMonitor(self.seen)

    def asked(
        self,
        demand: StreamedSetpoint,
        *,
        seconds: float = 6.0,
        moves: tuple[float, float, float] = (0.0, 0.0, 0.0),
        turns: float = 0.0,
        leans: tuple[float, float] = (0.0, 0.0),
    ) -> VehicleError | None:
        """Return the first error; *turns* is in degrees/s, *leans* are roll and pitch."""
        heading = 0.0
        for _ in range(round(seconds * 10)):
            self.at(0.0, 0.0)
            heading += turns / 10.0
            self.seen.velocity = Velocity(*moves)
            self.seen.attitude = Attitude(*leans, heading % 360.0)
            self.follow.ask(demand, S)
            error = self.follow.check("stream", self.kernel.now())
            if error is not None:
                return error
        return None


NORTH = StreamedSetpoint(velocity=(2.0, 0.0, 0.0), yaw_rate=0.0)
NOSE_DOWN = StreamedSetpoint(roll=0.0, pitch=-10.0, yaw_rate=0.0, thrust=0.5)


@pytest.mark.parametrize(
    ("demand", "said"),
    [
        (NORTH, r"in 3 s [56]\.\d m were asked for and 0\.0 m came"),
        (
            StreamedSetpoint(acceleration=(0.0, 1.0, 0.0), yaw_rate=0.0),
            r"[67]\.\d m were asked for and 0\.0 m came",
        ),
        (NOSE_DOWN, r"a lean of (9|10)\.\d degrees was asked for and 0\.0 came"),
        (
            StreamedSetpoint(velocity=(0.0, 0.0, 0.0), yaw_rate=30.0),
            r"a turn of \d+ degrees was asked for and 0\.0 came",
        ),
        (
            StreamedSetpoint(roll=0.0, pitch=0.0, heading=90.0, thrust=0.5),
            "a turn of 90 degrees was asked for",
        ),
        (StreamedSetpoint(roll=0.0, pitch=0.0, yaw_rate=0.0, thrust=0.9), "a climb by thrust was asked for"),
    ],
)
def test_a_vehicle_that_does_nothing_of_what_is_streamed(demand: StreamedSetpoint, said: str) -> None:
    streamed = Streamed()
    with pytest.raises(VehicleError, match=f"it does not follow its set-points: .*{said}"):
        raise streamed.asked(demand) or AssertionError("nothing was found")
    assert streamed.kernel.now() < 4 * S


@pytest.mark.parametrize(
    ("demand", "did"),
    [
        (NORTH, {"moves": (0.4, 0.0, 0.0)}),  # far too slow, but it follows
        (NOSE_DOWN, {"leans": (0.0, -4.0)}),
        (StreamedSetpoint(velocity=(0.0, 0.0, 0.0), yaw_rate=30.0), {"turns": 20.0}),
        (StreamedSetpoint(roll=0.0, pitch=0.0, heading=270.0, thrust=0.5), {"turns": -20.0, "seconds": 4.0}),
        (StreamedSetpoint(roll=0.0, pitch=0.0, yaw_rate=0.0, thrust=0.1), {"moves": (0.0, 0.0, -0.5)}),
        (
            StreamedSetpoint(velocity=(0.3, 0.0, 0.0), yaw_rate=0.0),
            {},
        ),  # as a law that holds a place against wind
        (StreamedSetpoint(velocity=(0.0, 0.0, 0.0), yaw_rate=0.0), {}),
        (StreamedSetpoint(velocity=(2.0, 0.0, 0.0), yaw_rate=20.0), {"turns": 20.0}),  # in part
    ],
)
def test_a_vehicle_that_follows_at_least_in_part(demand: StreamedSetpoint, did: dict[str, Any]) -> None:
    assert Streamed().asked(demand, **{"seconds": 12.0, **did}) is None


@pytest.mark.parametrize(
    ("demand", "moves", "turns"),
    [
        (NORTH, (0.6, 0.0, 0.0), 0.0),  # to and fro, as in front of a fence
        (NORTH, (0.0, 0.6, 0.0), 0.0),  # across
        (StreamedSetpoint(velocity=(0.0, 0.0, 0.0), yaw_rate=30.0), (0.0, 0.0, 0.0), 8.0),  # a noisy heading
    ],
)
def test_motion_to_and_fro_leads_nowhere(
    demand: StreamedSetpoint, moves: tuple[float, float, float], turns: float
) -> None:
    streamed = Streamed()
    found = []
    for number in range(20):
        sign = (-1.0) ** number
        swing = (moves[0] * sign, moves[1] * sign, moves[2] * sign)
        found.append(streamed.asked(demand, seconds=0.3, moves=swing, turns=turns * sign))
    assert any(found)


def test_a_fast_vehicle_that_is_asked_to_come_back_brakes_first() -> None:
    streamed = Streamed()
    speed = -15.0
    assert streamed.asked(NORTH, seconds=0.1, moves=(speed, 0.0, 0.0)) is None
    while speed < 2.0:
        speed += 0.25
        assert streamed.asked(NORTH, seconds=0.1, moves=(speed, 0.0, 0.0)) is None


def test_a_loop_that_asks_for_this_and_that_asks_for_nothing() -> None:
    streamed = Streamed()
    for number in range(40):
        back = StreamedSetpoint(velocity=((-1.0) ** number, 0.0, 0.0), yaw_rate=0.0)
        assert streamed.asked(back, seconds=0.2) is None


def test_a_step_after_a_rest_has_time_to_show_an_effect() -> None:
    """As a law asks for that has held a heading, and is to turn by 180 degrees now."""
    for rest_s in (2.8, 3.0, 9.9):
        streamed = Streamed()
        assert (
            streamed.asked(StreamedSetpoint(velocity=(0.0, 0.0, 0.0), yaw_rate=0.1), seconds=rest_s) is None
        )
        turn = StreamedSetpoint(velocity=(0.0, 0.0, 0.0), yaw_rate=170.0)
        assert streamed.asked(turn, seconds=0.5) is None
        assert streamed.asked(turn, seconds=10.0, turns=120.0) is None


def test_a_stream_that_has_ended_is_not_judged() -> None:
    streamed = Streamed()
    assert streamed.asked(NORTH, seconds=2.0) is None
    for _ in range(50):
        streamed.at(0.0, 0.0)
        assert streamed.follow.check("after", streamed.kernel.now()) is None
