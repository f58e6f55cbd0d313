"""Real firmware in the simulated world: programs of autopilots, in lock step with virtual time."""
