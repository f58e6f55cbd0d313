"""Go along places of the map. Nothing here looks for obstacles: the way must be free."""

from volery import AMSL, Position


class Flight:
    """``height`` is in metres above the ground."""

    def __init__(self, drone, field, height, along):
        self._drone, self._field, self._height, self._along = drone, field, height, along

    def run(self):
        self._drone.wait_ready()
        self._drone.takeoff(self._height)
        for name in self._along:
            place = self._field.places[name]
            self._drone.goto(Position(place.latitude, place.longitude, AMSL(place.amsl_m + self._height)))
        self._drone.land()


class Drive:
    def __init__(self, rover, field, along):
        self._rover, self._field, self._along = rover, field, along

    def run(self):
        self._rover.wait_ready()
        self._rover.arm()
        for name in self._along:
            place = self._field.places[name]
            self._rover.drive(Position(place.latitude, place.longitude, AMSL(place.amsl_m)))
        self._rover.disarm()
