"""Precision_Landing by camera: lands a drone on the marker that its own camera sees on its pad.

Picture, calibration and attitude come over topics while it lands, velocities go to the drone. If it cannot
land on the marker, the outcome says why.
"""

from __future__ import annotations

import rospy
from mavros_msgs.srv import MessageInterval
from precision_landing import PrecisionLanding
from sensor_msgs.msg import CameraInfo, Image, Imu

import volery
from volery import AMSL, Position, VoleryError
from volery.autonomy.markers import MarkerFinder, camera_of, picture_of
from volery.autonomy.precision_landing import LandingPhase, LandingRules, LandingState, sight_of, step

SEEN_FROM_M = 8.0
"""From higher up it descends by position: a marker has too few pixels there."""
ATTITUDE, ATTITUDE_HZ = 30, 20
"""MAVLink's number of the attitude, and its rate: after a quarter of a second it is wrong by degrees."""
ATTITUDES = 50
"""Attitudes that are kept: those of the last second or more."""


class CameraLanding(PrecisionLanding):
    """``marker`` of ``size_m`` lies on this drone's pad at each port.

    ``gain`` is m/s for each metre of offset: an autopilot that overshoots its velocity needs a lower one.
    ``damping`` is m/s for each m/s that a gust takes from it: for an ArduPilot, not for a PX4.
    """

    def __init__(self, drone, city, marker, size_m, gain, damping):
        super().__init__(drone, beacon=None, image_ms=0.0, gain=gain)  # it looks for itself
        self._top_m = city.origin.amsl + SEEN_FROM_M
        self._finder = MarkerFinder({marker: size_m})
        self._rules = LandingRules(gain=gain, damping=damping)
        self._camera, self._picture, self._attitudes = None, None, []

    def _descend(self):
        here = self._drone.position
        if here.altitude.metres > self._top_m + 1.0:
            self._drone.goto(Position(here.latitude, here.longitude, AMSL(self._top_m)))
        subscriptions = self._open_eyes()
        try:
            self._follow_marker()
        finally:
            for subscription in subscriptions:
                subscription.unregister()
            self._picture, self._attitudes = None, []

    def _open_eyes(self):
        """Subscribe to camera and attitude, which are needed above a pad only."""
        name = self._drone.name
        set_rate = rospy.ServiceProxy(f"/{name}/set_message_interval", MessageInterval)
        if not set_rate(ATTITUDE, ATTITUDE_HZ).success:
            volery.log("the autopilot does not send its attitude faster", "warning")
        return (
            rospy.Subscriber(f"/{name}/camera/camera_info", CameraInfo, self._take_camera, queue_size=1),
            rospy.Subscriber(f"/{name}/camera/image_raw", Image, self._take_picture, queue_size=1),
            rospy.Subscriber(f"/{name}/imu/data", Imu, self._take_attitude, queue_size=10),
        )

    def _follow_marker(self):
        """Fly down to where the autopilot can land alone.

        Raises:
            VoleryError: The landing was aborted.
        """
        landing, rate = LandingState(), rospy.Rate(10)
        while not rospy.is_shutdown() and self._drone.flying:
            sight = self._look()
            north, east, up = self._drone.velocity
            now = rospy.Time.now().to_nsec()
            landing, command = step(landing, self._rules, now, (east, north, up), sight)
            if landing.phase is LandingPhase.LAND:
                return
            east, north, up = command.velocity
            self._drone.set_velocity(north, east, up)
            if landing.phase is LandingPhase.ABORT:
                volery.log(f"no landing on the marker: {landing.reason}", "warning")
                raise VoleryError(f"no landing on the marker: {landing.reason}")
            rate.sleep()

    def _look(self):
        """Find the marker in the last picture, if there is a new one."""
        picture, self._picture = self._picture, None
        if picture is None or self._camera is None or not self._attitudes:
            return None
        poses = self._finder.find(picture_of(picture), self._camera)
        if not poses:
            return None
        taken = picture.header.stamp.to_nsec()
        imu = min(self._attitudes, key=lambda one: abs(one.header.stamp.to_nsec() - taken))
        turn = imu.orientation
        return sight_of(poses[0], taken, (turn.w, turn.x, turn.y, turn.z))

    def _take_camera(self, message):
        self._camera = camera_of(message)

    def _take_picture(self, message):
        self._picture = message

    def _take_attitude(self, message):
        self._attitudes = [*self._attitudes[1 - ATTITUDES :], message]
