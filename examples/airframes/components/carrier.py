"""Take a load with the gripper, fly to the clinic, leave it there, and come back for another battery."""

import volery
from volery import AMSL, Position


class Carrier:
    """``height`` is in metres above the ground."""

    def __init__(self, drone, field, height):
        self._drone, self._field, self._height = drone, field, height

    def run(self):
        self._drone.wait_ready()
        self._drone.payload.close_gripper()
        volery.sleep(1)
        self._fly_to("clinic")
        self._drone.payload.open_gripper()
        volery.sleep(1)
        self._fly_to("depot")
        volery.sleep(25)

    def _fly_to(self, name):
        place = self._field.places[name]
        self._drone.takeoff(self._height)
        self._drone.goto(Position(place.latitude, place.longitude, AMSL(place.amsl_m + self._height)))
        self._drone.land()
