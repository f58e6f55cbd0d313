"""Telemetry encoded as MAVLink messages; set-points and manual control decoded, without a flight."""

from __future__ import annotations

from math import isnan, nan, pi
from typing import Any

import pytest

from volery.base.errors import UsageError
from volery.base.frames import LocalFrame
from volery.base.position import AMSL, AboveGround, AboveHome, Position
from volery.base.time import S
from volery.bridge.mavlink_adapter.drone_commands import (
    ChannelsOverride,
    PositionTarget,
    VelocityTarget,
    global_target,
    local_target,
    manual_control_axes,
)
from volery.bridge.mavlink_adapter.telemetry_encoder import TelemetryEncoder
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.links.mavlink_codec import quantised
from volery.vehicles.driver import ManualControl
from volery.vehicles.telemetry import Attitude, Battery, Telemetry, Velocity

HOME = Position(46.0, -103.0, AMSL(900.0))
FRAME = LocalFrame(46.0, -103.0, 900.0)


class FakeDriver:
    """What a driver encoded of itself; nothing is known at first."""

    def __init__(self) -> None:
        self.kernel = VirtualKernel()
        self.telemetry = Telemetry(self.kernel, "driver")
        self.offboard_mode = "GUIDED"
        self.encoder = TelemetryEncoder(self.kernel, self)  # type: ignore[arg-type]  # no driver: it commands nothing

    def update(self, at: int = 5 * S, **facts: Any) -> None:
        for name, value in {
            "last_message_ns": at,
            "kind": "drone",
            "autopilot": "Paparazzi",
            **facts,
        }.items():
            setattr(self.telemetry, name, value)

    def encoded(self, name: str) -> Any:
        fields = self.encoder.encode_new(name)
        return None if fields is None else quantised(Frame(name, fields, 1, 1)).fields


@pytest.fixture
def driver() -> FakeDriver:
    return FakeDriver()


@pytest.fixture
def seen(driver: FakeDriver) -> Telemetry:
    """10 m north, 4 m up, looking east."""
    latitude, longitude, _ = FRAME.from_enu((0.0, 10.0, 0.0))
    driver.update(home=HOME, position=Position(latitude, longitude, AMSL(904.0)), above_home=4.0)
    driver.telemetry.attitude = Attitude(0.0, 0.0, 90.0)
    return driver.telemetry


def test_nothing_is_encoded_of_an_unknown_vehicle(driver: FakeDriver) -> None:
    assert [name for name in driver.encoder.messages if driver.encoded(name) is not None] == []


def test_unknown_values_are_omitted_or_marked(driver: FakeDriver) -> None:
    driver.update(mode="NAV")
    found = {name for name in driver.encoder.messages if driver.encoded(name) is not None}
    assert found == {"HEARTBEAT", "EXTENDED_SYS_STATE"}
    driver.update(battery=Battery(nan, 12.25, nan), position=HOME)
    status = driver.encoded("SYS_STATUS")
    known = (status["voltage_battery"], status["current_battery"], status["battery_remaining"])
    assert known == (12_250, -1, -1)
    fix = driver.encoded("GPS_RAW_INT")
    assert (fix["fix_type"], fix["satellites_visible"], fix["eph"], fix["vel"]) == (0, 255, 65_535, 65_535)
    assert driver.encoded("GLOBAL_POSITION_INT") is None  # how fast, how high?
    driver.update(velocity=Velocity(1.0, 2.0, -3.0), above_home=0.0)
    place = driver.encoded("GLOBAL_POSITION_INT")
    assert (place["alt"], place["vx"], place["vy"], place["vz"]) == (900_000, 100, 200, 300)
    assert place["hdg"] == 65_535
    assert driver.encoded("LOCAL_POSITION_NED") is None  # about where?
    assert driver.encoded("VFR_HUD") is None


