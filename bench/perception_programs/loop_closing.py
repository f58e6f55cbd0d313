"""A pose graph of a figure of eight with wrong closures among the right ones."""

import numpy as np

from volery.autonomy.planar_pose import Pose2
from volery.autonomy.pose_graph import Edge, optimise


def prepare(seed):
    random = np.random.default_rng(seed)
    true = [
        Pose2(8.0 * np.sin(turn), 4.0 * np.sin(2.0 * turn), 0.0) for turn in np.linspace(0, 4 * np.pi, 180)
    ]
    information = np.diag((400.0, 400.0, 2500.0))
    edges = [Edge(one, one + 1, true[one].to(true[one + 1]), information, True) for one in range(179)]
    for _ in range(30):
        one = int(random.integers(0, 90))
        edges.append(Edge(one, one + 89, true[one].to(true[one + 89]), information))
    edges.append(Edge(3, 120, Pose2(1.0, 1.0, 0.2), information))
    edges.append(Edge(10, 150, Pose2(-2.0, 0.0, 0.0), information))
    rough = [Pose2(*(np.array(one) + random.normal(0.0, 0.05, 3))) for one in true]
    return rough, edges


def run(given):
    poses, weights = optimise(*given)
    return poses[-1].x + float(weights.sum())
