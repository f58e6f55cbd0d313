"""What stands in for the outside: the world and simulated autopilots."""

from volery.base.installed import require_extra

require_extra("simulation", "simulated vehicles")