def test_only_new_content_is_encoded_again(driver: FakeDriver, seen: Telemetry) -> None:
    driver.update(mode="NAV", velocity=Velocity(0.0, 0.0, 0.0))
    for name in ("HEARTBEAT", "GLOBAL_POSITION_INT", "ATTITUDE", "HOME_POSITION"):
        assert driver.encoded(name) is not None
        assert driver.encoded(name) is None
        assert driver.encoder.encode(name) is not None  # an explicit request
    driver.update(at=6 * S)
    assert driver.encoded("HEARTBEAT") is not None
    assert driver.encoded("GLOBAL_POSITION_INT") is None  # its content is unchanged
    here = seen.position
    assert here is not None
    driver.update(position=Position(here.latitude, here.longitude, here.altitude))
    assert driver.encoded("GLOBAL_POSITION_INT") is not None  # it encoded that it is still there


@pytest.mark.parametrize(
    ("facts", "autopilot", "mode", "base", "status"),
    [
        ({"mode": "NAV"}, 9, 13, 1, 3),
        ({"mode": "GUIDED", "armed": True, "flying": True}, 9, 19, 1 | 8 | 128, 4),
        ({"mode": "FAILSAFE", "armed": True, "failsafe": True}, 9, 1, 1 | 128, 5),
        ({"mode": "P_GPS", "autopilot": "DJI M600"}, 255, 6, 1, 3),
        ({"mode": "P_GPS by RC", "autopilot": "DJI M600"}, 255, 6, 1, 3),
        ({"mode": "MODE_35", "autopilot": "DJI M600"}, 255, 35, 1, 3),
        ({"mode": "LAND", "autopilot": "unknown"}, 0, 9, 1, 3),
    ],
)
def test_the_heartbeat_identifies_autopilot_and_mode(
    driver: FakeDriver, facts: dict[str, Any], autopilot: int, mode: int, base: int, status: int
) -> None:
    driver.update(**facts)
    beat = driver.encoded("HEARTBEAT")
    found = (beat["autopilot"], beat["type"], beat["custom_mode"], beat["base_mode"], beat["system_status"])
    assert found == (autopilot, 2, mode, base, status)


@pytest.mark.parametrize(
    ("fix", "kind"),
    [("no_fix", 1), ("3d", 3), ("rtk", 5), ("gps health 3", 1), ("gps health 5", 3), ("?", 0)],
)
def test_fix_types(driver: FakeDriver, fix: str, kind: int) -> None:
    driver.update(fix=fix, position=HOME, satellites=9)
    found = driver.encoded("GPS_RAW_INT")
    assert (found["fix_type"], found["satellites_visible"]) == (kind, 9)


def test_places_about_home(driver: FakeDriver, seen: Telemetry) -> None:
    driver.update(velocity=Velocity(1.0, 2.0, 3.0))
    local = driver.encoded("LOCAL_POSITION_NED")
    assert (local["x"], local["y"], local["z"]) == pytest.approx((10.0, 0.0, -4.0), abs=1e-3)
    assert (local["vx"], local["vy"], local["vz"]) == (1.0, 2.0, -3.0)
    home = driver.encoded("HOME_POSITION")
    assert (home["latitude"], home["altitude"], home["x"]) == (460_000_000, 900_000, 0.0)
    assert isnan(home["approach_x"])
    assert driver.encoded("GPS_GLOBAL_ORIGIN")["longitude"] == -1_030_000_000
    turned = driver.encoded("ATTITUDE")
    assert turned["yaw"] == pytest.approx(pi / 2)
    assert isnan(turned["rollspeed"])


def test_items_of_a_mission(driver: FakeDriver) -> None:
    driver.update(mission_item=3, mission_reached=2)
    assert driver.encoded("MISSION_CURRENT")["seq"] == 3
    assert driver.encoded("MISSION_ITEM_REACHED")["seq"] == 2
    assert driver.encoded("MISSION_ITEM_REACHED") is None


# -- set-points

POSITION, VELOCITY = 0x0DF8, 0x05C7
ZEROS = dict.fromkeys(("x", "y", "z", "vx", "vy", "vz", "yaw", "yaw_rate"), 0.0)


def local(frame: int, mask: int, **fields: float) -> dict[str, Any]:
    return {"coordinate_frame": frame, "type_mask": mask, **ZEROS, **fields}


