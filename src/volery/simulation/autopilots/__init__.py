"""Simulated autopilots: they live behind the wire protocols of the real ones."""
