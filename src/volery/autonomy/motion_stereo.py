"""Poses and planar scans from one moving grey camera: tracks of corners, odometry, triangulation.

* Corners are tracked from picture to picture (Shi and Tomasi, CVPR 1994). After each piece of the way a
  picture is kept as a view.
* The motion between two views is that of the odometry, whose rotation and direction are corrected until the
  essential matrix fits the tracks: least squares of Sampson's distances with robust weights and the odometry
  as a prior (Hartley and Zisserman, Multiple View Geometry, 11.4). How far it went is the odometry's, as one
  camera does not see it.
* A track in several views is a point where its rays meet. The points about the camera's height of the last
  views together are a scan around the vehicle.

Matrices (4, 4) are poses of a camera or a vehicle, which take points of its frame to another one. A camera's
axes are right, down, ahead (REP 103, optical frames).
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from volery.autonomy.laser_scan import LaserScan2
from volery.autonomy.markers import CameraModel, Picture
from volery.autonomy.planar_pose import Array, Pose2
from volery.autonomy.slam import SlamSettings
from volery.base.elementary import atan2, sine_cosine
from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.ros.client_libraries.tf2.transform_tree import RigidTransform, rotated

OF_VIEWS = SlamSettings(
    slip=0.002, skid=0.002, drift=0.0005, shift=0.001, turn=0.0005, fit=0.6, reach=1.0, weak=0.1
)
"""For the scans and poses of ``MotionStereo``: its poses are surer than where a scan of such points fits, but
after a long way, where loops close."""

BEAM = 0.0175
"""Angle between the beams of a scan [rad]; they lie in the middle of its multiples."""

_STEP, _TURN = 0.1, 0.1
"""Way [m] or turn [rad] after which a picture is a view."""
_VIEWS = 12
"""Views of which the rays of a point are taken."""
_GATHERED = 30
"""Views whose points are in a scan."""
_CORNERS = 400  # that are tracked
_APART = 0.019  # least distance of a new corner from others, part of the picture's width
_QUALITY = 0.01  # of the worst corner, part of the best one's
_WINDOW = (9, 9)  # [pixels] that must look the same in the next picture: in larger ones the view changes
_EDGE = 5  # [pixels] along the edge in which nothing is tracked
_RETURN = 0.5  # [pixels] within which a corner must be found again backwards
_NOISE = 0.3  # [pixels] standard deviation of a tracked corner
_OUTLIER = 2.0  # standard deviations from which on a track has little weight
_LEAST_TRACKS = 15  # with which a motion is corrected
_SLIP, _SHIFT = 0.05, 0.002  # standard deviation of the odometry across its way: part of it, and [m]
_SKID, _SHAKE = 0.1, 0.005  # the same of its rotation: part of the turn, and [rad]
_STILL = 0.001  # [m] a shorter way shows nothing but the rotation
_ROUNDS = 5  # of the least squares
_LEAST_VIEWS = 4  # of a point
_SURE = 0.02  # largest standard deviation of a point's distance: part of it
_BELOW, _ABOVE = 1.0, 0.5  # [m] from the camera's height that a point may be
_FLOOR = 0.15  # [m] above the plane in which the odometry began, below which a point may be of the floor
_LEAST_POINTS = 3  # of a beam
_LEAST_BEAMS = 20  # of a scan
_DEEP = 0.25  # [m] points of one beam that are farther apart are of several walls


class KeptPicture(NamedTuple):
    """A picture that is kept.

    Args:
        pose: Pose of the camera in the frame of the first view (4, 4).
        tracks: Numbers of the tracks in it (n,), which grow.
        rays: Where they are in the plane one ahead of the camera: right, down (n, 2).
    """

    pose: Array
    tracks: NDArray[np.int64]
    rays: Array


class Sighting(NamedTuple):
    """What a view adds.

    Args:
        pose: Pose of the vehicle by pictures and odometry; the first one is that of the odometry.
        scan: What the last views have seen, in the vehicle's frame.
    """

    pose: Pose2
    scan: LaserScan2


class MotionStereo:
    """Takes the pictures of one camera and the odometry of its vehicle.

    Args:
        camera: How the camera projects.
        mounting: From the camera's optical frame to the vehicle's frame.

    Example::

        stereo = MotionStereo(camera_of(info), AHEAD)
        slam = Slam(OF_VIEWS)
        for time, picture, odometry in recording:
            seen = stereo.add(time, picture, odometry)
            if seen is not None:
                pose = slam.add(seen.pose, seen.scan)
    """

    def __init__(self, camera: CameraModel, mounting: RigidTransform) -> None:
        self._camera, self._mounting = camera, _matrix(mounting)
        self._noise = _NOISE / float(np.sqrt(camera.matrix[0, 0] * camera.matrix[1, 1]))
        self._views: deque[KeptPicture] = deque(maxlen=_VIEWS)
        self._seen: deque[tuple[Pose2, Array]] = deque(maxlen=_GATHERED)  # points in the frame of a pose
        self._picture: Picture | None = None
        self._odometry = self._at_view = np.eye(4)  # of the camera, at the last picture and at the last view
        self._pose, self._level = Pose2(), np.eye(3)  # of the vehicle at the last view; from it to level axes
        self._tracks = np.zeros(0, dtype=np.int64)
        self._pixels = np.zeros((0, 2), dtype=np.float32)
        self._next = 0

    def add(self, time: Ns, picture: Picture, odometry: RigidTransform) -> Sighting | None:
        """Take the next picture; return what it adds if it is a view.

        Args:
            time: When it was taken [ns].
            picture: The picture (height, width).
            odometry: Pose of the vehicle by its odometry at that time, in three dimensions.

        Raises:
            UsageError: The picture is not of the size of the one before.
        """
        vehicle = _matrix(odometry)
        camera, yaw = vehicle @ self._mounting, atan2(float(vehicle[1, 0]), float(vehicle[0, 0]))
        sine, cosine = sine_cosine(yaw)
        level = np.array(((cosine, sine, 0.0), (-sine, cosine, 0.0), (0.0, 0.0, 1.0))) @ vehicle[:3, :3]
        if self._picture is None:
            self._pose = Pose2(float(vehicle[0, 3]), float(vehicle[1, 3]), yaw)
            self._keep(picture, camera, np.eye(4), level)
            return None
        if picture.shape != self._picture.shape:
            height, width = self._picture.shape
            raise UsageError(f"a picture of {picture.shape[1]} x {picture.shape[0]} after {width} x {height}")
        self._track(self._picture, picture, _inverse(camera) @ self._odometry)
        self._picture, self._odometry = picture, camera
        motion = _inverse(self._at_view) @ camera
        way, turn = _size(motion)
        if way < _STEP and turn < _TURN:
            return None
        motion = self._corrected(motion, way, turn)
        moved = self._mounting @ motion @ _inverse(self._mounting)
        along, axes = self._level @ moved[:3, 3], self._level @ moved[:3, :3] @ level.T
        step = Pose2(float(along[0]), float(along[1]), atan2(float(axes[1, 0]), float(axes[0, 0])))
        self._pose = self._pose.after(step)
        self._keep(picture, camera, self._views[-1].pose @ motion, level)
        self._seen.append((self._pose, self._points(level, float(camera[2, 3]))))
        points = np.vstack([self._pose.to(pose).of(points) for pose, points in self._seen])
        return Sighting(self._pose, LaserScan2(time, _beams(points), np.zeros((0, 2))))

    # -- tracks

    def _track(self, before: Picture, picture: Picture, turn: Array) -> None:
        """Find the corners again; the rotation by odometry says where to begin."""
        rays = np.hstack((self._rays(), np.ones((len(self._pixels), 1)))) @ turn[:3, :3].T
        ahead = rays[:, 2] > 0.1
        self._pixels, self._tracks = self._pixels[ahead], self._tracks[ahead]
        if not len(self._pixels):
            return
        there, _ = cv2.projectPoints(rays[ahead], np.zeros(3), np.zeros(3), *self._camera)
        after, found = _followed(before, picture, self._pixels, there.reshape(-1, 2).astype(np.float32))
        back, again = _followed(picture, before, after, self._pixels)
        off = back - self._pixels
        height, width = picture.shape
        good = found & again & ((off * off).sum(axis=1) < _RETURN * _RETURN)
        good &= ((after >= _EDGE) & (after < (width - _EDGE, height - _EDGE))).all(axis=1)
        self._pixels, self._tracks = after[good], self._tracks[good]

    def _rays(self) -> Array:
        """Return where the corners are in the plane one ahead of the camera (n, 2)."""
        if not len(self._pixels):
            return np.zeros((0, 2))
        flat = cv2.undistortPoints(self._pixels.reshape(-1, 1, 2).astype(np.float64), *self._camera)
        return np.asarray(flat, dtype=np.float64).reshape(-1, 2)

    def _keep(self, picture: Picture, odometry: Array, pose: Array, level: Array) -> None:
        """Keep a picture as a view, and look for corners where none is tracked."""
        missing = _CORNERS - len(self._pixels)
        if missing > 0:
            apart = max(_APART * picture.shape[1], 4.0)
            free = np.full(picture.shape, 255, dtype=np.uint8)
            for x, y in self._pixels:
                cv2.circle(free, (round(float(x)), round(float(y))), round(apart), (0,), -1)
            found = cv2.goodFeaturesToTrack(picture, missing, _QUALITY, apart, mask=free, blockSize=5)
            fresh = np.zeros((0, 2), dtype=np.float32) if found is None else found.reshape(-1, 2)
            self._pixels = np.vstack((self._pixels, fresh)).astype(np.float32)
            self._tracks = np.concatenate((self._tracks, self._next + np.arange(len(fresh))))
            self._next += len(fresh)
        self._views.append(KeptPicture(pose, self._tracks, self._rays()))
        self._picture, self._odometry, self._at_view, self._level = picture, odometry, odometry, level

    # -- motion

    def _corrected(self, motion: Array, way: float, turn: float) -> Array:
        """Return the pose of the camera in the frame of the last view that fits the tracks best."""
        last = self._views[-1]
        _, old, new = np.intersect1d(last.tracks, self._tracks, assume_unique=True, return_indices=True)
        if len(old) < _LEAST_TRACKS:
            return motion
        before, after = last.rays[old], self._rays()[new]
        moves = way > _STILL
        turned = _SHAKE + _SKID * turn
        sigma = np.array([turned] * 3 + [_SLIP + _SHIFT / way] * 2 if moves else [turned] * 3)
        sideways = np.linalg.svd(motion[:3, 3].reshape(1, 3))[2][1:]

        def changed(by: Array) -> Array:
            result = motion.copy()
            result[:3, :3] = _rotation(by[:3]) @ motion[:3, :3]
            if moves:
                place = motion[:3, 3] + way * (by[3:] @ sideways)
                result[:3, 3] = place * (way / np.sqrt(place @ place))
            return result

        by, tiny = np.zeros(len(sigma)), 1e-6
        for _ in range(_ROUNDS):
            off = _misfit(changed(by), before, after) / self._noise
            steps = [_misfit(changed(by + tiny * unit), before, after) for unit in np.eye(len(by))]
            slopes = np.stack([(step / self._noise - off) / tiny for step in steps], axis=1)
            ratio = off / _OUTLIER
            weighted = slopes / (1.0 + ratio * ratio)[:, None]
            normal = weighted.T @ slopes + np.diag(1.0 / (sigma * sigma))
            by = by - np.linalg.solve(normal, weighted.T @ off + by / (sigma * sigma))
        return changed(by)

    # -- points

    def _points(self, level: Array, height: float) -> Array:
        """Return the points near the camera's height that the last view sees, in the vehicle's plane (n, 2).

        Args:
            level: From the axes of the vehicle to level ones (3, 3).
            height: Height of the camera by odometry [m].
        """
        now = self._views[-1]
        origins, ways = np.zeros((2, len(self._views), len(now.tracks), 3))
        seen = np.zeros((len(self._views), len(now.tracks)), dtype=np.bool_)
        back = _inverse(now.pose)
        for view, origin, way, there in zip(self._views, origins, ways, seen, strict=True):
            _, old, new = np.intersect1d(view.tracks, now.tracks, assume_unique=True, return_indices=True)
            pose = back @ view.pose
            along = np.hstack((view.rays[old], np.ones((len(old), 1)))) @ pose[:3, :3].T
            way[new] = along / np.sqrt((along * along).sum(axis=1))[:, None]
            origin[:], there[new] = pose[:3, 3], True
        points, sigma = _triangulated(origins, ways, seen, self._noise)
        flat = points @ (level @ self._mounting[:3, :3]).T
        camera = level @ self._mounting[:3, 3]
        lowest = max(-_BELOW, min(_FLOOR - height, -0.1))
        good = (sigma < _SURE) & (flat[:, 2] > lowest) & (flat[:, 2] < _ABOVE)
        result: Array = (flat[good] + camera)[:, :2]
        return result


def _matrix(rigid: RigidTransform) -> Array:
    """Return a rigid transform as a matrix."""
    result = np.eye(4)
    axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    result[:3, :3] = np.array([rotated(rigid.rotation, axis) for axis in axes]).T
    result[:3, 3] = rigid.translation
    return result


def _inverse(pose: Array) -> Array:
    back = np.eye(4)
    back[:3, :3] = pose[:3, :3].T
    back[:3, 3] = -pose[:3, :3].T @ pose[:3, 3]
    return back


def _cross(vector: Array) -> Array:
    """Return the matrix whose product with another vector is the cross product (3, 3)."""
    x, y, z = vector
    return np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))


def _rotation(by: Array) -> Array:
    """Return a small rotation about three axes [rad], by Cayley's transform (3, 3)."""
    half = 0.5 * _cross(by)
    return np.asarray(np.linalg.solve(np.eye(3) - half, np.eye(3) + half), dtype=np.float64)


