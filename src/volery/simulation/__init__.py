"""What stands in for the outside: the world and simulated autopilots."""
