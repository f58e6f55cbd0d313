"""What drivers of MAVLink autopilots share: client, telemetry, commands, missions and parameters.

What differs between firmwares belongs to the package of the firmware.
"""
