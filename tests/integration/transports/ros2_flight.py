"""Flies a vehicle behind MAVROS's names on real ROS 2, in the environment that has rclpy; says as JSON
how it went.
"""

import json
import sys

import volery
from volery import AboveHome, Position


def main(url: str) -> None:
    with volery.connect(url) as drone:
        drone.wait_ready()
        home = drone.home
        drone.takeoff(4.0)
        drone.goto(Position(home.latitude + 0.00008, home.longitude, AboveHome(5.0)))
        went = drone.position.latitude - home.latitude
        speed = drone.parameters.get("WP_SPD")
        drone.parameters.set("WP_SPD", speed + 0.5)
        plan = volery.Plan(rally=(Position(home.latitude, home.longitude, AboveHome(20)),))
        drone.plan.upload(plan, only=["rally"])
        found = {
            "home": home.altitude.metres,
            "went": went,
            "changed": drone.parameters.get("WP_SPD") - speed,
            "parameters": len(drone.parameters.all()),
            "rally": len(drone.plan.download().rally),
            "roll": drone.attitude.roll,
        }
        drone.land()
        found["armed"] = drone.armed
    sys.stdout.write(json.dumps(found))


if __name__ == "__main__":
    main(sys.argv[1])
