"""What ``connect`` waits for, and who may call the vehicle that it yields."""

from __future__ import annotations

import threading

import pytest

from volery.base.errors import NotArrived, UsageError
from volery.run.connect import connect, connect_fleet


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4", "paparazzi", "dji"])
def test_it_knows_where_it_is(autopilot: str) -> None:
    with connect(f"sim:{autopilot}") as drone:
        assert drone.position.latitude == pytest.approx(drone.home.latitude, abs=1e-3)


def test_what_is_missing_is_named_with_the_remedy() -> None:
    with pytest.raises(NotArrived, match=r"not reported its position \(its GPS .*wait of 0 s"):
        connect("sim:px4", within=2.0).__enter__()


def test_it_can_be_connected_to_without_a_position() -> None:
    with connect("sim:px4", within=0.0) as drone:
        assert drone.kernel.now() < 3e9
        assert drone.telemetry.position is None


def test_a_fleet_knows_where_it_is() -> None:
    with connect_fleet({"a": "sim:px4", "b": "sim:paparazzi"}) as fleet:
        assert all(fleet[name].position for name in fleet)


def test_a_thread_cannot_pass_virtual_time_and_is_told_what_to_do() -> None:
    said: list[str] = []

    def rise() -> None:
        for call in (lambda: drone.takeoff(5), fleet.land):
            with pytest.raises(UsageError) as caught:
                call()
            said.append(str(caught.value))

    with connect_fleet({"a": "sim:px4"}) as fleet:
        drone = fleet["a"]
        thread = threading.Thread(target=rise)
        thread.start()
        thread.join()
        assert not drone.armed
    assert len(said) == 2
    assert all("Fleet.each()" in one for one in said)
