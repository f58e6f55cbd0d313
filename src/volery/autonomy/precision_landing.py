"""Landing on a marker: from where it is seen to velocities, a state machine without clock or vehicle.

* The marker's place is kept in the frame of the vehicle's own velocity, added up: a picture counts at the
  time when it was taken, however late its marker is known; between two pictures the vehicle knows the way.
* It descends while it is within a cone above the marker, and centres otherwise. A marker that is lost is
  waited for, then looked for from higher up, a number of times; then the landing is aborted and says why.
* A camera that stands still gives the same pictures while the vehicle moves: the landing is aborted.
* So near to the ground that the marker does not fit into the picture any more, a vehicle that was above it
  goes on down without it.

Vectors are east, north, up.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from math import hypot, sqrt
from typing import NamedTuple

import numpy as np

from volery.autonomy.markers import MarkerPose
from volery.base.errors import UsageError
from volery.base.frames import Quaternion, Vector, body_to_world
from volery.base.metered_work import done
from volery.base.time import Ns, to_seconds

_HALF = sqrt(0.5)
LOOKING_DOWN: Quaternion = (0.0, _HALF, -_HALF, 0.0)
"""From the axes of a camera that looks down, the upper edge of its picture ahead, to those of the body."""


class LandingPhase(Enum):
    """What a landing is about."""

    SEARCH = "search"
    """Waits for the first sight of the marker."""
    DESCEND = "descend"
    WAIT = "wait"
    """The marker is not seen just now: waits above where it was."""
    CLIMB = "climb"
    """Goes up above where the marker was, to see it again."""
    COMMIT = "commit"
    """Goes down without the marker."""
    LAND = "land"
    """The autopilot may land where it is."""
    ABORT = "abort"
    """It will not land here; see the reason."""


@dataclass(frozen=True)
class LandingRules:
    """How a landing is flown.

    Args:
        gain: Horizontal velocity for each metre of offset [1/s]; an autopilot that follows velocities slowly
            needs less.
        trim_gain: Velocity that a metre of offset adds in a second [1/s^2]: it makes up for an error of the
            vehicle's own velocity.
        most_trim: Greatest such velocity, east and north [m/s].
        damping: Velocity that is added for each m/s by which it flies slower sideways than it should:
            its own loop lets a gust push it for seconds. 0.5 halves that on an ArduPilot; a PX4 oscillates.
        most_sideways: Greatest horizontal speed [m/s].
        descent_gain: Descent for each metre of height [1/s].
        most_descent: Greatest descent [m/s].
        least_descent: Descent near the ground [m/s].
        cone: Offset within which it descends, for each metre of height, beside ``centred``.
        centred: Offset within which it descends to the ground [m].
        blind_below: Height of the camera below which the marker need not be seen [m].
        land_below: Height below which the autopilot lands [m].
        blink: Time for which a marker may be unseen [s] before it is lost.
        patience: Time for which a lost marker is waited for [s].
        climb: Speed of a climb [m/s].
        climb_by: Height of a climb above where the marker was lost [m].
        tries: Number of times that a marker is looked for from higher up.
        search: Time for which the first sight is waited for [s].
        longest: Time for a landing [s].
    """

    gain: float = 0.8
    trim_gain: float = 0.15
    most_trim: float = 0.3
    damping: float = 0.0
    most_sideways: float = 1.5
    descent_gain: float = 0.35
    most_descent: float = 1.2
    least_descent: float = 0.3
    cone: float = 0.15
    centred: float = 0.07
    blind_below: float = 0.9
    land_below: float = 0.45
    blink: float = 0.7
    patience: float = 1.5
    climb: float = 0.8
    climb_by: float = 3.0
    tries: int = 3
    search: float = 10.0
    longest: float = 120.0

    def __post_init__(self) -> None:
        if not 0.0 < self.land_below < self.blind_below:
            both = f"land_below {self.land_below:g} m, blind_below {self.blind_below:g} m"
            raise UsageError(f"{both}: the first must be lower, and above 0")


class Sight(NamedTuple):
    """A marker in a picture.

    Args:
        at: Time when the picture was taken [ns].
        offset: From the vehicle at that time to the marker [m].
        sigma: Standard deviation of each component [m].
    """

    at: Ns
    offset: Vector
    sigma: Vector


class LandingCommand(NamedTuple):
    """What the vehicle does: a velocity [m/s], and why."""

    velocity: Vector
    phase: LandingPhase
    reason: str = ""


@dataclass(frozen=True)
class LandingState:
    """State of a landing. ``step`` makes the next one.

    Args:
        phase: What it is about.
        begun: Time of the first step [ns], -1 before it.
        changed: Time when the phase began [ns].
        now: Time of the last step [ns].
        travelled: Where the vehicle is from where it began, by its own velocity [m].
        trail: Times [ns] and places of the last second.
        marker: Estimated place of the marker in the same frame [m]; ``None`` before it is seen.
        variance: Of each component of it [m^2].
        trim: Velocity east and north that holds it above the marker [m/s].
        seen: Time of the last picture with the marker [ns].
        refused: Sights in a row that contradict the estimate.
        distance: Distance of the marker in the last picture [m].
        same_from: Where the vehicle was when that distance was first measured [m].
        lost: How often the marker was lost and looked for.
        top: Height above the marker to which it climbs [m].
        reason: Why it was aborted.
    """

    phase: LandingPhase = LandingPhase.SEARCH
    begun: Ns = -1
    changed: Ns = 0
    now: Ns = 0
    travelled: Vector = (0.0, 0.0, 0.0)
    trail: tuple[tuple[Ns, Vector], ...] = ()
    marker: Vector | None = None
    variance: Vector = (0.0, 0.0, 0.0)
    trim: tuple[float, float] = (0.0, 0.0)
    seen: Ns = 0
    refused: int = 0
    distance: float = -1.0
    same_from: Vector = (0.0, 0.0, 0.0)
    lost: int = 0
    top: float = 0.0
    reason: str = ""

    @property
    def offset(self) -> Vector | None:
        """Where the marker is from the vehicle now [m]."""
        return None if self.marker is None else _less(self.marker, self.travelled)


WANDERS = 0.02
"""Variance [m^2/s] that a place gains from errors of the vehicle's own velocity; estimated."""
TILT_SIGMA = 0.006
"""Standard deviation of an attitude [rad] at the time of a picture; estimated."""
_GATE = 25.0  # square of the standard deviations by which a sight may be off
_SLACK = 0.0025  # [m^2] added to it
_REFUSALS = 4  # sights in a row after which they are believed
_SAME = 1e-6  # [m] of distance: less than the noise of a corner ever leaves between two pictures
_FROZEN = 0.2  # [m] that a vehicle moves while its pictures stay the same
_TRIMS_WITHIN = 0.5  # [m] of the marker
_KEPT: Ns = 1_000_000_000  # [ns] of the trail


