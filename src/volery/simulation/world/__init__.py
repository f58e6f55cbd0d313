"""Laws of bodies: multirotor, rover, wind, battery, terrain, sensors, all advanced by one compiled step.

Knows no task, no autopilot and no kernel: only a way to ask the time. Positions are metres east, north, up
about the origin of a local frame; body axes are forward, left, up; what a sensor reports is in the axes of
autopilots (north, east, down and forward, right, down).
"""
