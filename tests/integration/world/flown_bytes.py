"""A program of its own: fly a small mixed fleet for a while and print a digest of all there is."""

import hashlib
import sys

from volery.base.frames import LocalFrame
from volery.base.time import MS, S
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint, make_world
from volery.simulation.world.body_specs import Multirotor, Rover
from volery.simulation.world.environment_models import Wind


def main():
    now = 0
    specs = [Multirotor(), Rover(at=(30.0, 0.0, 0.0)), Multirotor(at=(0.0, 30.0, 0.0), sensors="rtk")]
    world, flights = make_world(
        lambda: now, specs, seed=7, frame=LocalFrame(47.4, 8.5, 400.0), wind=Wind(east=4.0, gust=1.0)
    )
    for flight in flights:
        flight.set_origin()
    now = 5 * S
    for flight in flights:
        flight.estimate()
        flight.drive(Setpoint(Control.IDLE))
    for second in range(6, 40):
        now = second * S
        for index, flight in enumerate(flights):
            flight.estimate()
            goal = (3.0 * second * (index - 1), 40.0 - second, -10.0)
            flight.drive(Setpoint(Control.POSITION, position=goal, yaw=0.1 * second, speed=5.0))
    now = 40 * S + 500 * MS
    digest = hashlib.sha256()
    for flight in flights:
        estimate = flight.estimate()
        digest.update(repr((estimate.position, estimate.attitude, flight.truth())).encode())
    digest.update(world.arrays.rows.tobytes())
    sys.stdout.write(digest.hexdigest())


if __name__ == "__main__":
    main()
