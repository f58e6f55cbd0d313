"""Pose of square fiducial markers in a camera's picture, with its covariance.

* OpenCV finds the markers: ArUco (Garrido-Jurado et al., Pattern Recognition 47, 2014) and AprilTag (Olson,
  ICRA 2011; Wang and Olson, IROS 2016). The pose is the infinitesimal plane-based one (Collins and Bartoli,
  IJCV 109, 2014), refined to the least error in the picture.
* The covariance is that of the least squares, from the noise of a corner: it is right where the picture
  decides between the two poses that a small marker seen from far off has. Its place is right in both.

A camera's axes are right, down, ahead (REP 103, optical frames); those of a marker are right, up, out of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from volery.base.errors import UsageError, choices
from volery.base.metered_work import done

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]

FAMILIES = {
    "36h11": cv2.aruco.DICT_APRILTAG_36h11,
    "16h5": cv2.aruco.DICT_APRILTAG_16h5,
    "aruco_4x4": cv2.aruco.DICT_4X4_50,
    "aruco_5x5": cv2.aruco.DICT_5X5_100,
    "aruco_6x6": cv2.aruco.DICT_6X6_250,
}
"""Families of markers by name."""
CORNER_SIGMA = 0.3
"""Standard deviation of a corner, along columns and along rows [pixels]. Measured: markers of 12 to 100
pixels, by day and at dusk."""
_LEAST_DISTANCE = 0.02
"""Of two outlines that are nearer than this share of their length the outer one is kept. With OpenCV's 0.125
that is often the white margin's, and the marker in it is lost."""

_CHANNELS = {
    "mono8": (1, None),
    "8UC1": (1, None),
    "bgr8": (3, cv2.COLOR_BGR2GRAY),
    "rgb8": (3, cv2.COLOR_RGB2GRAY),
    "bgra8": (4, cv2.COLOR_BGRA2GRAY),
    "rgba8": (4, cv2.COLOR_RGBA2GRAY),
}
"""Bytes of a pixel, and what makes it grey, by encoding."""


class CameraModel(NamedTuple):
    """How a camera projects.

    Args:
        matrix: Focal lengths and centre [pixels] (3, 3).
        distortion: k1, k2, p1, p2, k3 (5,).
    """

    matrix: Array
    distortion: Array


class MarkerPose(NamedTuple):
    """Where a marker is.

    Args:
        id: Its number.
        at: Place of its centre, right, down, ahead of the camera [m] (3,).
        turn: Rotation from its axes to the camera's (3, 3).
        covariance: Of the place [m] and of a small rotation about the camera's axes [rad] (6, 6).
        corners: Its corners in the picture, clockwise from its upper left [pixels] (4, 2).
        residual: Root of the mean square distance of the corners from where the pose puts them [pixels].
    """

    id: int
    at: Array
    turn: Array
    covariance: Array
    corners: Array
    residual: float


def marker_cells(family: str, number: int) -> Picture:
    """Return a marker's cells (n, n), black border included: 0 black, 1 white.

    Raises:
        UsageError: There is no such family or no such number in it.
    """
    dictionary = _dictionary(family)
    count = len(dictionary.bytesList)
    if not 0 <= number < count:
        raise UsageError(f"marker {number} of {family}: give a number from 0 to {count - 1}")
    side = dictionary.markerSize + 2
    return (cv2.aruco.generateImageMarker(dictionary, number, side, borderBits=1) > 127).astype(np.uint8)


def picture_of(message: Any) -> Picture:
    """Return the picture of a ``sensor_msgs/Image`` in grey (height, width).

    Raises:
        UsageError: It has not 8 bits of grey or of each colour, or its data are too short.
    """
    if message.encoding not in _CHANNELS:
        raise UsageError(f"a picture of encoding {message.encoding!r}: publish {choices(_CHANNELS)}")
    channels, to_grey = _CHANNELS[message.encoding]
    data = np.frombuffer(bytes(message.data), dtype=np.uint8)
    height, width, step = message.height, message.width, message.step
    done("picture", pixels=height * width)
    if step < width * channels or len(data) < step * height:
        raise UsageError(f"a picture of {width} x {height} pixels has {len(data)} bytes, rows of {step}")
    rows = np.ascontiguousarray(data[: step * height].reshape(height, step)[:, : width * channels])
    if to_grey is None:
        return rows
    return np.asarray(cv2.cvtColor(rows.reshape(height, width, channels), to_grey), dtype=np.uint8)


def camera_of(message: Any) -> CameraModel:
    """Return the model of a ``sensor_msgs/CameraInfo`` of ROS 1 or 2.

    Raises:
        UsageError: The camera is not calibrated, or its distortion is another one than ``plumb_bob``.
    """
    done("camera_model")
    matrix, factors = (
        np.asarray(getattr(message, name, getattr(message, name.lower(), ())), dtype=np.float64)
        for name in ("K", "D")
    )
    if matrix.size != 9 or matrix.flat[0] <= 0.0:
        raise UsageError("the camera is not calibrated: its CameraInfo has no focal length in K")
    if message.distortion_model not in ("plumb_bob", "") or factors.size > 5:
        raise UsageError(f"distortion {message.distortion_model!r}: calibrate the camera as plumb_bob")
    distortion = np.zeros(5)
    distortion[: factors.size] = factors
    return CameraModel(matrix.reshape(3, 3), distortion)


