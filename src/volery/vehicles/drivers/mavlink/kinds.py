"""What a MAV_TYPE is, for those that can be commanded."""

from __future__ import annotations

from collections.abc import Mapping

from volery.links.mavlink import entry_name
from volery.vehicles.drivers.arrival import DRONE_KIND, ROVER_KIND

KINDS: Mapping[int, str] = {
    2: DRONE_KIND,  # quadrotor
    3: DRONE_KIND,  # coaxial helicopter
    4: DRONE_KIND,  # helicopter
    13: DRONE_KIND,  # hexarotor
    14: DRONE_KIND,  # octorotor
    15: DRONE_KIND,  # tricopter
    29: DRONE_KIND,  # dodecarotor
    35: DRONE_KIND,  # decarotor
    10: ROVER_KIND,
    11: ROVER_KIND,  # boat: the same firmware
}


def kind_of(mav_type: int) -> str:
    """Its kind; for others MAVLink's own word."""
    return KINDS.get(mav_type) or entry_name("MAV_TYPE", mav_type).lower().replace("_", " ")
