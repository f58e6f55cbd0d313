"""Vehicles that components command by ROS messages alone: somebody brings them down at the end of a run."""

from __future__ import annotations

from collections.abc import Callable

from volery.ros.graph import Node, RosGraph
from volery.vehicles import Vehicle


class Unattended:
    """See ``ending.Lands``: joins *graph* for the way down only, and commands what ``open_on`` opens there.

    A vehicle that no computer commands in the end is left to its autopilot.
    """

    def __init__(self, graph: RosGraph, name: str, open_on: Callable[[Node], Vehicle]) -> None:
        self.name = name
        self._graph = graph
        self._open_on = open_on

    def come_to_rest(self) -> str:
        """Land it if it is armed and nobody else has it; says what was done."""
        vehicle = self._open_on(self._graph.node(f"safety_of_{self.name}"))
        vehicle.wait_heard()
        return vehicle.come_to_rest()
