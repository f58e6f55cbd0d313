"""Simultaneous localisation and mapping with planar scans: a graph of the poses at which scans were taken.

Each scan is matched with the scans just before it; where the way comes back to a place, with those taken
there before, which closes a loop. A loop is accepted if several scans in a row fit the place; the graph of
poses takes its weight away again if it contradicts the rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

import numpy as np

from volery.autonomy.laser_scan import LaserScan2
from volery.autonomy.planar_pose import Array, Pose2
from volery.autonomy.pose_graph import Edge, optimise
from volery.autonomy.scan_matching import RESOLUTION, LocalMap, Match, normals_of
from volery.base.metered_work import done
from volery.base.time import Ns


@dataclass(frozen=True)
class SlamSettings:
    """How scans become a map.

    Args:
        slip: Standard deviation of the odometry: part of the distance.
        skid: The same of the yaw: part of the turn.
        drift: The same of the yaw by distance [rad/m].
        shift: Least standard deviation of the position [m].
        turn: Least standard deviation of the yaw [rad].
        key_distance: A scan is kept if it was taken this far from the last one kept [m].
        key_turn: Or turned by this [rad].
        recent: Number of scans before it with which a scan is matched.
        place: Number of scans that make a place, for closing loops.
        reach: Largest error of the pose [m] that is looked for where a loop closes.
        fit: Mean likelihood from which on a scan fits a place.
        weak: Share of the largest information on the position below which a scan does not say where it is in
            a direction, as along a bare wall; there the odometry counts. 0: the scan always counts.
    """

    slip: float = 0.1
    skid: float = 0.1
    drift: float = 0.02
    shift: float = 0.02
    turn: float = 0.005
    key_distance: float = 0.3
    key_turn: float = 0.25
    recent: int = 12
    place: int = 10
    reach: float = 6.0
    fit: float = 0.6
    weak: float = 0.0


OF_CAMERA = SlamSettings(weak=0.03)
"""For scans of a narrow field, in which there is often but one wall."""


@dataclass
class KeyScan:
    """A scan that was kept, where odometry was then if it was known, and the normals of its points (n, 2)."""

    scan: LaserScan2
    odometry: Pose2 | None
    normals: Array


_KNOWN = np.array((0.02, 0.02, 0.006))
"""Standard deviations of a match on the best of maps [m, m, rad]."""
_BLIND = np.array((0.15, 0.15, 0.1))
"""Standard deviations of a motion without odometry, from the one before [m, m, rad]."""
_WIDE = np.array((1.5, 1.5, 0.6))
"""Window [m, m, rad] in which a scan is searched for that does not fit where odometry says."""
_BETTER = 0.15  # share of a scan by which it must fit better there
_LOST = 0.25  # share of a scan on the map below which its place is not known
_FAR = 100.0  # [m] from a scan to an earlier one with which it has nothing in common
_STRAYED = 5.0  # standard deviations of the odometry from which on it has slipped


class Slam:
    """The map so far, and where the vehicle is in it.

    Example::

        slam = Slam()
        for odometry, scan in log:
            pose = slam.add(odometry, scan)
        slam.finish()
    """

    def __init__(self, settings: SlamSettings = SlamSettings()) -> None:
        self.settings = settings
        self.scans: list[KeyScan] = []
        self.poses: list[Pose2] = []
        self.edges: list[Edge] = []
        self.loops = 0
        self._recent: LocalMap | None = None
        self._anchor = Pose2()
        self._last: tuple[Pose2 | None, Pose2] | None = None  # odometry and pose of the last scan
        self._step = Pose2()  # motion between the last two scans
        self.lost: list[tuple[Ns, str]] = []
        """When the vehicle was lost or its odometry slipped, and the words for it."""
        self._is_lost = False
        self._since = 0.0
        self._places: dict[int, LocalMap] = {}

    def add(self, odometry: Pose2 | None, scan: LaserScan2) -> Pose2:
        """Take the next scan; return where it was taken in the map.

        Args:
            odometry: Pose by the vehicle's odometry; None while it is not known: then the vehicle is taken to
                go on as before, and the scan says how it has moved.
            scan: The scan in the vehicle's frame, its points in the order of the beams.
        """
        points = scan.points
        done("slam")
        if odometry is not None and not all(map(isfinite, odometry)):
            self.lost.append((scan.time, "the odometry is not a number"))
            odometry = None
        if self._last is None:
            start = odometry or Pose2()
            self._last = odometry, start
            if len(points):
                self._keep(KeyScan(scan, odometry, normals_of(points)), start)
            return start
        before, pose = self._last
        motion = before.to(odometry) if before is not None and odometry is not None else None
        guess = pose.after(self._step if motion is None else motion)
        if not len(points) or self._recent is None:
            self._last = odometry, guess
            if len(points):  # the first that has met something
                self._keep(KeyScan(scan, odometry, normals_of(points)), guess)
            return guess
        match = self._track(points, guess, motion)
        self._step, pose = pose.to(match.pose), match.pose
        self._watch(scan.time, match, guess, motion)
        self._last = odometry, pose
        step = self.poses[-1].to(pose)
        if step.distance < self.settings.key_distance and abs(step.yaw) < self.settings.key_turn:
            return pose
        number, last = len(self.scans), self.scans[-1].odometry
        spread = self._spread(last.to(odometry) if last is not None and odometry is not None else None)
        information = match.information + np.diag(1.0 / (spread * spread))
        self.edges.append(Edge(number - 1, number, step, _floored(information), True))
        self._since += step.distance
        self._keep(KeyScan(scan, odometry, normals_of(points)), pose)
        if self._close_loops():
            self._last = odometry, self.poses[-1]
        return self.poses[-1]

    def finish(self, rounds: int = 3) -> None:
        """Match every scan once more with all places near it, and fit the graph."""
        for _ in range(rounds):
            self._places.clear()
            loops = [edge for number in range(len(self.scans)) for edge in self._rematch(number)]
            self.edges = self._chain() + loops
            self.poses, _ = optimise(self.poses, self.edges)

    # -- parts

    def _spread(self, motion: Pose2 | None) -> Array:
        """Return the standard deviations of a motion by odometry; None: of one of which nothing is known."""
        if motion is None:
            return _BLIND
        settings = self.settings
        way = motion.distance
        shift = settings.shift + settings.slip * way
        return np.array(
            (shift, shift, settings.turn + settings.skid * abs(motion.yaw) + settings.drift * way)
        )

    def _keep(self, scan: KeyScan, pose: Pose2) -> None:
        self.scans.append(scan)
        self.poses.append(pose)
        self._recent = self._map_of_recent()

    def _map_of_recent(self) -> LocalMap:
        first, last = max(0, len(self.scans) - self.settings.recent), len(self.scans) - 1
        return self._map(range(first, last + 1), last, Pose2())

    def _map(self, numbers: range, centre: int, origin: Pose2) -> LocalMap:
        """Return the map of scans, of those near the one at the centre: odometry may have jumped between."""
        points, normals = [], []
        done("gathered", scans=len(numbers))
        for number in numbers:
            if self.poses[centre].to(self.poses[number]).distance > _FAR:
                continue
            kept, pose = self.scans[number], origin.to(self.poses[number])
            points.append(pose.of(kept.scan.points))
            normals.append(Pose2(0.0, 0.0, pose.yaw).of(kept.normals))
        return LocalMap(np.vstack(points), np.vstack(normals))

    def _track(self, points: Array, guess: Pose2, motion: Pose2 | None) -> Match:
        """Return where a scan fits near a guess; if badly, and well and far better elsewhere, there."""
        spread = self._spread(motion)
        near = self._fit(points, guess, spread, min(3.0 * spread[0], 1.0), min(3.0 * spread[2], 0.6))
        if near.share >= self.settings.fit:
            return near
        wide = self._fit(points, guess, _WIDE / 3.0, *_WIDE[1:])
        return wide if wide.share >= max(self.settings.fit, near.share + _BETTER) else near

    def _fit(self, points: Array, guess: Pose2, spread: Array, reach: float, turn: float) -> Match:
        assert self._recent is not None
        start = guess
        if reach > RESOLUTION:  # else the guess is better than any pose on the grid
            found = self._recent.search(points, guess, reach, turn)
            if found is None:
                return Match(guess, 0.0, np.zeros((3, 3)))
            start = found.pose
        match = self._recent.align(points, start, spread, 0.6)
        return _held(match, guess, self.settings.weak) if self.settings.weak else match

    def _watch(self, time: Ns, match: Match, guess: Pose2, motion: Pose2 | None) -> None:
        """Say once when a scan fits nowhere, and when the odometry is far from where a scan fits."""
        spread, off = self._spread(motion), guess.to(match.pose)
        lost = match.share < _LOST
        if lost and not self._is_lost:
            self.lost.append(
                (time, f"{100.0 * match.share:.0f} % of a scan fit the map: the place is uncertain")
            )
        elif not lost and motion is not None and max(abs(np.array(off)) / spread) > _STRAYED:
            way = off.distance
            turn = np.degrees(abs(off.yaw))
            self.lost.append((time, f"odometry has slipped by {way:.2f} m and {turn:.0f} degrees"))
        self._is_lost = lost

    def _close_loops(self) -> bool:
        number = len(self.scans) - 1
        done("loops")
        settings, pose = self.settings, self.poses[-1]
        old = number - 3 * settings.recent
        if old < 0:
            return False
        radius = min(settings.reach, 2.0 + 0.05 * self._since)
        off = self._distances(pose)[: old + 1]
        near: dict[int, int] = {}
        for one in np.argsort(off, kind="stable"):
            if off[one] > radius + 2.0 or len(near) == 4:
                break
            near.setdefault(int(one) // settings.place, int(one))
        query = self._query(number, 4)
        closed = False
        for place, _nearest in near.items():
            edge = self._match_place(place, number, query, radius)
            if edge is not None:
                self.edges.append(edge)
                closed = True
        if closed:
            self.loops += 1
            self._since = 0.0
            self.poses, _ = optimise(self.poses, self.edges)
            self._recent = self._map_of_recent()
        return closed

    def _distances(self, pose: Pose2) -> Array:
        """Return the distance of each kept scan's pose from a pose [m]."""
        done("distances", poses=len(self.poses))
        off = np.array(self.poses)[:, :2] - pose[:2]
        distances: Array = np.sqrt((off * off).sum(axis=1))
        return distances

    def _query(self, number: int, count: int) -> Array:
        """Return the points of the last scans up to one, in its frame."""
        pose = self.poses[number]
        parts = [
            pose.to(self.poses[one]).of(self.scans[one].scan.points)
            for one in range(max(0, number - count + 1), number + 1)
        ]
        return np.vstack(parts)

    def _place(self, place: int) -> tuple[int, LocalMap]:
        settings = self.settings
        first = place * settings.place
        anchor = min(first + settings.place // 2, len(self.scans) - 1)
        if place not in self._places:
            last = min(first + settings.place + 2, len(self.scans))
            self._places[place] = self._map(range(max(0, first - 2), last), anchor, self.poses[anchor])
        return anchor, self._places[place]

    def _match_place(self, place: int, number: int, query: Array, reach: float) -> Edge | None:
        anchor, local = self._place(place)
        guess = self.poses[anchor].to(self.poses[number])
        found = local.search(query, guess, reach, 0.5, self.settings.fit)
        if found is None:
            return None
        match = local.align(self.scans[number].scan.points, found.pose, np.array((1.0, 1.0, 1.0)), 0.6)
        step = found.pose.to(match.pose)
        if match.share < self.settings.fit or step.distance > 0.3:
            return None
        if self.settings.weak:
            match = _held(match, guess, self.settings.weak)
        return Edge(anchor, number, match.pose, _floored(match.information))

    def _chain(self) -> list[Edge]:
        return [edge for edge in self.edges if edge.certain]

    def _rematch(self, number: int) -> list[Edge]:
        settings, pose = self.settings, self.poses[number]
        off = self._distances(pose)
        done("loops")
        found = []
        taken: set[int] = set()
        for one in np.argsort(off, kind="stable"):
            place = int(one) // settings.place
            if off[one] > 3.0 or len(taken) == 4:
                break
            if place in taken or abs(int(one) - number) < 2 * settings.place:
                continue
            taken.add(place)
            anchor, local = self._place(place)
            guess = self.poses[anchor].to(pose)
            near = local.search(self.scans[number].scan.points, guess, 0.4, 0.1, 0.4)
            if near is None:
                continue
            match = local.align(self.scans[number].scan.points, near.pose, np.array((0.3, 0.3, 0.1)), 0.6)
            if match.share > settings.fit:
                if settings.weak:
                    match = _held(match, guess, settings.weak)
                found.append(Edge(anchor, number, match.pose, _floored(match.information)))
        return found


def _held(match: Match, guess: Pose2, weak: float) -> Match:
    """Return a match whose position is that of the guess in a direction in which the points say too little.

    Its information says nothing in that direction: what is there is of the noise of the normals. The
    directions are those of the information on the position alone (Zhang, Kaess and Singh, ICRA 2016).
    """
    information = match.information
    turn = information[2, 2]
    if turn <= 0.0:
        return match
    place = information[:2, :2] - np.outer(information[:2, 2], information[2, :2]) / turn
    values, vectors = np.linalg.eigh(place)
    if values[0] >= weak * values[1]:
        return match
    along = vectors[:, 0]
    back = along * float(along @ (np.array(match.pose[:2]) - guess[:2]))
    pose = Pose2(match.pose.x - float(back[0]), match.pose.y - float(back[1]), match.pose.yaw)
    kept = np.eye(3)
    kept[:2, :2] -= np.outer(along, along)
    return Match(pose, match.share, kept @ information @ kept)


def _floored(information: Array) -> Array:
    """Return an information that claims no more than a matcher can know, and connects in every direction."""
    values, vectors = np.linalg.eigh(information)
    covariance = (vectors / np.maximum(values, 1.0)) @ vectors.T + np.diag(_KNOWN * _KNOWN)
    result: Array = np.linalg.inv(covariance)
    return result