def sight_of(
    pose: MarkerPose,
    at: Ns,
    attitude: Quaternion,
    mounting: Quaternion = LOOKING_DOWN,
    place: Vector = (0.0, 0.0, 0.0),
) -> Sight:
    """Return where a marker is from the vehicle.

    Args:
        pose: The marker in the camera's picture.
        at: Time when the picture was taken [ns].
        attitude: Quaternion (w, x, y, z) from the body (forward, left, up) to east, north, up at that time.
        mounting: The same from the camera's axes to the body's.
        place: Where the camera is on the body: forward, left, up [m].
    """
    done("sight")
    right, down, ahead = (float(one) for one in pose.at)
    turned = body_to_world(mounting, (right, down, ahead))
    along = (turned[0] + place[0], turned[1] + place[1], turned[2] + place[2])
    offset = body_to_world(attitude, along)
    axes = np.array(
        [
            body_to_world(attitude, body_to_world(mounting, axis))
            for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
        ]
    )
    spread = np.diag(axes.T @ pose.covariance[:3, :3] @ axes)
    tilt = TILT_SIGMA * sqrt(sum(one * one for one in along))
    east, north, up = (sqrt(float(one) + tilt * tilt) for one in spread)
    return Sight(at, offset, (east, north, up))


def step(
    landing: LandingState, rules: LandingRules, now: Ns, velocity: Vector, sight: Sight | None = None
) -> tuple[LandingState, LandingCommand]:
    """Return the next state and what to do until the next call.

    Args:
        landing: The state before.
        rules: How it is flown.
        now: Time [ns], not before the one of the last step.
        velocity: Estimated velocity of the vehicle [m/s].
        sight: A marker that was not passed before; ``None``: no new one.
    """
    done("landing_step", sights=sight is not None)
    landing = _trimmed(landing, rules, to_seconds(now - landing.now) if landing.begun >= 0 else 0.0)
    landing = _moved(landing, now, velocity)
    if sight is not None:
        landing = _compared(landing, sight)
        landing = _measured(landing, sight)
    if landing.phase not in {LandingPhase.ABORT, LandingPhase.LAND}:
        landing = _decided(landing, rules)
    return landing, LandingCommand(_velocity(landing, rules, velocity), landing.phase, landing.reason)