def _size(motion: Array) -> tuple[float, float]:
    """Return the length of a motion [m] and its turn [rad], nearly: twice the sine of half of it."""
    place, cosine = motion[:3, 3], 0.5 * (float(np.trace(motion[:3, :3])) - 1.0)
    return float(np.sqrt(place @ place)), float(np.sqrt(max(2.0 * (1.0 - cosine), 0.0)))


def _followed(
    before: Picture, after: Picture, pixels: NDArray[np.float32], guess: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return where pixels (n, 2) of one picture are in another, and whether they were found there."""
    there, found, _ = cv2.calcOpticalFlowPyrLK(
        before,
        after,
        np.ascontiguousarray(pixels).reshape(-1, 1, 2),
        guess.reshape(-1, 1, 2).copy(),
        winSize=_WINDOW,
        maxLevel=2,
        criteria=(cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 20, 0.01),
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    return np.asarray(there, dtype=np.float32).reshape(-1, 2), np.asarray(found).reshape(-1) == 1


def _misfit(motion: Array, before: Array, after: Array) -> Array:
    """Return how far pairs of rays (n, 2) are from fitting a motion, in the plane one ahead of the camera."""
    turn, place = motion[:3, :3], motion[:3, 3]
    ones = np.ones((len(before), 1))
    one, other = np.hstack((before, ones)), np.hstack((after, ones))
    if place @ place < _STILL * _STILL:
        turned = other @ turn.T
        return np.asarray((turned[:, :2] / turned[:, 2:] - before).ravel())
    essential = _cross(place) @ turn
    lines, back = other @ essential.T, one @ essential
    slope = (lines[:, :2] * lines[:, :2] + back[:, :2] * back[:, :2]).sum(axis=1)
    return np.asarray((one * lines).sum(axis=1) / np.sqrt(np.maximum(slope, 1e-18)))


def _triangulated(origins: Array, ways: Array, seen: NDArray[np.bool_], noise: float) -> tuple[Array, Array]:
    """Return the points nearest to rays (n, 3), and the standard deviation of their distances: part of them.

    Args:
        origins: Where the rays of each view begin (views, n, 3).
        ways: Their directions, of length 1 (views, n, 3).
        seen: Whether there is such a ray (views, n).
        noise: Standard deviation of a direction [rad].

    The deviation is infinite where the rays do not meet, or behind the camera.
    """
    across = np.eye(3) - ways[..., :, None] * ways[..., None, :]
    pulls = across @ origins[..., None]
    weights = seen.astype(np.float64)
    enough = seen.sum(axis=0) >= _LEAST_VIEWS
    for _ in range(3):  # a miss counts by its angle: the nearer the view, the more
        normal, right = ((weights[..., None, None] * part).sum(axis=0) for part in (across, pulls))
        size = np.trace(normal, axis1=1, axis2=2)
        enough &= np.linalg.det(normal) > 1e-9 * size * size * size
        normal[~enough] = np.eye(3)
        points: Array = np.linalg.solve(normal, right)[..., 0]
        to = points - origins
        distances = np.maximum(np.sqrt((to * to).sum(axis=2)), 0.05)
        weights = seen / (distances * distances)
    along = (to * ways).sum(axis=2)
    miss = (to - along[..., None] * ways) * np.sqrt(weights)[..., None]
    miss_square = (miss * miss).sum(axis=(0, 2)) / np.maximum(seen.sum(axis=0), 1)
    normal = (weights[..., None, None] * across).sum(axis=0)
    normal[~enough] = np.eye(3)
    covariance = np.linalg.inv(normal) * (noise * noise)
    far = np.maximum((points * points).sum(axis=1), 1e-9)
    sigma = np.sqrt(np.maximum(np.einsum("ni,nij,nj->n", points, covariance, points), 0.0)) / far
    good = (
        enough
        & (miss_square < 9.0 * noise * noise)
        & (points[:, 2] > 0.1)
        & ((along > 0.0) | ~seen).all(axis=0)
    )
    return points, np.where(good, sigma, np.inf)


def _beams(points: Array) -> Array:
    """Return one point for each direction around the vehicle (n, 2): the middle of the nearest wall's."""
    bearings = np.floor(np.arctan2(points[:, 1], points[:, 0]) / BEAM).astype(np.int64)
    distances = np.sqrt((points * points).sum(axis=1))
    order = np.lexsort((distances, bearings))
    numbers, starts, counts = np.unique(bearings[order], return_index=True, return_counts=True)
    ends = []
    for number, start, count in zip(numbers, starts, counts, strict=True):
        own = distances[order[start : start + count]]
        if count >= _LEAST_POINTS:
            near = own[own < own[count // 4] + _DEEP]
            sine, cosine = sine_cosine((float(number) + 0.5) * BEAM)
            ends.append((near[len(near) // 2] * cosine, near[len(near) // 2] * sine))
    return np.array(ends) if len(ends) >= _LEAST_BEAMS else np.zeros((0, 2))
