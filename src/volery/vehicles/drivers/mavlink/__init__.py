"""What drivers of MAVLink autopilots share: finding the autopilot, telemetry, commands, missions, parameters.

What one firmware does differently from another stands in that firmware's own room.
"""
