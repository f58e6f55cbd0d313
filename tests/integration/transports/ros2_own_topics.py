"""Flies a vehicle over its autopilot's own topics on real ROS 2, in the environment that has rclpy; says as
JSON how it went.
"""

import json
import sys

import volery
from volery import AboveHome, Position
from volery.base.errors import LinkError


def connected(url: str) -> volery.Drone:
    """Return the vehicle; what serves it may have to compile the simulation first."""
    for _ in range(20):
        try:
            return volery.connect(url)
        except LinkError:
            continue
    return volery.connect(url)


def main(url: str) -> None:
    with connected(url) as drone:
        drone.wait_ready()
        home = drone.home
        drone.takeoff(4.0)
        drone.goto(Position(home.latitude + 0.00008, home.longitude, AboveHome(5.0)))
        found = {"home": home.altitude.metres, "went": drone.position.latitude - home.latitude}
        found["mode"] = drone.mode
        drone.land()
        found["armed"] = drone.armed
    sys.stdout.write(json.dumps(found))


if __name__ == "__main__":
    main(sys.argv[1])
