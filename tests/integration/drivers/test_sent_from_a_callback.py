"""What a program sends for each picture or scan, it may send from a callback, in real time as in virtual."""

from __future__ import annotations

import socket
import threading
from contextlib import closing, suppress

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from volery.base.time import MS
from volery.kernel.wall import WallKernel
from volery.vehicles import Drone
from volery.vehicles.address import open_link, parse
from volery.vehicles.drivers.ardupilot import open_driver
from volery.vehicles.external_pose import ExternalPose

pytestmark = pytest.mark.integration

ENOUGH = 3


class Autopilot:
    """A listener that sends heartbeats, has 1 as every parameter and counts the messages that it gets."""

    def __init__(self, listener: socket.socket) -> None:
        self._listener = listener
        self.counts: dict[str, int] = {}
        self.enough = threading.Event()

    def serve(self) -> None:
        connected, _ = self._listener.accept()
        connected.settimeout(0.1)
        out = mavlink.MAVLink(connected.makefile("wb", buffering=0), srcSystem=1, srcComponent=1)
        reader = mavlink.MAVLink(None)
        reader.robust_parsing = True
        with suppress(ConnectionError), connected:
            while True:
                out.heartbeat_send(mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, 1, 0, 3)
                with suppress(TimeoutError):
                    data = connected.recv(4096)
                    if not data:
                        return
                    for message in reader.parse_buffer(data) or ():
                        self._take(message, out)

    def _take(self, message: mavlink.MAVLink_message, out: mavlink.MAVLink) -> None:
        kind = message.get_type()
        if kind == "PARAM_REQUEST_READ":
            out.param_value_send(message.param_id.encode(), 1.0, mavlink.MAV_PARAM_TYPE_INT8, 1, 0)
        self.counts[kind] = self.counts.get(kind, 0) + 1
        sent = ("LANDING_TARGET", "VISION_POSITION_ESTIMATE")
        if all(self.counts.get(one, 0) > ENOUGH for one in sent):
            self.enough.set()


def test_landing_targets_and_poses() -> None:
    covariance = [[0.01 if row == column else 0.0 for column in range(6)] for row in range(6)]
    with closing(socket.create_server(("127.0.0.1", 0))) as listener:
        autopilot = Autopilot(listener)
        server = threading.Thread(target=autopilot.serve, daemon=True)
        server.start()
        kernel = WallKernel()
        link = open_link(kernel, parse(f"ardupilot+tcp://127.0.0.1:{listener.getsockname()[1]}"))
        drone = Drone(kernel, "drone_1", open_driver(kernel, link, "drone_1", {}))

        def on_picture() -> None:
            drone.send_landing_target(0.4, -0.2, 5.0)
            drone.send_external_pose(ExternalPose(kernel.now(), 1.0, 2.0, 0.0, 90.0, covariance))

        kernel.start()
        try:
            with kernel.adopt("script"):
                drone.wait_connected(60.0)
                drone.send_landing_target(0.4, -0.2, 5.0)  # the first one reads the parameters
                kernel.every(20 * MS, on_picture)
            assert autopilot.enough.wait(60.0), autopilot.counts
        finally:
            drone.close()
            assert kernel.close() == []
        server.join(60.0)
