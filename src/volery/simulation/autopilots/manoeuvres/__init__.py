"""Manoeuvres: each turns commands and the estimate into set-points at every tick of the autopilot."""
