"""Drone and Rover: blocking operations, seen on telemetry; and what a driver is."""
