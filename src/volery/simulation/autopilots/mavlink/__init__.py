"""The MAVLink face of a simulated autopilot. Message definitions are those of ``volery.links.mavlink_messages``."""
