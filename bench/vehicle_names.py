"""What a vehicle node costs under PX4's and ArduPilot's own names, against MAVROS's names in the same run.

Each node gets the same frames, motion and IMU at 50 Hz, and has a subscription to each topic of motion and
IMU that its names have. Figures are CPU time of this machine per simulated second, medians over rounds that
take turns; the ratio is to the node with MAVROS's names, which publishes as frames arrive, too.

    python bench/vehicle_names.py [--quick]
"""

from __future__ import annotations

import argparse
from statistics import median
from time import process_time
from typing import Any

from volery.base.time import MS, S
from volery.bridge import MAVLINK_SCHEMES, VehicleNodeOptions, serve_vehicle
from volery.cost import Tariff, load_catalogue
from volery.kernel.processor import Processor
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.links.in_process_link import in_process_pair
from volery.ros.graph import EmbeddedGraph
from volery.ros.graph.graph_context import Recorded

TOPICS = {
    "mavros": {
        "imu/data": "sensor_msgs/Imu",
        "imu/data_raw": "sensor_msgs/Imu",
        "local_position/pose": "geometry_msgs/PoseStamped",
        "local_position/velocity_local": "geometry_msgs/TwistStamped",
        "local_position/odom": "nav_msgs/Odometry",
        "global_position/global": "sensor_msgs/NavSatFix",
    },
    "px4": {
        "fmu/out/vehicle_attitude": "px4_msgs/VehicleAttitude",
        "fmu/out/vehicle_local_position_v1": "px4_msgs/VehicleLocalPosition",
        "fmu/out/vehicle_odometry": "px4_msgs/VehicleOdometry",
        "fmu/out/vehicle_global_position": "px4_msgs/VehicleGlobalPosition",
        "fmu/out/sensor_combined": "px4_msgs/SensorCombined",
    },
    "ardupilot": {
        "ap/pose/filtered": "geometry_msgs/PoseStamped",
        "ap/twist/filtered": "geometry_msgs/TwistStamped",
        "ap/geopose/filtered": "geographic_msgs/GeoPoseStamped",
        "ap/imu/experimental/data": "sensor_msgs/Imu",
        "ap/time": "builtin_interfaces/Time",
    },
}
PERIOD = 20 * MS
IDENTITY = (1.0, 0.0, 0.0, 0.0)


def serving(names: str, seconds: int) -> float:
    """CPU milliseconds per simulated second of a node with these names."""
    kernel = VirtualKernel()
    tariff = Tariff(load_catalogue().processor("rpi4-cortex-a72").ros_law("roscpp"), 1500)
    graph = EmbeddedGraph(kernel, lambda node: tariff, records=lambda topic: Recorded.SHORT)
    ours, theirs = in_process_pair(kernel)

    def say(name: str, **fields: Any) -> None:
        theirs.send(Frame(name, fields, 1, 1))

    def stream() -> None:
        say("ATTITUDE", yaw=1.0)
        say("LOCAL_POSITION_NED", x=1.0)
        say("GLOBAL_POSITION_INT", lat=470000000, lon=80000000, hdg=9000)
        say("HIGHRES_IMU", zacc=-9.8)
        covariance = {"pose_covariance": (0.25,) * 21, "velocity_covariance": (0.04,) * 21}
        say("ODOMETRY", frame_id=1, child_frame_id=1, q=IDENTITY, x=1.0, **covariance)

    kernel.every(PERIOD, stream)
    kernel.every(S, lambda: say("HEARTBEAT", type=2, autopilot=12 if names == "px4" else 3))
    options = VehicleNodeOptions(names=MAVLINK_SCHEMES[names], period=None, rate=0)
    serve_vehicle(
        graph, ours, "drone_1", ExecutionContext("node", Processor(kernel, "cpu", cores=4)), options
    )
    user = graph.node("user", context=ExecutionContext("user"))
    for topic, kind in TOPICS[names].items():
        user.subscribe(f"/drone_1/{topic}", kind, lambda message: None)
    kernel.spawn(user.spin, "user", ExecutionContext("user"))
    kernel.run(2 * S)
    start = process_time()
    kernel.run(kernel.now() + seconds * S)
    return (process_time() - start) / seconds * 1e3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="fewer rounds")
    quick = parser.parse_args().quick
    seconds, rounds = (5, 3) if quick else (20, 7)
    taken: dict[str, list[float]] = {names: [] for names in TOPICS}
    for _ in range(rounds):
        for names in TOPICS:
            taken[names].append(serving(names, seconds))
    reference = median(taken["mavros"])
    for names, values in taken.items():
        print(f"{names:<12}{median(values):>8.2f} ms{median(values) / reference:>8.2f} x mavros")


if __name__ == "__main__":
    main()
