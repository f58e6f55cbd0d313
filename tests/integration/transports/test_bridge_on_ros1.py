"""``volery ros bridge`` on a real roscore: the session of a thesis with Debian's tools, flights behind
MAVROS's names, and autopilots that go by these without speaking MAVLink.

The simulated vehicles live four times as fast as real time.
"""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import time
import tty
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import volery
from volery.links.frame import Frame
from volery.links.mavlink_codec import MAVLINK, encode
from volery.ros.transports.ros1 import Roscore
from volery.ros.transports.ros1.rospy_copy import write_package

from .conftest import LIMIT_S, Run
from .test_dji_on_ros1 import COMMAND

pytestmark = pytest.mark.integration

Start = Callable[..., Any]


def bridged(start: Start, *options: str) -> Any:
    """A bridge that hears its vehicle."""
    bridge = start(*COMMAND, "ros", "bridge", *options, "--speed", "4")
    said = ""
    while "disarmed" not in said:
        line = bridge.stdout.readline()
        assert line, said
        said += line
    return bridge


@pytest.fixture
def types(tmp_path: Path) -> str:
    """Lets Debian's tools know roscopter's and MAVROS's types: stands before their names."""
    for package in ("roscopter", "mavros_msgs", "geographic_msgs"):
        write_package(package, tmp_path)
    return f"PYTHONPATH={tmp_path}"


@pytest.fixture
def debian(ros: Run, types: str) -> Run:
    """Debian's tools."""

    def run(*command: str) -> str:
        return ros("env", types, *command)

    return run


def until(look: Callable[[], Any], what: str) -> Any:
    """What *look* finds; it takes its time, as it starts a program."""
    end = time.monotonic() + LIMIT_S
    while time.monotonic() < end:
        found = look()
        if found:
            return found
    raise AssertionError(f"not in time: {what}")


def heading(debian: Run) -> int:
    found = re.search(r"heading: (\d+)", debian("rostopic", "echo", "-n1", "/vfr_hud"))
    assert found
    return int(found[1])


def test_the_session_of_a_thesis(debian: Run, start: Start, types: str) -> None:
    """gps is looked at, the quadrotor armed, sticks sent that turn it."""
    patient = "sim:ardupilot?start=warm&parameters=DISARM_DELAY:0"  # starting the tools takes its time
    bridge = bridged(start, patient, "--names", "roscopter", "--enable-control")
    gps = until(lambda: re.search(r"status: 0", debian("rostopic", "echo", "-n1", "/gps")), "a fix")
    assert gps
    place = debian("rostopic", "echo", "-n1", "/gps")
    assert re.search(r"latitude: 46\.082", place)
    assert re.search(r"altitude: (89[5-9]|90[0-5])\.", place)  # above mean sea level
    assert debian("rosservice", "type", "/arm").strip() == "std_srvs/Empty"

    def armed() -> bool:
        debian("rosservice", "call", "/arm")
        return "armed: True" in debian("rostopic", "echo", "-n1", "/state")

    until(armed, "to be armed")
    sticks = "[1500, 1500, 1620, 1700, 0, 0, 0, 0]"
    start("env", types, "rostopic", "pub", "-r", "5", "/send_rc", "roscopter/RC", sticks)
    channels = until(
        lambda: re.search(r"1620, 1700.*", debian("rostopic", "echo", "-n1", "/rc")), "the sticks"
    )
    assert channels[0].endswith("1800, 1000, 1000, 1800]")  # 0 leaves a channel to the remote control
    before = heading(debian)
    until(lambda: abs((heading(debian) - before + 180) % 360 - 180) > 20, "it to turn")
    bridge.send_signal(signal.SIGINT)
    assert bridge.wait(LIMIT_S) == 0
    assert "/gps" not in debian("rostopic", "list")


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_vehicle_behind_mavros(
    roscore: Roscore, start: Start, monkeypatch: pytest.MonkeyPatch, autopilot: str
) -> None:
    """One process is MAVROS, this one flies."""
    bridged(start, f"sim:{autopilot}?start=warm", "--names", "mavros", "--namespace", f"/{autopilot}")
    monkeypatch.setenv("ROS_MASTER_URI", roscore.uri)
    with volery.connect(f"mavros+ros1:///{autopilot}?autopilot={autopilot}") as drone:
        drone.wait_ready()
        home = drone.home
        assert home.altitude.metres == pytest.approx(900.0, abs=2.0)  # there and back through the geoid
        drone.takeoff(3.0)
        assert drone.altitude.metres == pytest.approx(3.0, abs=0.5)
        assert abs(drone.attitude.roll) < 10.0  # of imu/data
        name = "WP_SPD" if autopilot == "ardupilot" else "MPC_XY_CRUISE"
        value = drone.parameters.get(name)
        drone.parameters.set(name, value + 0.5)
        found = drone.parameters.all()
        assert len(found) > 800
        assert found[name] == value + 0.5
        rally = volery.Plan(rally=(volery.Position(home.latitude, home.longitude, volery.AboveHome(20)),))
        drone.plan.upload(rally, only=["rally"])
        assert len(drone.plan.download().rally) == 1
        drone.land()
        assert not drone.armed


