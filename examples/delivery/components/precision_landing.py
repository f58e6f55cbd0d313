"""Precision_Landing: takes the drone over above a port and lands it on the beacon of its pad.

Ten times a second it looks for the beacon in a camera picture and commands a velocity: towards the beacon,
and down as far as the drone is above it already. Close to the ground the autopilot's own landing does the
rest.
"""

from __future__ import annotations

import queue
from math import hypot

import rospy
from delivery_types import DONE

import volery
from volery import VoleryError

MOST_SIDEWAYS = 2.0
DESCENT_GAIN = 0.35
"""m/s of descent for each metre of height."""
FASTEST_DESCENT = 2.0
SLOWEST_DESCENT = 0.4
CENTRED_M = 0.3
CENTRED_PER_METRE = 0.1
"""It descends while the offset is smaller than this: so much, and more for each metre of height."""
LET_GO_M = 1.0
"""From this height on the autopilot lands where it is, once the drone is within ``LET_GO_OFFSET_M``."""
LET_GO_OFFSET_M = 0.1
SMOOTHING = 0.4
"""Share of a new picture in the running estimate of the offset."""
GIVE_UP_S = 8.0
"""Without a beacon for this time, the drone lands by its own position."""

IMAGE_MHZ = 1500


class PrecisionLanding:
    """``take_over`` and ``outcome`` answer at once, the landing is done by ``run``.

    ``image_ms`` is what finding the beacon in one picture takes at 1500 MHz. The picture is not there in a
    simulation, so this time is charged instead. ``gain`` is m/s of horizontal velocity for each metre of
    offset: an autopilot that overshoots its velocity needs a lower one.
    """

    def __init__(self, drone, beacon, image_ms, gain):
        self._drone = drone
        self._beacon = beacon
        self._image_s = image_ms / 1000.0
        self._gain = gain
        self._requests = queue.Queue()
        self._outcomes = {}

    def take_over(self, job, pad):
        """Land the drone on *pad* for *job*."""
        self._outcomes[job] = ""
        self._requests.put((job, pad))

    def outcome(self, job):
        """Empty while it lands, then ``done`` or what went wrong."""
        return self._outcomes.get(job, "this landing was not requested")

    def run(self):
        """Land the drone as often as it is asked for."""
        rospy.init_node("precision_landing")
        while not rospy.is_shutdown():
            job, pad = self._requests.get()
            try:
                self._descend()
                self._drone.land(pad)
            except VoleryError as error:
                self._outcomes[job] = str(error)
            else:
                self._outcomes[job] = DONE

    def _descend(self):
        """Down to where the autopilot can land alone."""
        rate = rospy.Rate(10)
        seen = None
        last_seen = volery.now()
        while not rospy.is_shutdown() and self._drone.flying:
            picture = self._look()
            if picture is not None:
                seen, last_seen = _smoothed(seen, picture), volery.now()
                if _can_let_go(seen, picture.below):
                    return
                self._drone.set_velocity(*_velocity(seen, picture.below, self._gain))
            elif volery.now() - last_seen > GIVE_UP_S:
                volery.log("the beacon is not seen: landing by position", "warning")
                return
            else:
                seen = None
                self._drone.set_velocity(0.0, 0.0, 0.0)
            rate.sleep()

    def _look(self):
        """Take a picture and find the beacon in it."""
        picture = self._beacon.look()
        volery.add_time(self._image_s, at_mhz=IMAGE_MHZ)
        return picture


def _smoothed(before, picture):
    """East and north of the beacon, averaged over the last pictures."""
    if before is None:
        return picture.east, picture.north
    return (
        before[0] + SMOOTHING * (picture.east - before[0]),
        before[1] + SMOOTHING * (picture.north - before[1]),
    )


def _can_let_go(seen, height):
    return height < LET_GO_M and hypot(*seen) < LET_GO_OFFSET_M


def _velocity(seen, height, gain):
    """Return north, east, up in m/s."""
    offset = hypot(*seen)
    speed = min(MOST_SIDEWAYS, gain * offset)
    share = speed / offset if offset else 0.0
    down = 0.0
    if offset < CENTRED_M + CENTRED_PER_METRE * height and height > LET_GO_M / 2:
        down = min(FASTEST_DESCENT, max(SLOWEST_DESCENT, DESCENT_GAIN * height))
    return share * seen[1], share * seen[0], -down
