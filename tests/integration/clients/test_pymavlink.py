"""pymavlink as scripts use it: ``mavutil`` connections over TCP and UDP to a served vehicle."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.integration

HOME = (46.0825, -103.8995)
POSITION_ONLY = 0b110111111000
"""Type mask of SET_POSITION_TARGET: velocity, acceleration and yaw are left alone."""

REFUSED = 4
WAYPOINT, LAND, TAKEOFF, MISSION_START = 16, 21, 22, 300
COUNT_OF_PARAMETERS = 1372


def tcp(port: int) -> str:
    return f"tcp:127.0.0.1:{port}"


@pytest.fixture(params=["tcp", "udp"])
def reached(request: Any, serve: Callable[..., Any], station: Callable[..., Any]) -> Any:
    """A station at a vehicle that has just been switched on."""
    vehicle = serve(request.param)
    return station(tcp(vehicle.port) if request.param == "tcp" else f"udpin:127.0.0.1:{vehicle.port}")


@pytest.fixture
def tower(serve: Callable[..., Any], station: Callable[..., Any]) -> Any:
    """A station at a vehicle, over TCP."""
    return station(tcp(serve().port))


def test_from_boot_to_the_ground_again(reached: Any) -> None:
    beat = reached.meet()
    assert (beat.autopilot, beat.type) == (3, 2)
    assert reached.arm() == REFUSED
    reached.wait_text("Arm: ")
    reached.wait_ready()
    assert reached.mode("GUIDED") == 0
    assert reached.arm() == 0
    reached.wait_armed()
    assert reached.takeoff(10.0) == 0
    latitude = round((HOME[0] + 0.0003) * 1e7)
    longitude = round(HOME[1] * 1e7)
    reached.connection.mav.set_position_target_global_int_send(
        0, 1, 1, 6, POSITION_ONLY, latitude, longitude, 15.0, 0, 0, 0, 0, 0, 0, 0, 0
    )
    there = reached.wait("GLOBAL_POSITION_INT", lambda message: abs(message.lat - latitude) < 100)
    assert abs(there.lon - longitude) < 300
    reached.wait_height(15.0)
    assert reached.mode("LAND") == 0
    reached.wait_armed(False)
    assert reached.wait("GLOBAL_POSITION_INT").relative_alt < 1000


def test_parameters_are_listed_read_and_set(tower: Any) -> None:
    tower.meet()
    tower.connection.param_fetch_all()
    indices: dict[int, str] = {}

    def complete(message: Any) -> bool:
        if message.param_index < message.param_count:
            indices[message.param_index] = message.param_id
        return len(indices) == message.param_count

    assert tower.wait("PARAM_VALUE", complete).param_count == COUNT_OF_PARAMETERS
    assert len(set(indices.values())) == COUNT_OF_PARAMETERS
    assert tower.connection.params["FRAME_CLASS"] == 1

    def is_speed(message: Any) -> bool:
        return bool(message.param_id == "WP_SPD")

    tower.connection.param_fetch_one("WP_SPD")
    assert tower.wait("PARAM_VALUE", is_speed).param_value == 10
    tower.connection.param_set_send("WP_SPD", 6.5)
    assert tower.wait("PARAM_VALUE", is_speed).param_value == 6.5
    tower.connection.param_fetch_one("WP_SPD")
    assert tower.wait("PARAM_VALUE", is_speed).param_value == 6.5


def item(station: Any, place: int, frame: int, command: int, north: float, height: float) -> Any:
    """A mission item north of home; without *north* it has no place."""
    at = (round((HOME[0] + north) * 1e7), round(HOME[1] * 1e7)) if north else (0, 0)
    return station.mavlink.MAVLink_mission_item_int_message(
        1, 1, place, frame, command, 0, 1, 0, 0, 0, 0, *at, height
    )


def upload(station: Any, items: list[Any]) -> int:
    """Answer each request; the type of the acknowledgement."""
    station.connection.waypoint_count_send(len(items))
    while True:
        asked = station.wait(("MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK"))
        if asked.get_type() == "MISSION_ACK":
            return int(asked.type)
        station.connection.mav.send(items[asked.seq])


def download(station: Any) -> list[Any]:
    mav = station.connection.mav
    mav.mission_request_list_send(1, 1)
    count = station.wait("MISSION_COUNT").count
    items = []
    for place in range(count):
        mav.mission_request_int_send(1, 1, place)
        items.append(station.wait("MISSION_ITEM_INT", lambda one, place=place: one.seq == place))
    mav.mission_ack_send(1, 1, 0)
    return items


def test_a_mission_is_uploaded_and_flown_in_auto(tower: Any) -> None:
    tower.meet()
    items = [
        item(tower, 0, 0, WAYPOINT, 1e-7, 900),
        item(tower, 1, 3, TAKEOFF, 0, 8),
        item(tower, 2, 3, WAYPOINT, 0.0002, 12),
        item(tower, 3, 3, LAND, 0, 0),
    ]
    assert upload(tower, items) == 0
    kept = download(tower)
    assert [(one.command, one.z) for one in kept[1:]] == [(one.command, one.z) for one in items[1:]]
    assert kept[2].x == items[2].x
    tower.wait_ready()
    assert tower.mode("GUIDED") == 0
    assert tower.arm() == 0
    assert tower.mode("AUTO") == 0
    assert tower.command(MISSION_START) == 0
    for place in (1, 2):
        tower.wait("MISSION_ITEM_REACHED", lambda reached, place=place: reached.seq == place)
    tower.wait_armed(False)


def test_sticks_over_the_link_climb_and_are_released(tower: Any) -> None:
    tower.meet()
    tower.wait_ready()
    assert tower.mode("LOITER") == 0
    tower.connection.param_set_send("RC_OVERRIDE_TIME", 60)  # three real seconds
    override = tower.connection.mav.rc_channels_override_send

    def hold(throttle: int, until: Callable[[Any], bool]) -> Any:
        """Send the sticks with each position that comes, as long as it takes."""

        def again(message: Any) -> bool:
            override(1, 1, 1500, 1500, throttle, 1500, 0, 0, 0, 0)
            return until(message)

        return tower.wait("GLOBAL_POSITION_INT", again)

    hold(1000, lambda message: True)
    assert tower.arm() == 0
    hold(1000, lambda message: True)
    hold(1800, lambda message: message.relative_alt > 3000)
    hold(1500, lambda message: abs(message.vz) < 20)
    channels = tower.wait("RC_CHANNELS", lambda message: message.chan3_raw == 1500)
    assert channels.chancount >= 4
    hold(1200, lambda message: message.relative_alt < 1500)


def test_two_clients_at_once_share_the_vehicle(
    serve: Callable[..., Any], station: Callable[..., Any]
) -> None:
    port = serve().port
    first, second = station(tcp(port)), station(tcp(port), 254)
    first.airborne(6.0)
    second.meet()
    second.wait_armed()
    second.wait_height(6.0)
    assert second.mode("LAND") == 0
    first.wait("HEARTBEAT", lambda beat: beat.get_srcComponent() == 1 and beat.custom_mode == 9)
    first.wait_armed(False)


def test_a_client_that_returns_finds_its_streams(
    serve: Callable[..., Any], station: Callable[..., Any]
) -> None:
    """As on a serial line, what was asked for stays asked for; the flight goes on meanwhile."""
    port = serve().port
    first = station(tcp(port))
    first.airborne(6.0)
    first.close()
    again = station(tcp(port))
    again.wait("GLOBAL_POSITION_INT", lambda message: abs(message.relative_alt - 6000) < 700)
    again.wait_armed()
    assert again.mode("LAND") == 0
    again.wait_armed(False)


def test_all_parameters_are_read_as_one_file(tower: Any, tmp_path: Path) -> None:
    """By MAVLink FTP, as ground stations read them where the autopilot states the capability."""
    from pymavlink.mavftp import MAVFTP

    tower.meet()
    client = MAVFTP(tower.connection, 1, 1)
    file = tmp_path / "all.param"
    client.cmd_getparams([str(file)])
    client.process_ftp_reply("getparams", timeout=200)
    lines = file.read_text(encoding="utf-8").splitlines()
    assert len(lines) == COUNT_OF_PARAMETERS
    values = dict(line.replace(",", " ").split()[:2] for line in lines)
    assert float(values["WP_SPD"]) == 10.0
