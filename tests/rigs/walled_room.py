"""A room with four walls, and a body in it that does not move."""

from math import pi

from volery.base.frames import euler_to_quaternion
from volery.simulation.added_sensors.beams import Ranging
from volery.simulation.added_sensors.lidar import Lidar
from volery.simulation.world.scene import Scene, Solid
from volery.simulation.world.sensors import Mounting, SensorInput

WEST, SOUTH, EAST, NORTH, HEIGHT = -6.0, -4.0, 10.0, 5.0, 3.0


def box(name, west, south, east, north):
    return Solid(name, ((west, south), (east, south), (east, north), (west, north)), -1.0, HEIGHT)


ROOM = Scene(
    [
        box("west", WEST - 1.0, SOUTH - 1.0, WEST, NORTH + 1.0),
        box("south", WEST - 1.0, SOUTH - 1.0, EAST + 1.0, SOUTH),
        box("east", EAST, SOUTH - 1.0, EAST + 1.0, NORTH + 1.0),
        box("north", WEST - 1.0, NORTH, EAST + 1.0, NORTH + 1.0),
    ]
)


def state(position, roll=0.0, pitch=0.0, yaw=0.0, *, scene=ROOM, time=0, velocity=(0.0, 0.0, 0.0)):
    """The true state of a body that looks east and is turned by these angles [rad]."""
    attitude = euler_to_quaternion(roll, pitch, yaw)
    still = (0.0, 0.0, 0.0)
    return SensorInput(time, position, velocity, attitude, still, still, still, 0.0, scene)


FAR = Ranging(0.1, 30.0)


def lidar(columns=360, field=2.0 * pi, ranging=FAR, at=(0.0, 0.0, 0.0)):
    return Lidar("lidar", 10.0, ranging, columns, field, mounting=Mounting(at))
