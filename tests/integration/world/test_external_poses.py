"""Flights without satellites, by external poses: on both autopilots, and what ends them safely."""

from __future__ import annotations

from math import degrees, dist

import pytest

from rigs.airstrip import FRAME, Airstrip, at
from volery.base.errors import NotArrived, PositionLost, VehicleError
from volery.base.position import AMSL, Position
from volery.base.time import MS, S
from volery.kernel.waiting import sleep
from volery.vehicles import Drone
from volery.vehicles.drivers.ardupilot import open_driver as open_ardupilot
from volery.vehicles.drivers.px4 import open_driver as open_px4
from volery.vehicles.external_pose import ExternalPose

ARDUPILOT = {"VISO_TYPE": 1, "EK3_SRC1_POSXY": 6, "EK3_SRC1_VELXY": 0, "EK3_SRC1_VELZ": 0, "GPS1_TYPE": 0}
PX4 = {"EKF2_EV_CTRL": 1, "EKF2_GPS_CTRL": 0}
VARIANCES = (0.0025, 0.0025, 0.01, 0.001, 0.001, 0.003)
COVARIANCE = [[one if row == column else 0.0 for column in range(6)] for row, one in enumerate(VARIANCES)]
ORIGIN = Position(FRAME.latitude, FRAME.longitude, AMSL(FRAME.amsl))


class Hall(Airstrip):
    """A vehicle that sees no satellites; a program tells it 20 times a second where it is."""

    def __init__(self, firmware: str, **parameters: float) -> None:
        self.firmware = firmware
        self.opener = open_px4 if firmware == "px4" else open_ardupilot
        given = PX4 if firmware == "px4" else ARDUPILOT
        super().__init__(parameters={**given, **parameters})
        self.flight.block_gps(True)
        self.sends, self.off, self.frozen, self.late = True, (0.0, 0.0), False, 0
        self.resets, self.watched = 0, True
        self.refused: list[VehicleError] = []
        self._kept: list[tuple[int, tuple[float, ...]]] = []

    def begin(self, drone: Drone) -> None:
        """Connect, begin to send poses, set the origin."""
        drone.set_origin(ORIGIN)
        self.kernel.every(50 * MS, lambda: self._send(drone))

    def _send(self, drone: Drone) -> None:
        truth = self.flight.truth()
        east, north, up = truth.position
        if not self.frozen:
            heading = (90.0 - degrees(truth.attitude[2])) % 360.0
            here = north + self.off[0], east + self.off[1], up, heading
            self._kept = [*self._kept[-20:], (self.kernel.now(), here)]
        behind = self.late // (50 * MS)
        if len(self._kept) <= behind:
            return
        time, here = self._kept[-1 - behind]
        time = self.kernel.now() if self.frozen else time
        if self.sends:
            send = drone.send_external_pose if self.watched else drone._driver.services.send_external_pose
            try:
                send(ExternalPose(time, *here, COVARIANCE, resets=self.resets))
            except PositionLost as error:
                self.refused.append(error)

    def said(self) -> list[str]:
        return [one.text for one in self.vehicle._driver.telemetry.texts]

    def said_at(self, words: str) -> float:
        texts = self.vehicle._driver.telemetry.texts
        return next(one.at / S for one in texts if words in one.text)

    def apart(self) -> float:
        """Distance in the plane between the truth and what the vehicle states."""
        place = self.vehicle.position
        east, north, _ = FRAME.to_enu(place.latitude, place.longitude, FRAME.amsl)
        return dist((east, north), self.flight.truth().position[:2])


BOTH = pytest.mark.parametrize("firmware", ["ardupilot", pytest.param("px4", marks=pytest.mark.long)])


def up_and_away(hall: Hall, drone: Drone) -> None:
    hall.begin(drone)
    drone.wait_ready()
    drone.takeoff(5)
    drone.goto(at(10, 5, 5))


def hold_there(hall: Hall, drone: Drone) -> None:
    for _ in range(30):
        sleep(hall.kernel, S)
        drone.goto(at(10, 5, 5))


def wait_down(hall: Hall, drone: Drone) -> None:
    for _ in range(60):
        if not drone.armed:
            return
        sleep(hall.kernel, S)
    raise AssertionError("it is still in the air")


@BOTH
def test_a_flight_by_poses_alone(firmware: str) -> None:
    hall = Hall(firmware)

    def mission(drone: Drone) -> tuple[float, float]:
        up_and_away(hall, drone)
        sleep(hall.kernel, 5 * S)
        apart, off = hall.apart(), dist(hall.flight.truth().position[:2], (10.0, 5.0))
        drone.land()
        return apart, off

    apart, off = hall.fly(mission)
    assert apart < 0.3
    assert off < 0.5
    if firmware == "ardupilot":
        assert "EKF3 IMU0 is using external nav data" in hall.said()


@BOTH
def test_an_origin_may_be_elsewhere_than_the_world_has_it(firmware: str) -> None:
    hall = Hall(firmware)

    def mission(drone: Drone) -> Position:
        drone.set_origin(Position(50.0, 8.0, AMSL(300.0)))
        hall.kernel.every(50 * MS, lambda: hall._send(drone))
        drone.wait_ready()
        home = drone.home
        drone.takeoff(3)
        drone.land()
        with pytest.raises(NotArrived, match="it has another one"):
            drone.set_origin(ORIGIN)
        return home

    home = hall.fly(mission)
    assert (home.latitude, home.longitude) == pytest.approx((50.0, 8.0), abs=1e-5)
    assert home.altitude.metres == pytest.approx(300.0, abs=0.5)


