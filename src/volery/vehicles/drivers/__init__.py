"""Drivers: one package for each autopilot. They depend neither on the simulated world nor on simulated autopilots."""
