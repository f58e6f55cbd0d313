"""Drive to a place of a known map: plan a way that keeps its distance from the walls, and follow it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import volery
from volery.autonomy.grid_path import WaysFrom, clearance_of
from volery.autonomy.map_server import MapServer, path_message
from volery.ros.messages import new

APART_M = 0.5
"""Corners that are nearer to the one before are left out: the rover stops at each."""


class Courier:
    """``plan`` is the YAML file of a map about the model's origin; empty: the plan of the hall.

    ``own`` is where the map of the rover's own scans is saved at the end; empty: nowhere.
    """

    def __init__(self, rover, field, plan, own, to, clearance_m):
        self._rover, self._field, self._to, self._clearance_m = rover, field, to, clearance_m
        self._own = own
        self._file = Path(plan) if plan else Path(__file__).parents[1] / "hall.yaml"

    def run(self):
        volery.note("parcel", "one", "ordered")
        node = volery.node()
        grid = MapServer(node, self._file).grid
        plans = node.advertise("plan", "nav_msgs/msg/Path")
        self._rover.wait_ready()
        way = self._plan(grid, self._field.places[self._to])
        plans.publish(path_message(node.now(), way))
        self._rover.arm()
        for x, y in way[1:]:
            latitude, longitude, _ = self._field.origin.from_enu((float(x), float(y), 0.0))
            self._rover.drive((latitude, longitude))
        self._rover.disarm()
        if self._own:
            node.client("save_map", "nav2_msgs/srv/SaveMap").call(
                new("nav2_msgs/srv/SaveMap_Request", map_url=self._own)
            )
        volery.note("parcel", "one", "delivered")

    def _plan(self, grid, place):
        """Return the corners (n, 2) [m] of the way to a place."""
        here = self._rover.position
        places = (here.latitude, here.longitude), (place.latitude, place.longitude)
        start, goal = (self._field.origin.to_enu(*one, place.amsl_m)[:2] for one in places)
        clearance = clearance_of(~grid.free, grid.resolution)
        ways = WaysFrom(clearance, grid.resolution, grid.cell(*start), self._clearance_m)
        cells = ways.straightened(ways.to(grid.cell(*goal)))
        if not len(cells):
            raise volery.UsageError(
                f"no way in {self._file.name} to {self._to} is {self._clearance_m} m from walls"
            )
        way = [np.array(start)]
        for corner in grid.centres(cells)[1:-1]:
            if np.hypot(*(corner - way[-1])) > APART_M:
                way.append(corner)
        return np.vstack((way, goal))
