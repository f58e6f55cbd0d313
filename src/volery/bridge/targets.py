"""Where the autopilot says it is going, as ROS messages: the other way round from ``setpoints``."""

from __future__ import annotations

from collections.abc import Mapping

from volery.base import frames
from volery.base.time import Ns
from volery.bridge.offering import Fields, Surroundings, Topic, Translate, stamped
from volery.ros.messages import message_class, new

_LOCAL, _GLOBAL = "mavros_msgs/msg/PositionTarget", "mavros_msgs/msg/GlobalPositionTarget"
_ATTITUDE = "mavros_msgs/msg/AttitudeTarget"
_point = message_class("geometry_msgs/msg/Point")
_vector = message_class("geometry_msgs/msg/Vector3")
_quaternion = message_class("geometry_msgs/msg/Quaternion")

TOPICS = (
    Topic("setpoint_raw/target_local", _LOCAL, on_demand=True),
    Topic("setpoint_raw/target_global", _GLOBAL, on_demand=True),
    Topic("setpoint_raw/target_attitude", _ATTITUDE, on_demand=True),
)


class Targets:
    """Translates frames."""

    def __init__(self, around: Surroundings) -> None:
        self._publish, self._wanted = around.publish, around.wanted

    def translators(self) -> Mapping[str, Translate]:
        """By the name of the frame."""
        return {
            "POSITION_TARGET_LOCAL_NED": self._local,
            "POSITION_TARGET_GLOBAL_INT": self._global,
            "ATTITUDE_TARGET": self._attitude,
        }

    def _local(self, said: Fields, at: Ns) -> None:
        """ENU."""
        if self._wanted("setpoint_raw/target_local"):
            position = _point(*frames.ned_to_enu((said["x"], said["y"], said["z"])))
            message = new(_LOCAL, header=stamped(at), position=position, **_moving(said))
            self._publish("setpoint_raw/target_local", message)

    def _global(self, said: Fields, at: Ns) -> None:
        """The altitude in the frame that the message names."""
        if self._wanted("setpoint_raw/target_global"):
            place = {
                "latitude": said["lat_int"] / 1e7,
                "longitude": said["lon_int"] / 1e7,
                "altitude": said["alt"],
            }
            message = new(_GLOBAL, header=stamped(at), **place, **_moving(said))
            self._publish("setpoint_raw/target_global", message)

    def _attitude(self, said: Fields, at: Ns) -> None:
        if self._wanted("setpoint_raw/target_attitude"):
            w, x, y, z = frames.attitude_ned_to_enu(tuple(said["q"]))
            rates = (said["body_roll_rate"], said["body_pitch_rate"], said["body_yaw_rate"])
            message = new(_ATTITUDE, header=stamped(at), type_mask=said["type_mask"], thrust=said["thrust"])
            message.orientation, message.body_rate = (
                _quaternion(x, y, z, w),
                _vector(*frames.frd_to_flu(rates)),
            )
            self._publish("setpoint_raw/target_attitude", message)


def _moving(said: Fields) -> Fields:
    """What local and global targets have in common."""
    return {
        "coordinate_frame": said["coordinate_frame"],
        "type_mask": said["type_mask"],
        "velocity": _vector(*frames.ned_to_enu((said["vx"], said["vy"], said["vz"]))),
        "acceleration_or_force": _vector(*frames.ned_to_enu((said["afx"], said["afy"], said["afz"]))),
        "yaw": frames.heading_to_yaw(said["yaw"]),
        "yaw_rate": -said["yaw_rate"],
    }