@pytest.mark.parametrize(
    ("frame", "north", "east", "up"),
    [(1, 3.0, 2.0, 1.0), (7, 13.0, 2.0, 5.0), (8, 8.0, 3.0, 5.0), (9, 8.0, 3.0, 5.0), (12, 8.0, 3.0, 5.0)],
)
def test_a_place_by_its_frame(seen: Telemetry, frame: int, north: float, east: float, up: float) -> None:
    aim = local_target(local(frame, POSITION, x=3.0, y=2.0, z=-1.0), seen)
    assert isinstance(aim, PositionTarget)
    assert aim.goal.altitude == AboveHome(up)
    assert aim.heading is None
    there = FRAME.to_enu(aim.goal.latitude, aim.goal.longitude, 900.0)
    assert there[:2] == pytest.approx((east, north), abs=1e-3)


@pytest.mark.parametrize(("frame", "heading"), [(1, 30.0), (9, 120.0)])
def test_a_heading_counts_from_north_or_from_its_own(seen: Telemetry, frame: int, heading: float) -> None:
    aim = local_target(local(frame, POSITION & ~0x400, yaw=pi / 6), seen)
    assert isinstance(aim, PositionTarget)
    assert aim.heading == pytest.approx(heading)


def test_velocities_by_their_frame(seen: Telemetry) -> None:
    moving = {"vx": 3.0, "vy": 2.0, "vz": -1.0, "yaw_rate": pi / 2}
    aim = local_target(local(1, VELOCITY, **moving), seen)
    assert aim == VelocityTarget(Velocity(3.0, 2.0, 1.0), 90.0)
    turned = local_target(local(8, VELOCITY | 0x800, **moving), seen)
    assert isinstance(turned, VelocityTarget)
    assert turned.velocity == pytest.approx((-2.0, 3.0, 1.0))
    assert turned.yaw_rate == 0.0


@pytest.mark.parametrize(("frame", "kind"), [(0, AMSL), (5, AMSL), (6, AboveHome), (11, AboveGround)])
def test_altitudes_by_their_frame(seen: Telemetry, frame: int, kind: type) -> None:
    fields = {**local(frame, POSITION), "lat_int": 460_000_000, "lon_int": -1_030_000_000, "alt": 12.0}
    assert global_target(fields, seen) == PositionTarget(Position(46.0, -103.0, kind(12.0)), None)


@pytest.mark.parametrize("mask", [0x0FFF, POSITION | 1, VELOCITY | 8])
def test_incomplete_set_points_are_refused(seen: Telemetry, mask: int) -> None:
    with pytest.raises(UsageError, match="neither a whole position nor a whole velocity"):
        local_target(local(1, mask), seen)


def test_without_an_own_position_there_is_no_local_target(driver: FakeDriver) -> None:
    with pytest.raises(UsageError, match="not known yet"):
        local_target(local(1, POSITION), driver.telemetry)


# -- sticks


def channels(*pulses: int) -> dict[str, int]:
    return {f"chan{number}_raw": pulse for number, pulse in enumerate((*pulses, *[0] * 18)[:18], start=1)}


def test_channels_as_sticks() -> None:
    held = ChannelsOverride()
    assert held.update(channels(1600, 1250, 1000, 1400)) == ManualControl(
        0.5, 0.2, 0.0, -0.2
    )  # low pitch: forward
    assert held.update(channels(0, 65_535, 65_535, 65_535)) == ManualControl(0.5, 0.0, 0.0, -0.2)
    assert held.update(channels(65_535, 2_400, 0, 0)) == ManualControl(-1.0, 0.0, 0.5, 0.0)
    assert held.update(channels(0, 0, 0, 0)) is None


def test_axes_as_sticks() -> None:
    assert manual_control_axes({"x": 500, "y": -250, "z": 750, "r": 2_000}) == ManualControl(
        0.5, -0.25, 0.75, 1.0
    )
    assert manual_control_axes({"x": 32_767, "y": 0, "z": 32_767, "r": 0}) == ManualControl(
        0.0, 0.0, 0.5, 0.0
    )
