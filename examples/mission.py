"""The five-line mission: up, three points, down. The same lines fly any drone.

    volery fly examples/mission.py --on sim:ardupilot

The points are WGS-84 degrees and metres above mean sea level, so they mean something near one place only:
``HOME`` is where a simulated drone starts. The three legs are about 50, 220 and 90 m.
"""

from volery import AMSL, Drone, Position

HOME = Position(46.0825, -103.8995, AMSL(900))


def mission(drone: Drone) -> None:
    drone.takeoff(10)
    drone.goto(Position(46.0828, -103.8990, AMSL(940)))
    drone.goto(Position(46.0828, -103.8962, AMSL(940)))
    drone.goto(Position(46.0820, -103.8964, AMSL(920)))
    drone.land()
