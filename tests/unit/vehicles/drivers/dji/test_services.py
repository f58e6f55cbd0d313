"""Gimbal and camera of the simulated DJI aircraft, by the names of both SDK nodes."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from rigs.missions import carried_out
from volery.base.errors import CapabilityError, NotArrived, Refused
from volery.base.position import AMSL, Position
from volery.base.time import MS
from volery.run.assembly.vehicles import OpenedVehicles, VehicleSettings, open_vehicles
from volery.simulation.autopilots.dji.flight_controller import controller_of
from volery.simulation.autopilots.dji.gimbal import Gimbal
from volery.vehicles import Drone
from volery.vehicles.external_pose import ExternalPose

LEVEL = [[0.01 if row == column else 0.0 for column in range(6)] for row in range(6)]

BOTH = pytest.mark.parametrize("names", ["dji_sdk", "dji_osdk_ros"])


class Aircraft:
    """One simulated aircraft and its drone."""

    def __init__(self, names: str = "dji_sdk") -> None:
        address = f"sim:dji?start=warm&names={names}"
        self.opened: OpenedVehicles = open_vehicles({"d": address}, {"d": Drone}, VehicleSettings())
        (vehicle,) = self.opened.vehicles
        assert isinstance(vehicle, Drone)
        self.drone = vehicle

    @property
    def gimbal(self) -> Gimbal:
        assert self.opened.fleet is not None
        return controller_of(self.opened.fleet.autopilots["d"].vehicle).gimbal

    def fly(self, mission: Callable[[Drone], None]) -> None:
        def flow() -> None:
            self.drone.wait_connected()
            mission(self.drone)

        try:
            carried_out(self.opened.kernel, flow, step=500 * MS)
        finally:
            self.drone.close()
            self.opened.kernel.close()


@BOTH
def test_the_gimbal_points_and_the_camera_takes_pictures(names: str) -> None:
    aircraft = Aircraft(names)
    seen: list[tuple[float, ...]] = []

    def mission(drone: Drone) -> None:
        assert aircraft.gimbal.angles() == (0.0, 0.0, 0.0)
        for pitch, yaw in ((-90.0, 0.0), (-20.0, 45.0), (30.0, -10.0)):
            drone.payload.point_gimbal(pitch, yaw)
            seen.append(aircraft.gimbal.angles())
        drone.payload.trigger_camera()
        drone.payload.trigger_camera()
        assert aircraft.gimbal.pictures == 2

    aircraft.fly(mission)
    assert [angles[1] for angles in seen] == pytest.approx([-90.0, -20.0, 30.0], abs=2.0)
    assert aircraft.gimbal.angles() == pytest.approx(
        (0.0, 30.0, -10.0), abs=15.0 if names == "dji_sdk" else 0.1
    )


def test_it_points_in_flight_and_tells_the_yaw_apart_from_the_pitch() -> None:
    aircraft = Aircraft("dji_osdk_ros")

    def mission(drone: Drone) -> None:
        drone.takeoff(5)
        drone.payload.point_gimbal(-45.0, 20.0)
        assert aircraft.gimbal.angles() == pytest.approx((0.0, -45.0, 20.0), abs=0.1)
        drone.land()

    aircraft.fly(mission)


def test_what_a_dji_does_not_offer() -> None:
    aircraft = Aircraft()

    def mission(drone: Drone) -> None:
        with pytest.raises(Refused, match="its pitch goes from -90 to 30 degrees"):
            drone.payload.point_gimbal(45.0)
        offers = "d: .*the SDK node of a DJI offers gimbal and camera only"
        for call in (
            drone.payload.open_gripper,
            lambda: drone.payload.set_servo(9, 1500),
            lambda: drone.payload.look_at(None),
            lambda: drone.parameters.get("RTL_ALT"),
            drone.parameters.all,
            drone.plan.download,
            drone.logs.list,
            drone.reboot,
            lambda: drone.send_corrections(b"\xd3\x00\x00\x47\xea\x4b"),
            lambda: drone.send_external_pose(ExternalPose(0, 0.0, 0.0, 0.0, 0.0, LEVEL)),
            lambda: drone.set_origin(Position(46.0, 8.0, AMSL(400.0))),
        ):
            with pytest.raises(CapabilityError, match=offers):
                call()

    aircraft.fly(mission)


def test_a_gimbal_that_does_not_follow_or_does_not_report(monkeypatch: pytest.MonkeyPatch) -> None:
    aircraft = Aircraft()
    monkeypatch.setattr(Gimbal, "point", lambda *_args, **_rest: None)

    def mission(drone: Drone) -> None:
        with pytest.raises(NotArrived, match="its pitch is 0 degrees after 3 commands"):
            drone.payload.point_gimbal(-90.0)

    aircraft.fly(mission)