def rectified_camera_of(message: Any) -> CameraModel:
    """Return the model of the rectified pictures beside a ``sensor_msgs/CameraInfo`` of ROS 1 or 2.

    Raises:
        UsageError: The camera is not calibrated.
    """
    matrix = np.asarray(getattr(message, "P", getattr(message, "p", ())), dtype=np.float64)
    if matrix.size != 12 or matrix.flat[0] <= 0.0:
        raise UsageError("the camera is not calibrated: its CameraInfo has no focal length in P")
    return CameraModel(np.ascontiguousarray(matrix.reshape(3, 4)[:, :3]), np.zeros(5))


class MarkerFinder:
    """Finds the markers of one family in pictures.

    Args:
        sizes: Side of the black square [m] of each number that is looked for.
        family: One of ``FAMILIES``.
        corner_sigma: Standard deviation of a corner in the picture [pixels].

    Raises:
        UsageError: There is no such family, or a size is not above 0.

    Example:
        >>> finder = MarkerFinder({7: 0.4})
        >>> finder.find(np.zeros((240, 320), dtype=np.uint8), CameraModel(np.eye(3), np.zeros(5)))
        []
    """

    def __init__(
        self, sizes: Mapping[int, float], family: str = "36h11", corner_sigma: float = CORNER_SIGMA
    ) -> None:
        wrong = [number for number, size in sizes.items() if not size > 0.0]
        if wrong:
            raise UsageError(f"marker {wrong[0]}: give its side in metres, above 0")
        self._sizes = dict(sizes)
        self._sigma = corner_sigma
        parameters = cv2.aruco.DetectorParameters()
        parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        parameters.cornerRefinementWinSize = 4
        parameters.minMarkerDistanceRate = _LEAST_DISTANCE
        self._detector = cv2.aruco.ArucoDetector(_dictionary(family), parameters)

    def find(self, picture: Picture, camera: CameraModel) -> list[MarkerPose]:
        """Return the markers in a picture (height, width), by number.

        Markers of other numbers, and those whose pose is not determined, are left out.
        """
        found, numbers, rejected = self._detector.detectMarkers(picture)
        done("detection", pixels=picture.size, candidates=len(found) + len(rejected))
        poses = []
        for corners, number in zip(found, () if numbers is None else numbers.reshape(-1), strict=True):
            size = self._sizes.get(int(number))
            if size is not None:
                pose = self._pose(
                    int(number), np.asarray(corners, dtype=np.float64).reshape(4, 2), size, camera
                )
                if pose is not None:
                    poses.append(pose)
        return sorted(poses, key=lambda one: (one.id, one.residual))

    def _pose(self, number: int, corners: Array, size: float, camera: CameraModel) -> MarkerPose | None:
        done("marker_pose")
        half = 0.5 * size
        square = np.array([(-half, half, 0.0), (half, half, 0.0), (half, -half, 0.0), (-half, -half, 0.0)])
        count, turns, places, _ = cv2.solvePnPGeneric(
            square, corners, *camera, flags=cv2.SOLVEPNP_IPPE_SQUARE
        )
        best: MarkerPose | None = None
        for vector, start in zip(turns[:count], places[:count], strict=True):
            turn, place = cv2.solvePnPRefineLM(square, corners, *camera, vector.copy(), start.copy())
            seen, slopes = cv2.projectPoints(square, turn, place, *camera)
            off = seen.reshape(4, 2) - corners
            residual = float(np.sqrt(np.mean(np.sum(off * off, axis=1))))
            rotation = np.asarray(cv2.Rodrigues(turn)[0], dtype=np.float64)
            if not np.isfinite(residual) or place[2] <= 0.0 or (best and best.residual <= residual):
                continue
            # a small rotation in the camera's axes, and not a change of the vector that cv2 derives by
            arms = square @ rotation.T
            by_turn = np.zeros((8, 3))
            by_place = np.ascontiguousarray(slopes[:, 3:6])
            for row in range(8):
                by_turn[row] = np.cross(arms[row // 2], by_place[row])
            jacobian = np.hstack((by_place, by_turn))
            information = jacobian.T @ jacobian / (self._sigma * self._sigma)
            if np.linalg.cond(information) > 1e14:
                continue
            covariance = np.linalg.inv(information)
            at = np.asarray(place, dtype=np.float64).reshape(3)
            best = MarkerPose(number, at, rotation, covariance, corners, residual)
        return best


def _dictionary(family: str) -> Any:
    if family not in FAMILIES:
        raise UsageError(f"no family of markers {family!r}; there is {choices(FAMILIES)}")
    return cv2.aruco.getPredefinedDictionary(FAMILIES[family])
