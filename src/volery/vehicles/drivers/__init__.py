"""Drivers: how to talk to each autopilot. They know neither world nor autopilots."""
