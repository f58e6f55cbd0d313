"""A chain of poses with landmarks, by gtsam."""

import gtsam
import numpy as np


def prepare(seed):
    return np.random.default_rng(seed).normal(0.0, 0.05, (150, 3))


def run(errors):
    graph, start = gtsam.NonlinearFactorGraph(), gtsam.Values()
    noise = gtsam.noiseModel.Isotropic.Sigma(3, 0.1)
    graph.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(0, 0, 0), noise))
    for number, error in enumerate(errors):
        start.insert(number, gtsam.Pose2(0.5 * number + error[0], error[1], error[2]))
        if number:
            graph.add(gtsam.BetweenFactorPose2(number - 1, number, gtsam.Pose2(0.5, 0.0, 0.0), noise))
        if number > 15 and number % 5 == 0:
            graph.add(gtsam.BetweenFactorPose2(number - 15, number, gtsam.Pose2(7.5, 0.0, 0.0), noise))
    return gtsam.LevenbergMarquardtOptimizer(graph, start).optimize().atPose2(149).x()
