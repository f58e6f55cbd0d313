"""Physical models of vehicles and their surroundings, advanced together by one compiled step.

The package knows no task, no autopilot and no kernel; it only reads a clock. Positions are metres east,
north, up about the origin of a local frame, body axes are forward, left, up; sensors report in the axes of
autopilots (north, east, down and forward, right, down).
"""
