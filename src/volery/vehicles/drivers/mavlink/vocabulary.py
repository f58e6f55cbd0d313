"""MAVLink's numbers that drivers use."""

from __future__ import annotations

from volery.links.mavlink import constant

POSITION_ONLY = 0x0DF8
VELOCITY_AND_YAW_RATE = 0x05C7
VELOCITY_AND_YAW = 0x09C7
"""Type masks of SET_POSITION_TARGET_*: a bit that is set means ignore that field."""

FORCE = 21196.0
"""Parameter 2 of COMPONENT_ARM_DISARM: skip the checks; disarm in the air, too."""

GROUND_SPEED = 1.0
UNCHANGED = -1.0
OWN_SPEED = -1.0
"""In DO_CHANGE_SPEED: back to the autopilot's own."""
SHORTEST_WAY = 0.0

LEFT_ALONE = 65535
"""In RC_CHANNELS_OVERRIDE: this channel stays as it is."""

ARMED = constant("MAV_MODE_FLAG_SAFETY_ARMED")
ACTIVE = constant("MAV_STATE_ACTIVE")
FAILSAFE = (constant("MAV_STATE_CRITICAL"), constant("MAV_STATE_EMERGENCY"))
UNDEFINED = constant("MAV_LANDED_STATE_UNDEFINED")
ON_GROUND = constant("MAV_LANDED_STATE_ON_GROUND")
