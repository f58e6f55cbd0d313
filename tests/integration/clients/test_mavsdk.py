"""MAVSDK for Python at served vehicles: what works, and what fails as at a real ArduPilot and a real PX4."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from math import nan
from pathlib import Path
from typing import Any

import pytest

pytestmark = [
    pytest.mark.integration,
    pytest.mark.filterwarnings("ignore:The 'mavsdk' package has been renamed:FutureWarning"),
    pytest.mark.filterwarnings("ignore::DeprecationWarning:mavsdk"),
]

WITHIN_S = 200.0
ASKED = ("battery", "gps_info", "health", "home", "in_air", "position")
"""An ArduPilot streams nothing unasked over TCP, and MAVSDK does not ask by itself."""

NORTH, HOME_LATITUDE, HOME_LONGITUDE = 0.0002, 46.0825, -103.8995


@pytest.fixture(autouse=True)
def _installed(require: Callable[[str, str], None]) -> None:
    require("mavsdk", "mavsdk")


async def soon(awaited: Awaitable[Any]) -> Any:
    return await asyncio.wait_for(awaited, WITHIN_S)


async def first(stream: AsyncIterator[Any], holds: Callable[[Any], bool] = lambda value: True) -> Any:
    """The next value of the stream for which *holds*."""

    async def look() -> Any:
        async for value in stream:
            if holds(value):
                return value
        raise AssertionError("the stream has ended")

    return await soon(look())


@asynccontextmanager
async def connected(address: str, port: int, idle: str = "DISARM_DELAY") -> AsyncIterator[Any]:
    """A ``System`` that has found the vehicle; its server is a child, which ends here whatever happens.

    *idle* is the parameter after which an armed vehicle that does nothing disarms.
    """
    from mavsdk import System

    drone = System(port=port)
    try:
        await soon(drone.connect(system_address=address))
        await first(drone.core.connection_state(), lambda state: state.is_connected)
        if idle == "DISARM_DELAY":
            for rate in ASKED:
                await soon(getattr(drone.telemetry, f"set_rate_{rate}")(5.0))
            await soon(drone.param.set_param_int(idle, 0))  # a busy client is no idle pilot
        else:
            await soon(drone.param.set_param_float(idle, 0.0))
        yield drone
    finally:
        server = drone._server_process  # it has no public name, and outlives a test that fails
        drone._stop_mavsdk_server()
        if server is not None:
            server.wait(WITHIN_S)


async def until_ready(drone: Any) -> None:
    await first(
        drone.telemetry.health(),
        lambda health: health.is_global_position_ok and health.is_home_position_ok and health.is_armable,
    )


async def until_armed(drone: Any) -> None:
    """In a mode that needs a position, asked at each news of its health. All is healthy, to MAVSDK, before
    the autopilot knows where it is: those are the checks of STABILIZE, in which it boots.
    """
    from mavsdk.action import ActionError

    await until_ready(drone)

    async def tried() -> None:
        async for _ in drone.telemetry.health():
            with suppress(ActionError):
                await drone.action.hold()
                await drone.action.arm()
                return

    await soon(tried())


async def refused(awaited: Awaitable[Any], error: type[Exception]) -> str:
    """The name of the result with which MAVSDK reports that it did not work."""
    with pytest.raises(error) as caught:
        await soon(awaited)
    return str(caught.value._result.result.name)


async def logged(drone: Any, file: Path) -> None:
    """Download the only log by the log protocol."""
    (entry,) = await soon(drone.log_files.get_entries())
    async for _ in drone.log_files.download_log_file(entry, str(file)):
        pass
    assert file.stat().st_size == entry.size_bytes


async def flies(address: str, port: int, folder: Path) -> None:
    async with connected(address, port) as drone:
        telemetry, action = drone.telemetry, drone.action
        await until_ready(drone)
        assert not await first(telemetry.armed())
        assert not await first(telemetry.in_air())
        battery = await first(telemetry.battery())
        assert 11.0 < battery.voltage_v < 13.0
        home = await first(telemetry.home())
        assert abs(home.latitude_deg - HOME_LATITUDE) < 1e-4
        await soon(action.set_takeoff_altitude(8.0))
        assert await soon(action.get_takeoff_altitude()) == 8.0
        await until_armed(drone)
        await first(telemetry.armed(), bool)
        await soon(action.takeoff())
        start = await first(telemetry.position(), lambda position: position.relative_altitude_m > 7.5)
        assert await first(telemetry.in_air())
        goal = HOME_LATITUDE + NORTH
        await soon(action.goto_location(goal, HOME_LONGITUDE, start.absolute_altitude_m + 4.0, 0.0))
        there = await first(telemetry.position(), lambda position: abs(position.latitude_deg - goal) < 1e-5)
        assert abs(there.longitude_deg - HOME_LONGITUDE) < 3e-5
        assert str(await first(telemetry.flight_mode())) in {"HOLD", "OFFBOARD", "UNKNOWN"}
        await soon(action.return_to_launch())
        await first(telemetry.flight_mode(), lambda mode: str(mode) == "RETURN_TO_LAUNCH")
        await soon(action.land())
        await first(telemetry.flight_mode(), lambda mode: str(mode) == "LAND")
        await first(telemetry.armed(), lambda armed: not armed)
        assert not await first(telemetry.in_air(), lambda flying: not flying)
        await logged(drone, folder / "one.bin")


def assert_flown_at_12_m_or_returning(file: Path) -> None:
    """Read a DataFlash log as pymavlink does."""
    from pymavlink import DFReader

    log = DFReader.DFReader_binary(str(file))
    heights = []
    while (message := log.recv_match(type="POS")) is not None:
        heights.append(message.RelHomeAlt)
    assert 11.0 < max(heights) < 16.0  # its return climbs towards RTL_ALT, 15 m, until LAND has arrived


def test_a_flight_over_tcp(serve: Callable[..., Any], free_port: Callable[[], int], tmp_path: Path) -> None:
    asyncio.run(flies(f"tcpout://127.0.0.1:{serve('tcp', 15.0).port}", free_port(), tmp_path))
    assert_flown_at_12_m_or_returning(tmp_path / "one.bin")


def test_a_flight_over_udp(serve: Callable[..., Any], free_port: Callable[[], int], tmp_path: Path) -> None:
    asyncio.run(flies(f"udpin://127.0.0.1:{serve('udp', 15.0).port}", free_port(), tmp_path))
    assert_flown_at_12_m_or_returning(tmp_path / "one.bin")


async def plans(address: str, port: int) -> None:
    from mavsdk.mission_raw import MissionItem

    latitude, longitude = round((HOME_LATITUDE + NORTH) * 1e7), round(HOME_LONGITUDE * 1e7)
    items = [
        MissionItem(0, 0, 16, 1, 1, 0, 0, 0, 0, round(HOME_LATITUDE * 1e7), longitude, 900, 0),
        MissionItem(1, 3, 22, 0, 1, 0, 0, 0, 0, 0, 0, 8, 0),
        MissionItem(2, 3, 16, 0, 1, 0, 0, 0, 0, latitude, longitude, 8, 0),
        MissionItem(3, 3, 21, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0),
    ]
    async with connected(address, port) as drone:
        await soon(drone.mission_raw.upload_mission(items))
        kept = await soon(drone.mission_raw.download_mission())
        assert [(one.seq, one.command) for one in kept] == [(one.seq, one.command) for one in items]
        assert (kept[2].x, kept[2].y, kept[2].z) == (latitude, longitude, 8.0)
        await until_armed(drone)
        await soon(drone.action.set_takeoff_altitude(5.0))
        await soon(drone.action.takeoff())  # MAVSDK starts by the mode alone: AUTO stays on the ground then
        await first(drone.telemetry.position(), lambda position: position.relative_altitude_m > 4.5)
        await soon(drone.mission_raw.start_mission())
        there = HOME_LATITUDE + NORTH
        await first(drone.telemetry.position(), lambda position: abs(position.latitude_deg - there) < 2e-5)
        await first(drone.telemetry.armed(), lambda armed: not armed)


def test_a_raw_mission(serve: Callable[..., Any], free_port: Callable[[], int]) -> None:
    asyncio.run(plans(f"tcpout://127.0.0.1:{serve('tcp', 15.0).port}", free_port()))


async def asks(address: str, port: int) -> None:
    from mavsdk.param import ParamError

    async with connected(address, port) as drone:
        assert await soon(drone.param.get_param_int("FRAME_CLASS")) == 1
        assert await soon(drone.param.get_param_float("WP_SPD")) == 10.0
        await soon(drone.param.set_param_float("WP_SPD", 7.0))
        assert await soon(drone.param.get_param_float("WP_SPD")) == 7.0
        await refused(drone.param.get_param_float("NO_SUCH_NAME"), ParamError)
        version = await soon(drone.info.get_version())
        assert (version.flight_sw_major, version.flight_sw_minor, version.flight_sw_patch) == (4, 8, 0)


def test_parameters_and_version(serve: Callable[..., Any], free_port: Callable[[], int]) -> None:
    asyncio.run(asks(f"tcpout://127.0.0.1:{serve('tcp', 15.0).port}", free_port()))


async def fails(address: str, port: int) -> dict[str, str]:
    from mavsdk.action import ActionError, OrbitYawBehavior
    from mavsdk.mission import MissionError, MissionItem, MissionPlan
    from mavsdk.offboard import OffboardError, PositionNedYaw

    async with connected(address, port) as drone:
        action, found = drone.action, {}
        found["arm while it boots"] = await refused(action.arm(), ActionError)
        await until_ready(drone)
        found["take off unarmed"] = await refused(action.takeoff(), ActionError)
        circle = (9.0, 2.0, OrbitYawBehavior.HOLD_INITIAL_HEADING, HOME_LATITUDE, HOME_LONGITUDE, 910.0)
        found["orbit"] = await refused(action.do_orbit(*circle), ActionError)
        none, still = (nan,) * 5, (MissionItem.CameraAction.NONE, MissionItem.VehicleAction.NONE)
        point = (HOME_LATITUDE + NORTH, HOME_LONGITUDE, 10.0, 5.0, True, nan, nan)
        plan = MissionPlan([MissionItem(*point, still[0], *none, still[1])] * 2)
        await soon(drone.mission.upload_mission(plan))
        found["mission"] = await refused(drone.mission.download_mission(), MissionError)
        await soon(drone.offboard.set_position_ned(PositionNedYaw(0.0, 0.0, -5.0, 0.0)))
        with suppress(OffboardError):
            await soon(drone.offboard.start())
            found["offboard"] = "accepted"
    return found


def test_what_fails_as_at_a_real_ardupilot(serve: Callable[..., Any], free_port: Callable[[], int]) -> None:
    results = asyncio.run(fails(f"tcpout://127.0.0.1:{serve('tcp', 8.0).port}", free_port()))
    assert results == {
        "arm while it boots": "FAILED",
        "take off unarmed": "FAILED",
        "orbit": "UNSUPPORTED",
        "mission": "UNSUPPORTED",
        "offboard": "accepted",
    }


# --- PX4 --------------------------------------------------------------------------------------

PX4_IDLE = "COM_DISARM_PRFLT"
PX4_SPEED = 4.0
"""MAVSDK sends its set-points twenty times a second of real time: more than one a second must remain."""


def px4(serve: Callable[..., Any], version: str = "1.14") -> str:
    served = serve("udp", PX4_SPEED, "--version", version, autopilot="px4")
    return f"udpin://127.0.0.1:{served.port}"


async def filed(drone: Any, folder: Path) -> Path:
    """Download the only log of a PX4 by MAVLink FTP; return the file."""
    (day,) = (await soon(drone.ftp.list_directory("/log"))).dirs
    (name,) = (await soon(drone.ftp.list_directory(f"/log/{day}"))).files
    async for _ in drone.ftp.download(f"/log/{day}/{name}", str(folder), False):
        pass
    return folder / name


async def flies_px4(address: str, port: int, folder: Path) -> None:
    from mavsdk.offboard import PositionNedYaw, VelocityBodyYawspeed
    from pyulog import ULog

    async with connected(address, port, PX4_IDLE) as drone:
        telemetry, action, offboard = drone.telemetry, drone.action, drone.offboard
        await until_ready(drone)
        await soon(action.set_takeoff_altitude(6.0))
        await soon(action.arm())
        await soon(action.takeoff())
        await first(telemetry.in_air(), bool)
        # home's altitude follows the receiver
        up = await first(telemetry.position(), lambda position: position.relative_altitude_m > 3.0)
        await first(telemetry.flight_mode(), lambda mode: str(mode) == "HOLD")
        goal = HOME_LATITUDE + NORTH
        await soon(action.goto_location(goal, HOME_LONGITUDE, up.absolute_altitude_m + 3.0, 0.0))
        await first(telemetry.position(), lambda position: abs(position.latitude_deg - goal) < 1e-5)
        await soon(offboard.set_position_ned(PositionNedYaw(10.0, 5.0, -8.0, 0.0)))
        await soon(offboard.start())
        await first(telemetry.flight_mode(), lambda mode: str(mode) == "OFFBOARD")
        await first(telemetry.position_velocity_ned(), lambda seen: abs(seen.position.north_m - 10.0) < 1.0)
        await soon(offboard.set_velocity_body(VelocityBodyYawspeed(0.0, 0.0, 0.0, 0.0)))
        await soon(offboard.stop())
        await first(telemetry.flight_mode(), lambda mode: str(mode) == "HOLD")
        await soon(action.land())
        await first(telemetry.armed(), lambda armed: not armed)
        assert not await first(telemetry.in_air(), lambda flying: not flying)
        await logged(drone, folder / "one.ulg")
        same = await filed(drone, folder)
        assert same.read_bytes() == (folder / "one.ulg").read_bytes()
    local = ULog(str(same)).get_dataset("vehicle_local_position").data
    assert 7.5 < max(-local["z"]) < 10.0
    assert max(local["x"]) > 18.0


def test_a_flight_of_px4(serve: Callable[..., Any], free_port: Callable[[], int], tmp_path: Path) -> None:
    asyncio.run(flies_px4(px4(serve, "1.17"), free_port(), tmp_path))


async def plans_px4(address: str, port: int) -> None:
    from mavsdk.mission import MissionItem, MissionPlan

    still = (MissionItem.CameraAction.NONE, MissionItem.VehicleAction.NONE)
    rest = (nan, True, nan, nan, still[0], nan, nan, nan, nan, nan, still[1])
    points = [(HOME_LATITUDE + NORTH * share, HOME_LONGITUDE, 6.0) for share in (0.5, 1.0)]
    plan = MissionPlan([MissionItem(*point, *rest) for point in points])
    async with connected(address, port, PX4_IDLE) as drone:
        await until_ready(drone)
        await soon(drone.mission.set_return_to_launch_after_mission(True))
        await soon(drone.mission.upload_mission(plan))
        kept = (await soon(drone.mission.download_mission())).mission_items
        assert [round(one.latitude_deg, 7) for one in kept] == [round(point[0], 7) for point in points]
        await soon(drone.action.arm())
        await soon(drone.mission.start_mission())
        await first(drone.telemetry.in_air(), bool)
        await first(drone.mission.mission_progress(), lambda done: done.current == 1)
        await first(drone.telemetry.flight_mode(), lambda mode: str(mode) == "RETURN_TO_LAUNCH")
        assert await soon(drone.mission.is_mission_finished())


def test_a_mission_of_px4(serve: Callable[..., Any], free_port: Callable[[], int]) -> None:
    asyncio.run(plans_px4(px4(serve), free_port()))


async def fails_px4(address: str, port: int) -> dict[str, str]:
    from mavsdk.action import ActionError
    from mavsdk.offboard import OffboardError
    from mavsdk.param import ParamError

    found = {}
    async with connected(address, port, PX4_IDLE) as drone:
        found["arm while it boots"] = await refused(drone.action.arm(), ActionError)
        await until_ready(drone)
        found["offboard without a set-point"] = await refused(drone.offboard.start(), OffboardError)
        found["reboot"] = await refused(drone.action.reboot(), ActionError)
        await refused(drone.param.get_param_float("NO_SUCH_NAME"), ParamError)
        assert await soon(drone.param.get_param_int("COM_OBL_RC_ACT")) == 0
        await soon(drone.param.set_param_int("COM_OBL_RC_ACT", 5))
        assert await soon(drone.param.get_param_int("COM_OBL_RC_ACT")) == 5
        version = await soon(drone.info.get_version())
        assert (version.flight_sw_major, version.flight_sw_minor, version.flight_sw_patch) == (1, 14, 0)
        await soon(drone.action.arm())
        await soon(drone.action.takeoff())
        await first(drone.telemetry.in_air(), bool)
        found["disarm in the air"] = await refused(drone.action.disarm(), ActionError)
        await soon(drone.action.kill())
        await first(drone.telemetry.armed(), lambda armed: not armed)
    return found


def test_what_fails_as_at_a_real_px4(serve: Callable[..., Any], free_port: Callable[[], int]) -> None:
    results = asyncio.run(fails_px4(px4(serve), free_port()))
    assert results["offboard without a set-point"] == "NO_SETPOINT_SET"
    assert results["arm while it boots"] in {"COMMAND_DENIED", "FAILED"}
    assert set(results.values()) & {"SUCCESS"} == set()
