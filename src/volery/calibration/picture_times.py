"""Calls of OpenCV, gtsam and small_gicp, where they are installed, for the table of library calls.

Pictures are of 8 bits a pixel, with markers and noise: what a detector takes depends on what it sees. OpenCV
works in one thread meanwhile, as on a computer whose other cores are busy.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

Call = tuple[str, str, Callable[..., object], tuple[object, ...]]
"""Entry, size or feature, function and its arguments."""

PICTURES = ((120, 160), (240, 320), (480, 640), (720, 1280))
"""Heights and widths [pixels]."""
_TILE = 60


def module_if_installed(name: str) -> Any:
    """Return a module, or None where it cannot be imported."""
    try:
        return import_module(name)
    except ImportError:
        return None


def picture(height: int, width: int, markers: int, seed: int = 1) -> NDArray[np.uint8]:
    """Return a picture of uneven ground with noise, and markers of 60 pixels on it, AprilTag 36h11."""
    import cv2  # noqa: PLC0415  # an extra

    random = np.random.default_rng(seed)
    coarse = random.normal(120.0, 25.0, (height // 12 + 1, width // 12 + 1)).astype(np.float32)
    floor = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC).astype(np.float64)
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    across = max(1, width // (_TILE + 20))
    for number in range(markers):
        row, column = 10 + number // across * (_TILE + 20), 10 + number % across * (_TILE + 20)
        if row + _TILE > height or column + _TILE > width:
            break
        floor[row - 8 : row + _TILE + 8, column - 8 : column + _TILE + 8] = 230.0
        floor[row : row + _TILE, column : column + _TILE] = cv2.aruco.generateImageMarker(
            family, number, _TILE
        )
    noisy = cv2.GaussianBlur(floor, (3, 3), 0.7) + random.normal(0.0, 3.0, (height, width))
    return np.clip(noisy, 0, 255).astype(np.uint8)


def picture_calls() -> Iterator[Call]:
    """Yield calls by size."""
    cv2 = module_if_installed("cv2")
    if cv2 is not None:
        cv2.setNumThreads(1)
        for shape in PICTURES:
            yield from _of_pictures(cv2, picture(*shape, 0), picture(*shape, 0, 2))
        yield from _of_points(cv2)
    yield from _of_graphs(module_if_installed("gtsam"))
    yield from _of_clouds(module_if_installed("small_gicp"))


def _of_pictures(cv2: Any, one: NDArray[np.uint8], other: NDArray[np.uint8]) -> Iterator[Call]:
    height, width = one.shape
    size, matrix = (width, height), np.array([[0.9, 0.1, 5.0], [-0.1, 0.9, 3.0]])
    colours, camera = np.dstack((one, other, one)), np.array([[300.0, 0, 160], [0, 300.0, 120], [0, 0, 1.0]])
    mask = cv2.threshold(one, 128, 255, cv2.THRESH_BINARY)[1]
    across, down = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11))
    for name, given in _filters(3):
        yield f"cv2.{name}", "items", getattr(cv2, name), (one, *given)
    yield "cv2.resize", "outcome", cv2.resize, (one, (width // 2, height // 2))
    yield "cv2.cvtColor", "outcome", cv2.cvtColor, (colours, cv2.COLOR_BGR2GRAY)
    yield "cv2.warpAffine", "outcome", cv2.warpAffine, (one, matrix, size)
    yield "cv2.warpPerspective", "outcome", cv2.warpPerspective, (one, np.vstack((matrix, (0, 0, 1))), size)
    yield "cv2.remap", "outcome", cv2.remap, (one, across, down, cv2.INTER_LINEAR)
    yield "cv2.undistort", "outcome", cv2.undistort, (one, camera, np.array((0.1, 0.0, 0.0, 0.0)))
    for name, given in (
        ("threshold", (128, 255, cv2.THRESH_BINARY)), ("absdiff", (other,)), ("Canny", (50, 150)),
        ("adaptiveThreshold", (255, cv2.ADAPTIVE_THRESH_MEAN_C, cv2.THRESH_BINARY, 11, 2)),
        ("Sobel", (cv2.CV_16S, 1, 0)), ("Laplacian", (cv2.CV_16S,)), ("equalizeHist", ()), ("flip", (1,)),
        ("inRange", (50, 100)), ("bitwise_and", (other,)), ("addWeighted", (0.5, other, 0.5, 0)),
        ("pyrDown", ()), ("integral", ()), ("countNonZero", ()), ("minMaxLoc", ()), ("meanStdDev", ()),
    ):  # fmt: skip
        yield f"cv2.{name}", "items", getattr(cv2, name), (one, *given)
    yield "cv2.findContours", "items", cv2.findContours, (mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    yield "cv2.connectedComponents", "items", cv2.connectedComponents, (mask,)
    yield "cv2.goodFeaturesToTrack", "items", cv2.goodFeaturesToTrack, (one, 100, 0.01, 8)
    yield "cv2.calcOpticalFlowFarneback", "items", cv2.calcOpticalFlowFarneback, (
        one, np.roll(one, 2, 1), None, 0.5, 3, 15, 3, 5, 1.2, 0,
    )  # fmt: skip
    few = np.array([[[30, 30]], [[60, 40]]], dtype=np.float32)
    yield "cv2.calcOpticalFlowPyrLK", "items", cv2.calcOpticalFlowPyrLK, (one, np.roll(one, 2, 1), few, None)
    if height > PICTURES[0][0]:  # the smallest is of no use for markers
        yield "cv2.detectMarkers", "items", detector.detectMarkers, (one,)
    yield "cv2.detectAndCompute", "items", cv2.ORB_create(20).detectAndCompute, (one, None)
    yield "cv2.detect", "items", cv2.FastFeatureDetector_create(40).detect, (one,)
    yield "cv2.imencode", "items", cv2.imencode, (".jpg", one)
    yield "cv2.imdecode", "outcome", cv2.imdecode, (cv2.imencode(".jpg", one)[1], cv2.IMREAD_GRAYSCALE)


def _filters(side: int) -> Iterator[tuple[str, tuple[object, ...]]]:
    """Yield filters and their arguments after the picture."""
    yield "GaussianBlur", ((side, side), 0)
    yield "blur", ((side, side),)
    yield "medianBlur", (side,)
    yield "erode", (np.ones((side, side), np.uint8),)
    yield "dilate", (np.ones((side, side), np.uint8),)


def _of_points(cv2: Any) -> Iterator[Call]:
    random = np.random.default_rng(3)
    camera, still = np.array([[300.0, 0, 160], [0, 300.0, 120], [0, 0, 1.0]]), np.zeros(5)
    turn, place = np.array((0.1, -0.2, 0.05)), np.array((0.1, 0.2, 4.0))
    for count in (4, 16, 64, 256, 1024):
        points = random.uniform(-1.0, 1.0, (count, 3))
        seen = cv2.projectPoints(points, turn, place, camera, still)[0].reshape(-1, 2)
        yield "cv2.projectPoints", "items", cv2.projectPoints, (points, turn, place, camera, still)
        if count > 4:
            yield "cv2.solvePnP", "items", cv2.solvePnP, (points, seen, camera, still)
            yield "cv2.solvePnPRansac", "items", cv2.solvePnPRansac, (points, seen, camera, still)
        yield "cv2.solvePnPRefineLM", "items", cv2.solvePnPRefineLM, (
            points, seen, camera, still, turn + 0.02, place + 0.02,
        )  # fmt: skip
        yield "cv2.undistortPoints", "items", cv2.undistortPoints, (seen, camera, still)
        yield "cv2.findHomography", "items", cv2.findHomography, (seen, seen * 1.1, cv2.RANSAC)
        rows = random.integers(0, 256, (count, 32)).astype(np.uint8)
        yield "cv2.match", "pairs", cv2.BFMatcher(cv2.NORM_HAMMING).match, (rows, rows[::-1].copy())
    square = np.array([(-1.0, 1.0, 0), (1.0, 1.0, 0), (1.0, -1.0, 0), (-1.0, -1.0, 0)])
    flat = cv2.projectPoints(square, turn, place, camera, still)[0].reshape(-1, 2)
    yield "cv2.solvePnPGeneric", "items", (
        lambda points, seen: cv2.solvePnPGeneric(points, seen, camera, still, flags=cv2.SOLVEPNP_IPPE_SQUARE)
    ), (square, flat)  # fmt: skip
    yield "cv2.Rodrigues", "items", cv2.Rodrigues, (turn,)
    yield "cv2.*", "items", cv2.norm, (np.ones((8, 8)),)


def picture_features() -> Iterator[Call]:
    """Yield the calls that price what a picture shows."""
    cv2 = module_if_installed("cv2")
    if cv2 is None:
        return
    busy = picture(480, 640, 12)
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11))
    yield "cv2.detectMarkers", "candidates", detector.detectMarkers, (busy,)
    yield "cv2.detectAndCompute", "candidates", cv2.ORB_create(500).detectAndCompute, (busy, None)
    for name, given in _filters(9):
        yield f"cv2.{name}", "window", getattr(cv2, name), (busy, *given)
    many = cv2.goodFeaturesToTrack(busy, 200, 0.01, 8)
    yield "cv2.calcOpticalFlowPyrLK", "candidates", cv2.calcOpticalFlowPyrLK, (
        busy, np.roll(busy, 2, 1), many, None,
    )  # fmt: skip


def _of_graphs(gtsam: Any) -> Iterator[Call]:
    if gtsam is None:
        return
    for count in (10, 30, 100, 300, 1000):
        graph, values = _pose_graph(gtsam, count)
        yield (
            "gtsam.LevenbergMarquardtOptimizer",
            "variables",
            gtsam.LevenbergMarquardtOptimizer,
            (graph, values),
        )

        def solve(optimizer: Any, graph: Any = graph, values: Any = values) -> object:
            """A solver that has finished would return at once: each call has one of its own."""
            return gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()

        yield "gtsam.optimize", "variables", solve, (gtsam.LevenbergMarquardtOptimizer(graph, values),)
    yield "gtsam.*", "items", gtsam.Pose2, (1.0, 2.0, 0.1)


def _pose_graph(gtsam: Any, count: int) -> tuple[Any, Any]:
    """Return a graph of poses on rounds of twenty, each also seen from the round before, and its start."""
    random = np.random.default_rng(count)
    graph, values, noise = (
        gtsam.NonlinearFactorGraph(),
        gtsam.Values(),
        gtsam.noiseModel.Isotropic.Sigma(3, 0.1),
    )
    graph.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(0, 0, 0), noise))
    step, pose = gtsam.Pose2(0.3, 0.0, 0.31416), gtsam.Pose2(0, 0, 0)
    for number in range(count):
        values.insert(number, pose.compose(gtsam.Pose2(*random.normal(0.0, 0.1, 3))))
        if number:
            graph.add(gtsam.BetweenFactorPose2(number - 1, number, step, noise))
        if number >= 20:
            graph.add(gtsam.BetweenFactorPose2(number - 20, number, gtsam.Pose2(0, 0, 0), noise))
        pose = pose.compose(step)
    return graph, values


def _of_clouds(small_gicp: Any) -> Iterator[Call]:
    if small_gicp is None:
        return
    random = np.random.default_rng(6)
    for count in (300, 1000, 3000, 10_000, 30_000):
        cloud = random.uniform(-10.0, 10.0, (count, 3))
        cloud[:, 2] = np.sin(cloud[:, 0]) + 0.1 * cloud[:, 1]
        moved = cloud + np.array((0.1, 0.05, 0.02))
        target, tree = small_gicp.preprocess_points(cloud, 0.25, 10, 1)
        source, _ = small_gicp.preprocess_points(moved, 0.25, 10, 1)
        yield "small_gicp.preprocess_points", "points", small_gicp.preprocess_points, (cloud, 0.25, 10, 1)
        yield "small_gicp.align", "points", small_gicp.align, (target, source, tree)
    yield "small_gicp.voxelgrid_sampling", "points", small_gicp.voxelgrid_sampling, (cloud, 0.25, 1)