def _less(one: Vector, other: Vector) -> Vector:
    return one[0] - other[0], one[1] - other[1], one[2] - other[2]


def _moved(landing: LandingState, now: Ns, velocity: Vector) -> LandingState:
    """Add up the velocity since the last step."""
    if landing.begun < 0:
        return replace(landing, begun=now, changed=now, now=now, trail=((now, landing.travelled),))
    seconds = to_seconds(now - landing.now)
    x, y, z = (at + seconds * by for at, by in zip(landing.travelled, velocity, strict=True))
    trail = (*(one for one in landing.trail if one[0] >= now - _KEPT), (now, (x, y, z)))
    east, north, up = (one + WANDERS * seconds for one in landing.variance)
    return replace(landing, now=now, travelled=(x, y, z), trail=trail, variance=(east, north, up))


def _trimmed(landing: LandingState, rules: LandingRules, seconds: float) -> LandingState:
    """Add up the offset of a vehicle that is near the marker."""
    offset = landing.offset
    if (
        landing.phase is not LandingPhase.DESCEND
        or offset is None
        or hypot(offset[0], offset[1]) > _TRIMS_WITHIN
    ):
        return landing
    east, north = (
        min(max(trim + rules.trim_gain * off * seconds, -rules.most_trim), rules.most_trim)
        for trim, off in zip(landing.trim, offset[:2], strict=True)
    )
    return replace(landing, trim=(east, north))


def _place_at(landing: LandingState, at: Ns) -> Vector:
    """Return where the vehicle was, linear between two steps."""
    before, here = landing.trail[0]
    for after, there in landing.trail[1:]:
        if after >= at > before:
            share = (at - before) / (after - before)
            x, y, z = (one + share * (other - one) for one, other in zip(here, there, strict=True))
            return x, y, z
        before, here = after, there
    return landing.trail[0][1] if at <= landing.trail[0][0] else here


def _compared(landing: LandingState, sight: Sight) -> LandingState:
    """Abort if the vehicle moves and its pictures do not: they would lead it into the ground."""
    was = _place_at(landing, sight.at)
    distance = sqrt(sum(one * one for one in sight.offset))
    if abs(distance - landing.distance) > _SAME:
        return replace(landing, distance=distance, same_from=was)
    if sum(one * one for one in _less(was, landing.same_from)) < _FROZEN * _FROZEN:
        return landing
    return _abort(landing, "the pictures stay the same while the vehicle moves: restart the camera")


def _measured(landing: LandingState, sight: Sight) -> LandingState:
    """Take a sight: a filter of one state for each axis."""
    was = _place_at(landing, sight.at)
    place: Vector = was[0] + sight.offset[0], was[1] + sight.offset[1], was[2] + sight.offset[2]
    square: Vector = tuple(one * one for one in sight.sigma)  # type: ignore[assignment]
    if landing.marker is None:
        return replace(landing, marker=place, variance=square, seen=sight.at, refused=0)
    off = _less(place, landing.marker)
    spread = [mine + its for mine, its in zip(landing.variance, square, strict=True)]
    if any(one * one > _GATE * total + _SLACK for one, total in zip(off, spread, strict=True)):
        if landing.refused + 1 < _REFUSALS:
            return replace(landing, refused=landing.refused + 1)
        return replace(landing, marker=place, variance=square, seen=sight.at, refused=0)
    share = [mine / total for mine, total in zip(landing.variance, spread, strict=True)]
    x, y, z = (at + part * by for at, part, by in zip(landing.marker, share, off, strict=True))
    east, north, up = (mine * (1.0 - part) for mine, part in zip(landing.variance, share, strict=True))
    return replace(landing, marker=(x, y, z), variance=(east, north, up), seen=sight.at, refused=0)


