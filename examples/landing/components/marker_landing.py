"""Marker_Landing: flies to a pad and lands on its marker, which it finds in the pictures of its camera.

A ROS node: picture, calibration and attitude come over topics, velocities go to the drone. Where the marker
is not seen the drone comes home.
"""

from __future__ import annotations

import rospy
from mavros_msgs.srv import MessageInterval
from sensor_msgs.msg import CameraInfo, Image, Imu

import volery
from volery import AMSL, Position, VoleryError
from volery.autonomy.markers import MarkerFinder, camera_of, picture_of
from volery.autonomy.precision_landing import LandingPhase, LandingRules, LandingState, sight_of, step

ROUND_S = 0.05
ATTITUDE, ATTITUDE_HZ = 30, 20
"""MAVLink's number of the attitude, and its rate: after a quarter of a second it is wrong by degrees."""
ATTITUDES = 100
"""Attitudes that are kept: those of the last seconds."""


class MarkerLanding:
    """``marker`` of ``size_m`` lies on ``pad``; the drone looks for it from ``height_m`` above ``approach``.

    ``gain`` is m/s for each metre of offset: an autopilot that overshoots its velocity needs a lower one.
    ``damping`` is m/s for each m/s that a gust takes from it: for an ArduPilot, not for a PX4.
    """

    def __init__(self, drone, field, pad, approach, marker, size_m, height_m, gain, damping):  # noqa: PLR0913, PLR0917  # by name
        self._drone, self._pad, self._approach = drone, field.places[pad], field.places[approach]
        self._height_m = height_m
        self._finder = MarkerFinder({marker: size_m})
        self._rules = LandingRules(gain=gain, damping=damping)
        self._camera, self._picture, self._attitudes = None, None, []

    def run(self):
        """Fly there and land."""
        rospy.init_node("marker_landing")
        drone = self._drone
        drone.wait_ready()
        drone.takeoff(self._height_m)
        above = self._approach.amsl_m + self._height_m
        drone.goto(Position(self._approach.latitude, self._approach.longitude, AMSL(above)))
        subscriptions = self._open_eyes()
        reason = self._descend()
        for one in subscriptions:
            one.unregister()
        if not reason:
            drone.land(self._pad.position)
            return
        volery.log(f"no landing on the pad: {reason}", "warning")
        drone.return_home()
        raise VoleryError(f"no landing on the pad: {reason}")

    def _open_eyes(self):
        """Subscribe to camera and attitude: above the pad they are needed, and nowhere else."""
        name = self._drone.name
        set_rate = rospy.ServiceProxy(f"/{name}/set_message_interval", MessageInterval)
        if not set_rate(ATTITUDE, ATTITUDE_HZ).success:
            volery.log("the autopilot does not send its attitude faster", "warning")
        return (
            rospy.Subscriber(f"/{name}/camera/camera_info", CameraInfo, self._take_camera, queue_size=1),
            rospy.Subscriber(f"/{name}/camera/image_raw", Image, self._take_picture, queue_size=1),
            rospy.Subscriber(f"/{name}/imu/data", Imu, self._take_attitude, queue_size=10),
        )

    def _descend(self):
        """Down to where the autopilot can land alone. Why it did not come there, or nothing."""
        landing, rate = LandingState(), rospy.Rate(1.0 / ROUND_S)
        while not rospy.is_shutdown():
            sight = self._look()
            north, east, up = self._drone.velocity
            now = rospy.Time.now().to_nsec()
            before = landing.phase
            landing, command = step(landing, self._rules, now, (east, north, up), sight)
            if landing.phase is not before:
                volery.log(f"{landing.phase.value}: the marker is {_words(landing.offset)}")
            if landing.phase is LandingPhase.LAND:
                return ""
            if landing.phase is LandingPhase.ABORT:
                return landing.reason
            east, north, up = command.velocity
            self._drone.set_velocity(north, east, up)
            rate.sleep()
        return "the program ends"

    def _look(self):
        """Find the marker in the last picture, if there is a new one."""
        picture, self._picture = self._picture, None
        if picture is None or self._camera is None or not self._attitudes:
            return None
        found = self._finder.find(picture_of(picture), self._camera)
        if not found:
            return None
        at = picture.header.stamp.to_nsec()
        turn = min(self._attitudes, key=lambda one: abs(one.header.stamp.to_nsec() - at)).orientation
        return sight_of(found[0], at, (turn.w, turn.x, turn.y, turn.z))

    def _take_camera(self, message):
        self._camera = camera_of(message)

    def _take_picture(self, message):
        self._picture = message

    def _take_attitude(self, message):
        self._attitudes = [*self._attitudes[1 - ATTITUDES :], message]


def _words(offset):
    if offset is None:
        return "not seen"
    return f"{offset[0]:.2f} m east, {offset[1]:.2f} m north, {-offset[2]:.2f} m below"
