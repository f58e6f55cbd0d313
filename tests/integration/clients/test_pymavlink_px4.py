"""pymavlink as scripts use it, at a served PX4: OFFBOARD by its own stream, on the link for programs."""

from __future__ import annotations

from collections.abc import Callable
from math import nan
from typing import Any

import pytest

pytestmark = pytest.mark.integration

POSITION_ONLY = 0b110111111000
LAND_MODE = 6 << 24 | 4 << 16
TEMPORARILY_REJECTED, UNSUPPORTED, FAILED = 1, 3, 4
PREARM = 1 << 28


@pytest.fixture(params=["tcp", "udp"])
def reached(request: Any, serve: Callable[..., Any], station: Callable[..., Any]) -> Any:
    """A station at a PX4 that has just been switched on."""
    vehicle = serve(request.param, 4.0, "--version", "1.14", autopilot="px4")
    where = f"127.0.0.1:{vehicle.port}"
    return station(f"tcp:{where}" if request.param == "tcp" else f"udpin:{where}")


def to(station: Any, north: float, down: float) -> Callable[[], None]:
    """Sends that set-point."""
    point = (0, 1, 1, 1, POSITION_ONLY, north, 0, down, 0, 0, 0, 0, 0, 0, 0, 0)
    return lambda: station.connection.mav.set_position_target_local_ned_send(*point)


def shown(station: Any, number: int) -> Any:
    return station.wait("HEARTBEAT", lambda beat: beat.get_srcComponent() == 1 and beat.custom_mode == number)


def test_from_boot_to_the_ground_again(reached: Any) -> None:
    beat = reached.wait("HEARTBEAT", lambda message: message.get_srcComponent() == 1)
    assert (beat.autopilot, beat.type) == (12, 2)
    assert reached.command(400, 1) == TEMPORARILY_REJECTED
    assert reached.command(115, 90, 20, 1) == UNSUPPORTED
    assert reached.command(511, 999, 100000) == FAILED
    reached.wait("SYS_STATUS", lambda status: status.onboard_control_sensors_health & PREARM)
    home = reached.wait("HOME_POSITION")
    assert reached.command(22, -1, 0, 0, nan, nan, nan, home.altitude / 1000.0 + 6.0) == 0
    assert reached.command(400, 1) == 0
    reached.wait_armed()
    reached.wait("EXTENDED_SYS_STATE", lambda state: state.landed_state == 2)
    assert reached.command(176, 1, 6) == TEMPORARILY_REJECTED
    reached.wait_text("Switching to OFFBOARD is currently not available")
    reached.streams = to(reached, 8.0, -6.0)
    while reached.command(176, 1, 6) == TEMPORARILY_REJECTED:
        reached.wait("LOCAL_POSITION_NED")  # it wants to have seen the stream for a while
    assert reached.wait("LOCAL_POSITION_NED", lambda place: place.x > 6.0).x < 12.0
    reached.streams = None
    assert reached.command(176, 1, 4, 6) == 0
    shown(reached, LAND_MODE)
    reached.wait_armed(False)
    assert reached.wait("EXTENDED_SYS_STATE").landed_state == 1
