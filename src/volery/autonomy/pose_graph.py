"""A graph of planar poses and the motions measured between them, and the poses that fit them best.

Gauss-Newton on the sparse normal equations (Grisetti, Kuemmerle, Stachniss and Burgard, "A tutorial on
graph-based SLAM", 2010). A measured motion that contradicts the others loses its weight smoothly (dynamic
covariance scaling: Agarwal et al., ICRA 2013), so that one wrong loop closure bends no map.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from volery.autonomy.planar_pose import Array, Pose2
from volery.base.metered_work import done

_ITERATIONS = 20
_ENOUGH = 1e-6  # [m, rad] a step below this ends the iterations


class Edge(NamedTuple):
    """A measured motion from one pose to another, in the frame of the first.

    Args:
        first: Number of the first pose.
        second: Number of the second one.
        motion: The motion.
        information: Inverse of its covariance (3, 3): x, y [m], yaw [rad].
        certain: Whether it cannot be wrong, such as odometry. Others are doubted.
    """

    first: int
    second: int
    motion: Pose2
    information: Array
    certain: bool = False


def optimise(poses: Sequence[Pose2], edges: Sequence[Edge], doubt: float = 10.0) -> tuple[list[Pose2], Array]:
    """Return the poses that fit the edges best, the first one where it was, and the weight of each edge.

    Args:
        poses: Initial poses.
        edges: Measured motions that connect all poses.
        doubt: Squared Mahalanobis distance of an edge from which on it is doubted.

    Returns:
        The poses, and for each edge its weight, 0 to 1: (edges,).
    """
    state = np.array(poses, dtype=np.float64).reshape(-1, 3)
    weights = np.ones(len(edges))
    if len(poses) < 2 or not edges:
        return list(poses), weights
    first = np.array([edge.first for edge in edges])
    second = np.array([edge.second for edge in edges])
    measured = np.array([edge.motion for edge in edges])
    information = np.array([edge.information for edge in edges])
    doubted = np.array([not edge.certain for edge in edges])
    rows, columns = _places(first, second)
    for _ in range(_ITERATIONS):
        done("pose_graph", poses=len(state), edges=len(first))
        error, before, behind = _errors(state[first], state[second], measured)
        chi = np.einsum("ni,nij,nj->n", error, information, error)
        scale = np.minimum(1.0, 2.0 * doubt / (doubt + chi))
        weights = np.where(doubted, scale * scale, 1.0)
        weighed = information * weights[:, None, None]
        to_first, to_second = (
            np.matmul(before.transpose(0, 2, 1), weighed),
            np.matmul(behind.transpose(0, 2, 1), weighed),
        )
        blocks = np.stack(
            (to_first @ before, to_first @ behind, to_second @ before, to_second @ behind), axis=1
        )
        gradient = np.zeros_like(state)
        np.add.at(gradient, first, np.einsum("nij,nj->ni", to_first, error))
        np.add.at(gradient, second, np.einsum("nij,nj->ni", to_second, error))
        size = state.size
        matrix = csc_matrix((blocks.ravel(), (rows, columns)), shape=(size, size))[3:, 3:]
        step = splu(matrix, permc_spec="MMD_AT_PLUS_A").solve(-gradient.ravel()[3:])
        state[1:] += step.reshape(-1, 3)
        state[:, 2] = _wrapped(state[:, 2])
        if np.abs(step).max() < _ENOUGH:
            break
    return [Pose2(*map(float, pose)) for pose in state], weights


def _wrapped(angle: Array) -> Array:
    return angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi))


def _errors(one: Array, other: Array, measured: Array) -> tuple[Array, Array, Array]:
    """Return the errors of the edges (n, 3) and their Jacobians by both poses (n, 3, 3)."""
    cosine, sine = np.cos(one[:, 2]), np.sin(one[:, 2])
    off = other[:, :2] - one[:, :2]
    along = cosine * off[:, 0] + sine * off[:, 1]
    aside = cosine * off[:, 1] - sine * off[:, 0]
    error = np.stack((along, aside, other[:, 2] - one[:, 2]), axis=1) - measured
    error[:, 2] = _wrapped(error[:, 2])
    before, behind = np.zeros((len(one), 3, 3)), np.zeros((len(one), 3, 3))
    before[:, 0, 0], before[:, 0, 1], before[:, 0, 2] = -cosine, -sine, aside
    before[:, 1, 0], before[:, 1, 1], before[:, 1, 2] = sine, -cosine, -along
    before[:, 2, 2] = -1.0
    behind[:, 0, 0], behind[:, 0, 1] = cosine, sine
    behind[:, 1, 0], behind[:, 1, 1] = -sine, cosine
    behind[:, 2, 2] = 1.0
    return error, before, behind


def _places(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and columns of the entries of the four blocks of each edge."""
    ends = np.stack((first, first, second, second), axis=1), np.stack((first, second, first, second), axis=1)
    inside = np.arange(3)
    rows = 3 * ends[0][:, :, None, None] + inside[None, None, :, None] + 0 * inside[None, None, None, :]
    columns = 3 * ends[1][:, :, None, None] + inside[None, None, None, :] + 0 * inside[None, None, :, None]
    return rows.ravel(), columns.ravel()