def _enter(landing: LandingState, phase: LandingPhase, **changes: float | str) -> LandingState:
    return replace(landing, phase=phase, changed=landing.now, **changes)  # type: ignore[arg-type]


def _abort(landing: LandingState, reason: str) -> LandingState:
    return _enter(landing, LandingPhase.ABORT, reason=reason)


def _decided(landing: LandingState, rules: LandingRules) -> LandingState:
    """Return the state with the phase that follows from what is known."""
    if landing.phase is not LandingPhase.COMMIT and to_seconds(landing.now - landing.begun) > rules.longest:
        return _abort(landing, f"not above the marker within {rules.longest:g} s")
    offset = landing.offset
    if offset is None:
        unfound = to_seconds(landing.now - landing.changed) > rules.search
        return _abort(landing, f"no marker was seen within {rules.search:g} s") if unfound else landing
    away, height = hypot(offset[0], offset[1]), -offset[2]
    low = height < rules.land_below
    if low and (landing.phase is LandingPhase.COMMIT or away < rules.centred):
        return _enter(landing, LandingPhase.LAND)
    if landing.phase is LandingPhase.COMMIT:
        return landing
    if to_seconds(landing.now - landing.seen) <= rules.blink:
        return landing if landing.phase is LandingPhase.DESCEND else _enter(landing, LandingPhase.DESCEND)
    return _unseen(landing, rules, away, height)


def _unseen(landing: LandingState, rules: LandingRules, away: float, height: float) -> LandingState:
    """Return the state with the phase that follows while the marker is not seen."""
    if landing.phase is LandingPhase.DESCEND:
        committed = height < rules.blind_below and away < rules.centred
        return _enter(landing, LandingPhase.COMMIT if committed else LandingPhase.WAIT)
    if landing.phase is LandingPhase.CLIMB:
        return _enter(landing, LandingPhase.WAIT) if height > landing.top else landing
    if to_seconds(landing.now - landing.changed) <= rules.patience:
        return landing
    if landing.lost >= rules.tries:
        times = "once" if landing.lost == 0 else f"{landing.lost + 1} times"
        return _abort(landing, f"the marker was lost {times}, last {height:.1f} m above it")
    return _enter(landing, LandingPhase.CLIMB, lost=landing.lost + 1, top=height + rules.climb_by)


def _within(rules: LandingRules, height: float) -> float:
    """Return the radius of the cone in which it descends [m]."""
    return rules.centred + rules.cone * max(height - rules.blind_below, 0.0)


def _velocity(landing: LandingState, rules: LandingRules, flown: Vector) -> Vector:
    offset = landing.offset
    if offset is None or landing.phase in {LandingPhase.SEARCH, LandingPhase.LAND, LandingPhase.ABORT}:
        return 0.0, 0.0, 0.0
    away, height = hypot(offset[0], offset[1]), -offset[2]
    share = min(rules.gain, rules.most_sideways / away) if away > 0.0 else 0.0
    up = 0.0
    if landing.phase is LandingPhase.CLIMB:
        up = rules.climb
    elif landing.phase is LandingPhase.COMMIT or (
        landing.phase is LandingPhase.DESCEND and away < _within(rules, height)
    ):
        up = -min(rules.most_descent, max(rules.least_descent, rules.descent_gain * height))
    east, north = (
        wanted + rules.damping * (wanted - has)
        for wanted, has in (
            (share * off + trim, speed)
            for off, trim, speed in zip(offset[:2], landing.trim, flown[:2], strict=True)
        )
    )
    return east, north, up
