"""Route_Generator: roads for rovers, air corridors around the no-fly zones for drones."""

from __future__ import annotations

from itertools import pairwise
from math import hypot

import networkx as nx

import volery
from volery import AMSL, Position

SEARCH_SECONDS_PER_NODE = 20e-6
"""What networkx takes to search, for each node of the graph; its code is not counted. Estimated at 3000 MHz.
"""
SEARCH_MHZ = 3000

SAMPLING_M = 5.0
"""How finely a corridor is looked at for no-fly zones."""


class RouteGenerator:
    """``get_route`` answers with the points of the shortest way."""

    def __init__(self, city):
        self._frame = city.origin
        self._ways = {"rover": city.roads, "drone": city.corridors}
        self._graphs = {
            "rover": self._graph(city.roads, ()),
            "drone": self._graph(city.corridors, city.no_fly_zones),
        }

    @staticmethod
    def _graph(ways, zones):
        graph = nx.Graph()
        for one, other, length in ways.edges:
            if not _enters(ways.nodes[one], ways.nodes[other], ways.height_m, zones):
                graph.add_edge(one, other, length=length)
        return graph

    def get_route(self, start, goal, vehicle):
        """From the node nearest to *start* to the one nearest to *goal*; empty if there is no way."""
        graph, ways = self._graphs[vehicle], self._ways[vehicle]
        volery.add_time(SEARCH_SECONDS_PER_NODE * len(graph), at_mhz=SEARCH_MHZ)
        try:
            names = nx.shortest_path(
                graph, self._nearest(graph, ways, start), self._nearest(graph, ways, goal), "length"
            )
        except nx.NetworkXException:
            return []
        return [self._point(ways.nodes[name], ways.height_m) for name in names]

    def _nearest(self, graph, ways, position):
        east, north, _ = self._frame.to_enu(position.latitude, position.longitude, self._frame.amsl)
        if not graph:
            raise nx.NodeNotFound("there are no ways")
        return min(
            graph, key=lambda name: hypot(ways.nodes[name].east_m - east, ways.nodes[name].north_m - north)
        )

    def _point(self, node, height):
        return Position(node.latitude, node.longitude, AMSL(node.amsl_m + height))


def _enters(one, other, height, zones):
    """Whether the straight line between two nodes passes through a zone at *height*."""
    steps = max(1, int(hypot(other.east_m - one.east_m, other.north_m - one.north_m) / SAMPLING_M))
    for step in range(steps + 1):
        share = step / steps
        east = one.east_m + share * (other.east_m - one.east_m)
        north = one.north_m + share * (other.north_m - one.north_m)
        if any(
            zone.floor_m <= height <= zone.ceiling_m and _inside(zone.corners, east, north) for zone in zones
        ):
            return True
    return False


def _inside(corners, east, north):
    """A point is inside if a ray from it crosses the outline an odd number of times."""
    inside = False
    for (east_1, north_1), (east_2, north_2) in pairwise([*corners, corners[0]]):
        if (north_1 > north) != (north_2 > north):
            crossing = east_1 + (north - north_1) / (north_2 - north_1) * (east_2 - east_1)
            inside ^= crossing > east
    return inside