@BOTH
def test_without_poses_or_origin_it_does_not_get_ready(firmware: str) -> None:
    hall = Hall(firmware)

    def mission(drone: Drone) -> str:
        with pytest.raises(VehicleError) as raised:
            drone.wait_ready(within=8.0)
        return str(raised.value)

    why = hall.fly(mission)
    assert "VisOdom: not healthy" in why or "GPS" in why


@BOTH
def test_poses_that_stay_away_let_it_land(firmware: str) -> None:
    """PX4 acts after 4.7 s; ArduPilot gives the position up after 7 s, acts a second later, sinks 4 s later.

    An ArduCopter 4.6.3 in its own simulator went to LAND after 8.0 s, stopped aiding after 15.0 s, and was
    down after 22.5 s.
    """
    hall = Hall(firmware)

    def mission(drone: Drone) -> float:
        up_and_away(hall, drone)
        hall.sends, since = False, hall.kernel.now() / S
        with pytest.raises(VehicleError):
            hold_there(hall, drone)
        wait_down(hall, drone)
        return since

    since = hall.fly(mission)
    if firmware == "px4":
        assert hall.said_at("Failsafe activated") - since == pytest.approx(4.7, abs=0.15)
    else:
        assert hall.said_at("EKF Failsafe: changed to LAND Mode") - since == pytest.approx(8.3, abs=0.3)
        assert hall.said_at("EKF3 IMU0 stopped aiding") - since == pytest.approx(15.0, abs=0.2)
        assert hall.said_at("SIM Hit ground") - since == pytest.approx(22.5, abs=0.6)
    assert dist(hall.flight.truth().position[:2], (10.0, 5.0)) < 4.0


@BOTH
def test_poses_that_jump_are_not_sent_and_it_lands(firmware: str) -> None:
    hall = Hall(firmware)

    def mission(drone: Drone) -> None:
        up_and_away(hall, drone)
        hall.off = (5.0, 0.0)
        wait_down(hall, drone)

    hall.fly(mission)
    assert "they are not sent" in str(hall.refused[0])
    assert dist(hall.flight.truth().position[:2], (10.0, 5.0)) < 4.0


@pytest.mark.parametrize(("metres", "seconds"), [(3.0, 3.4), (5.0, 4.6), (15.0, 7.0)])
def test_a_jump_is_taken_by_ardupilot_once_its_estimate_is_unsure(metres: float, seconds: float) -> None:
    """Of a program that does not compare poses and velocity; the times are those of an ArduCopter 4.6.3."""
    hall = Hall("ardupilot")
    hall.watched = False

    def mission(drone: Drone) -> float:
        up_and_away(hall, drone)
        sleep(hall.kernel, 5 * S)
        hall.off, since = (metres, 0.0), hall.kernel.now()
        while hall.apart() < 0.6 * metres:
            assert hall.kernel.now() - since < 20 * S, "it never takes them"
            sleep(hall.kernel, 50 * MS)
        return (hall.kernel.now() - since) / S

    assert hall.fly(mission) == pytest.approx(seconds, abs=0.5)


@BOTH
def test_a_jump_that_its_source_announces_counts(firmware: str) -> None:
    hall = Hall(firmware)

    def mission(drone: Drone) -> tuple[float, ...]:
        up_and_away(hall, drone)
        sleep(hall.kernel, 3 * S)
        hall.off, hall.resets = (2.0, 0.0), 1
        sleep(hall.kernel, 10 * S)
        truth = hall.flight.truth().position
        drone.land()
        return truth

    truth = hall.fly(mission)
    assert not hall.refused
    assert truth[:2] == pytest.approx((10.0, 3.0), abs=0.5)


@BOTH
def test_poses_that_freeze_are_not_sent_and_it_lands(firmware: str) -> None:
    hall = Hall(firmware)

    def mission(drone: Drone) -> None:
        up_and_away(hall, drone)
        hall.frozen = True
        with pytest.raises(VehicleError):
            drone.goto(at(-20, -10, 5))
        wait_down(hall, drone)

    hall.fly(mission)
    assert "they have not changed" in str(hall.refused[0])
    assert abs(hall.flight.truth().position[0]) < 40.0


@BOTH
def test_poses_that_freeze_in_hover_are_not_sent(firmware: str) -> None:
    """A PX4 1.17 flew 50 m within 40 s so, while it stated that it stood."""
    hall = Hall(firmware)

    def mission(drone: Drone) -> None:
        up_and_away(hall, drone)
        sleep(hall.kernel, 3 * S)
        hall.frozen = True
        wait_down(hall, drone)

    hall.fly(mission)
    assert "have not changed in the least for 1.0 s" in str(hall.refused[0])
    assert dist(hall.flight.truth().position[:2], (10.0, 5.0)) < 4.0


@BOTH
def test_poses_of_a_late_source_need_its_delay(firmware: str) -> None:
    """ArduPilot takes the quickest pose for one without delay, and is told the delay; PX4 learns the time."""
    told = {"VISO_DELAY_MS": 200} if firmware == "ardupilot" else {}

    def lag(parameters: dict[str, float]) -> float:
        hall = Hall(firmware, **parameters)
        hall.late = 200 * MS

        def mission(drone: Drone) -> None:
            hall.begin(drone)
            drone.wait_ready()
            drone.takeoff(5)
            drone.goto(at(30, 0, 5), speed=4.0)

        errors: list[float] = []
        hall.kernel.every(100 * MS, lambda: errors.append(_error(hall)))
        hall.fly(mission)
        return max(errors)

    assert lag(told) < 0.35
    if firmware == "ardupilot":
        assert lag({}) > 0.6


def _error(hall: Hall) -> float:
    """Error of the estimate itself along the way to the east."""
    estimate = hall.flight.estimate()
    return abs(estimate.position[1] - hall.flight.truth().position[0]) if estimate.position_ok else 0.0