def armed_by_tools(debian: Run, start: Start, types: str, namespace: str) -> str:
    """The mode in which it is armed by Debian's tools: for seconds, as an autopilot on the ground disarms."""
    watched = start("env", types, "PYTHONUNBUFFERED=1", "rostopic", "echo", f"{namespace}/state")
    assert "header" in watched.stdout.readline()
    said = debian("rosservice", "call", f"{namespace}/cmd/arming", "value: true")
    assert "success: True" in said, said
    while "armed: True" not in watched.stdout.readline():
        assert watched.poll() is None
    while not (line := watched.stdout.readline()).startswith("mode:"):
        assert watched.poll() is None
    return str(line)


def test_a_paparazzi_goes_by_the_names_of_mavros(debian: Run, start: Start, types: str) -> None:
    bridged(start, "sim:paparazzi?start=warm", "--names", "mavros", "--namespace", "/paparazzi")
    before = debian("rostopic", "echo", "-n1", "/paparazzi/state")
    assert "connected: True" in before
    assert "armed: False" in before
    assert 'mode: "NAV"' in armed_by_tools(debian, start, types, "/paparazzi")


def test_a_dji_on_the_graph_gets_other_names_there(debian: Run, start: Start, types: str) -> None:
    served = start(*COMMAND, "vehicle", "serve", "dji", "--graph", "ros1", "--speed", "4")
    while "serving dji on ros1" not in served.stdout.readline():
        assert served.poll() is None
    bridged(start, "dji+ros1:///dji_sdk", "--names", "mavros", "--namespace", "/dji")
    state = armed_by_tools(debian, start, types, "/dji")
    assert 'mode: "P_GPS"' in state or 'mode: "ENGINE_START"' in state  # for 2 s after the motors start


def test_whose_name_is_taken_is_told(roscore: Roscore, start: Start, ours: Any) -> None:
    ours.graph.node("mavros", "/taken")
    bridge = start(*COMMAND, "ros", "bridge", "sim:ardupilot", "--namespace", "/taken")
    try:
        said, _ = bridge.communicate(timeout=2 * LIMIT_S)
    except subprocess.TimeoutExpired:
        bridge.kill()
        raise
    assert bridge.returncode == 2
    assert "a node named /taken/mavros is there already" in " ".join(said.split())


BEAT = encode(Frame("HEARTBEAT", {"type": 2, "autopilot": 3, "base_mode": 81, "system_status": 3}, 1, 1), 0)


def asks_for_streams(heard: Callable[[], bytes]) -> None:
    """What arrives there is a request for all streams at 20 Hz."""
    parser = MAVLINK.parser()
    while True:
        for frame in parser.feed(heard()):
            if frame.name == "REQUEST_DATA_STREAM":
                asked = (frame.fields["req_stream_id"], frame.fields["req_message_rate"], frame.system)
                assert asked == (0, 20, 254)
                return


def test_over_a_serial_line_it_asks_as_it_is_told(ros: Run, start: Start) -> None:
    autopilot, line = os.openpty()
    tty.setraw(line)
    address = f"ardupilot+serial://{os.ttyname(line)}?baud=57600"
    options = ("--names", "roscopter", "--namespace", "/serial", "--rate", "20", "--source-system", "254")
    in_a_script = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"  # begun with &
    bridge = start(*COMMAND[:2], f"{in_a_script}; {COMMAND[2]}", "ros", "bridge", address, *options)
    assert "bridging" in bridge.stdout.readline()
    os.write(autopilot, BEAT)
    asks_for_streams(lambda: os.read(autopilot, 4096))
    listed = ros("rostopic", "list").split()
    assert "/serial/vfr_hud" in listed
    assert "/serial/send_rc" not in listed  # nobody has allowed it
    bridge.send_signal(signal.SIGTERM)  # as a service is ended
    assert bridge.wait(LIMIT_S) == 0
    assert "/serial/vfr_hud" not in ros("rostopic", "list").split()
    os.close(autopilot)
    os.close(line)


def test_a_link_that_breaks_is_opened_again(roscore: Roscore, start: Start) -> None:
    with socket.create_server(("127.0.0.1", 0)) as autopilot:
        autopilot.settimeout(LIMIT_S)
        address = f"ardupilot+tcp://127.0.0.1:{autopilot.getsockname()[1]}"
        options = ("--names", "roscopter", "--namespace", "/broken", "--rate", "20", "--source-system", "254")
        start(*COMMAND, "ros", "bridge", address, *options)
        for _ in range(2):
            connection, _ = autopilot.accept()
            with connection:
                connection.settimeout(LIMIT_S)
                connection.sendall(BEAT)
                asks_for_streams(partial(connection.recv, 4096))
