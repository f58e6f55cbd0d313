"""What ``connect`` waits for, and who may call the vehicle that it yields."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
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
        connect("sim:px4", within=2.0)


def test_it_can_be_connected_to_without_a_position() -> None:
    with connect("sim:px4", within=0.0) as drone:
        assert drone.kernel.now() < 3e9
        assert drone.telemetry.position is None


def test_it_needs_no_block_and_lands_when_it_is_closed() -> None:
    drone = connect("sim:ardupilot?start=warm")
    drone.takeoff(5)
    assert repr(drone).startswith("<Drone ardupilot: at 46.0825")
    assert "armed, 5." in repr(drone) or "armed, 4." in repr(drone)
    drone.close()
    assert not drone.telemetry.armed
    drone.close()
    with pytest.raises(UsageError, match="the connection is closed"):
        drone.takeoff(5)


def test_what_is_open_is_closed_when_python_exits() -> None:
    program = """
import atexit, volery
atexit.register(lambda: print("armed at the end:", drone.telemetry.armed, fleet["a"].telemetry.armed))
drone = volery.connect("sim:ardupilot?start=warm")
drone.takeoff(5)
fleet = volery.connect_fleet({"a": "sim:ardupilot?start=warm"})
fleet.takeoff(5)
raise SystemExit(f"armed: {drone.armed} {fleet['a'].armed}")
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.stdout == "armed at the end: False False\n"
    assert done.stderr.splitlines()[-1] == "armed: True True"


def test_sigterm_lands_the_vehicle_of_a_script() -> None:
    drone = connect("sim:ardupilot")
    drone.takeoff(5)
    with pytest.raises(KeyboardInterrupt):
        os.kill(os.getpid(), signal.SIGTERM)
    assert drone.flying
    drone.close()
    assert not drone.armed
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def test_two_connections_end_in_any_order() -> None:
    before = signal.getsignal(signal.SIGINT)
    first, second = connect("sim:px4?start=warm"), connect("sim:px4?start=warm")
    first.close()
    second.takeoff(3)
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)
    second.close()
    assert not second.telemetry.armed
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)
    signal.signal(signal.SIGINT, before)


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
