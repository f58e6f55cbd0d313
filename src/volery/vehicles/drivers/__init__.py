"""Drivers: one package for each autopilot. They do not depend on the simulation."""
