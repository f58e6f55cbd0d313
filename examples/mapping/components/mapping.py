"""SLAM on a vehicle's scans and odometry: publishes map, path, pose and the transform ``map`` to ``odom``."""

import volery
from volery.autonomy.slam_node import SlamNames, SlamNode


def match(slam, odometry, scan):
    """Match a scan: called in this file, so that the component is charged for it."""
    return slam.add(odometry, scan)


class Mapping:
    """``scan`` and ``odometry`` are topics; ``prefix`` begins the names of the map and the path."""

    def __init__(self, scan, odometry, prefix):
        self._names = SlamNames(scan, odometry, map=f"{prefix}map", path=f"{prefix}path")

    def run(self):
        """Match scans until the end."""
        node = volery.node()
        SlamNode(node, self._names, say=lambda text: volery.log(text, "warning"), match=match)
        node.spin()
