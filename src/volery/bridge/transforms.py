"""Where the vehicle's body is, for tf2: ``/tf``, and on ``/tf_static`` the frames that autopilots think in.

MAVROS's names of frames, behind the vehicle's namespace where there may be several of them:

| parent | child | where | |
|---|---|---|---|
| ``map`` | ``drone_1/base_link`` | ``/tf`` | FLU in ENU, as the autopilot believes, while somebody listens |
| ``map`` | ``map_ned`` | ``/tf_static`` | the same place, north, east and down |
| ``drone_1/base_link`` | ``drone_1/base_link_frd`` | ``/tf_static`` | the same body, forward, right, down |

With an *origin* that is agreed, all vehicles have one ``map``, about it, and a position comes from what the
autopilot says of the globe. Without one ``map`` is about the autopilot's own origin, as MAVROS has it. Under
``/mavros``, where MAVROS serves a single vehicle, there is no prefix.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from math import sqrt
from typing import Any

from volery.base import frames
from volery.base.time import Ns
from volery.bridge.inertial import orientation
from volery.bridge.offering import BODY, Fields, Surroundings, Topic, Translate, stamped
from volery.bridge.placing import MAP
from volery.ros.graph import LATCHED, QoS
from volery.ros.messages import message_class, new

TF, TF_STATIC = "/tf", "/tf_static"
_TF_MESSAGE = "tf2_msgs/msg/TFMessage"
_ALONE = "/mavros"
_HALF = sqrt(0.5)
_NED_IN_ENU = (0.0, _HALF, _HALF, 0.0)
_FRD_IN_FLU = (0.0, 1.0, 0.0, 0.0)
"""Quaternions (w, x, y, z): half a turn about the horizontal diagonal, and about the forward axis."""

_quaternion = message_class("geometry_msgs/msg/Quaternion")
_vector = message_class("geometry_msgs/msg/Vector3")

TOPICS = (
    Topic(TF, _TF_MESSAGE, QoS(100), on_demand=True),
    Topic(TF_STATIC, _TF_MESSAGE, LATCHED),
)


class Transforms:
    """Translates frames."""

    def __init__(self, around: Surroundings) -> None:
        self._wire, self._origin = around.wire, around.origin
        self._publish, self._wanted = around.publish, around.wanted
        namespace = around.node.namespace
        prefix = "" if namespace == _ALONE else f"{namespace.strip('/')}/".lstrip("/")
        self._body = f"{prefix}{BODY}"
        self._told = False

    def translators(self) -> Mapping[str, Translate]:
        """By the name of the frame."""
        if self._origin is None:
            return {"HEARTBEAT": self._tell_static, "LOCAL_POSITION_NED": self._local}
        return {"HEARTBEAT": self._tell_static, "GLOBAL_POSITION_INT": partial(self._global, self._origin)}

    def _tell_static(self, said: Fields, at: Ns) -> None:
        """Once; whoever comes later is told by the graph."""
        if self._told:
            return
        self._told = True
        pairs = ((MAP, f"{MAP}_ned", _NED_IN_ENU), (self._body, f"{self._body}_frd", _FRD_IN_FLU))
        still = [_transform(at, parent, child, _turned(turn)) for parent, child, turn in pairs]
        self._publish(TF_STATIC, new(_TF_MESSAGE, transforms=still))

    def _global(self, origin: frames.LocalFrame, said: Fields, at: Ns) -> None:
        self._place(origin.to_enu(said["lat"] / 1e7, said["lon"] / 1e7, said["alt"] / 1000.0), at)

    def _local(self, said: Fields, at: Ns) -> None:
        self._place(frames.ned_to_enu((said["x"], said["y"], said["z"])), at)

    def _place(self, enu: frames.Vector, at: Ns) -> None:
        attitude = self._wire.last("ATTITUDE")
        if attitude is not None and self._wanted(TF):
            moving = _transform(at, MAP, self._body, orientation(attitude), enu)
            self._publish(TF, new(_TF_MESSAGE, transforms=[moving]))


def _turned(quaternion: frames.Quaternion) -> Any:
    w, x, y, z = quaternion
    return _quaternion(x, y, z, w)


def _transform(at: Ns, parent: str, child: str, rotation: Any, place: frames.Vector = (0.0, 0.0, 0.0)) -> Any:
    made = new("geometry_msgs/msg/TransformStamped", header=stamped(at, parent), child_frame_id=child)
    made.transform.translation = _vector(*place)
    made.transform.rotation = rotation
    return made
