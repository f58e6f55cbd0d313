"""The checks themselves, one module for each group; importing them registers them."""

from volery.testing.driver_checks import flight, ground, missions, others, rover, sticks, wire

GROUPS = tuple(
    module.__name__.rpartition(".")[2] for module in (ground, flight, sticks, missions, others, wire, rover)
)
"""In the order in which they are run: from harmless to daring."""
