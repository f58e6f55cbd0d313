"""A landing on a marker: a vehicle that follows late, a camera that sees late and not everything."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import hypot, inf, sin

import numpy as np
import pytest

from volery.autonomy.markers import MarkerPose
from volery.autonomy.precision_landing import LandingPhase, LandingRules, LandingState, Sight, sight_of, step
from volery.base.errors import UsageError
from volery.base.frames import Vector, euler_to_quaternion, world_to_body

MS = 1_000_000
LATE = 120  # [ms] from a picture to its marker


@dataclass
class Flight:
    """A point that follows velocities with a lag of 0.3 s, and knows its own with an error."""

    at: Vector = (2.0, -1.5, 8.0)
    error: Vector = (0.03, -0.02, 0.0)
    seen: Callable[[float, Vector], bool] = lambda _time, _at: True
    rules: LandingRules = field(default_factory=LandingRules)
    noise: float = 0.01
    marker: Callable[[float], Vector] = lambda _time: (0.0, 0.0, 0.0)
    frozen_from: float = inf  # [s]: the pictures stay as they are
    push: Callable[[float], float] = lambda _time: 0.0  # acceleration to the east by gusts [m/s^2]
    phases: list[LandingPhase] = field(default_factory=list)
    heights: list[float] = field(default_factory=list)
    sideways: list[float] = field(default_factory=list)
    reason: str = ""

    def fly(self, seconds: float = 200.0) -> LandingPhase:
        random = np.random.default_rng(1)
        place, velocity, command = np.array(self.at), np.zeros(3), np.zeros(3)
        landing, due, offset = LandingState(), [], (0.0, 0.0, 0.0)
        for at in range(0, int(seconds * 1000), 20):
            velocity += (command - velocity) * 0.02 / 0.3
            velocity[0] += self.push(at / 1000) * 0.02
            place = place + velocity * 0.02
            if at % 100 == 0 and self.seen(at / 1000, tuple(place)):
                sigma = self.noise * (1.0 + 0.2 * place[2])
                if at / 1000 < self.frozen_from:
                    offset = tuple(self.marker(at / 1000) - place + random.normal(0.0, sigma, 3))
                due.append(Sight(at * MS, offset, (sigma,) * 3))
            sight = due.pop(0) if due and due[0].at <= (at - LATE) * MS else None
            if at % 40 == 0 or sight:
                landing, wanted = step(landing, self.rules, at * MS, tuple(velocity + self.error), sight)
                command = np.array(wanted.velocity)
                if not self.phases or self.phases[-1] is not wanted.phase:
                    self.phases.append(wanted.phase)
                self.reason = wanted.reason
                self.heights.append(float(place[2]))
                self.sideways.append(abs(float(place[0])))
                if wanted.phase in {LandingPhase.LAND, LandingPhase.ABORT}:
                    break
        self.at = tuple(place)
        return landing.phase

    @property
    def away(self) -> float:
        return hypot(self.at[0], self.at[1])


def in_view(_time: float, at: Vector) -> bool:
    """A marker of 0.4 m with a field of 44 degrees."""
    return max(abs(at[0]), abs(at[1])) + 0.25 < 0.4 * at[2]


def test_a_marker_that_is_always_seen_is_landed_on() -> None:
    flight = Flight()
    assert flight.fly() is LandingPhase.LAND
    assert flight.away < 0.08
    assert flight.at[2] < 0.5
    assert flight.phases == [LandingPhase.SEARCH, LandingPhase.DESCEND, LandingPhase.LAND]


def test_near_the_ground_it_goes_on_without_the_marker() -> None:
    flight = Flight(seen=in_view)
    assert flight.fly() is LandingPhase.LAND
    assert flight.away < 0.1
    assert flight.phases[-2:] == [LandingPhase.COMMIT, LandingPhase.LAND]


def test_gusts_push_it_less_far_with_damping() -> None:
    def farthest(damping: float) -> float:
        rules = LandingRules(damping=damping)
        flight = Flight(at=(0.0, 0.0, 8.0), rules=rules, push=lambda time: 0.8 * sin(time))
        assert flight.fly() is LandingPhase.LAND
        return max(flight.sideways)

    assert farthest(0.5) < 0.8 * farthest(0.0)


def test_it_waits_while_it_is_outside_of_the_cone() -> None:
    flight = Flight(at=(4.0, 3.0, 5.0))
    assert flight.fly() is LandingPhase.LAND
    assert min(flight.heights[:40]) > 4.8, "first above the marker"


def test_a_marker_that_is_hidden_for_a_while_is_found_again_from_higher_up() -> None:
    flight = Flight(seen=lambda time, at: in_view(time, at) and not 8.0 < time < 14.0)
    assert flight.fly() is LandingPhase.LAND
    assert flight.away < 0.1
    assert flight.phases[2:5] == [LandingPhase.WAIT, LandingPhase.CLIMB, LandingPhase.DESCEND]


def test_one_that_is_hidden_for_good_is_given_up_after_three_tries() -> None:
    flight = Flight(seen=lambda time, _at: time < 6.0)
    assert flight.fly() is LandingPhase.ABORT
    assert flight.phases.count(LandingPhase.CLIMB) == 3
    assert flight.reason.startswith("the marker was lost 4 times, last ")


def test_without_a_marker_it_stays_and_says_so() -> None:
    flight = Flight(seen=lambda _time, _at: False)
    start = flight.at
    assert flight.fly() is LandingPhase.ABORT
    assert flight.at == start
    assert flight.reason == "no marker was seen within 10 s"


def test_a_frozen_camera_does_not_lead_it_into_the_ground() -> None:
    for frozen_from in (2.0, 5.0, 9.0):
        flight = Flight(frozen_from=frozen_from)
        assert flight.fly() is LandingPhase.ABORT
        assert flight.reason == "the pictures stay the same while the vehicle moves: restart the camera"
        assert flight.at[2] > 0.5


def test_a_camera_that_goes_black_is_a_marker_that_is_lost() -> None:
    flight = Flight(seen=lambda time, _at: time < 7.0)
    assert flight.fly() is LandingPhase.ABORT
    assert "the marker was lost 4 times" in flight.reason
    assert flight.at[2] > 2.0, "it has climbed"


def test_a_marker_that_moves_in_the_descent_is_followed() -> None:
    flight = Flight(marker=lambda time: (1.2, 0.0, 0.0) if time > 8.0 else (0.0, 0.0, 0.0))
    assert flight.fly() is LandingPhase.LAND
    assert hypot(flight.at[0] - 1.2, flight.at[1]) < 0.1


def test_it_does_not_take_for_ever() -> None:
    flight = Flight(seen=lambda time, at: at[2] > 2.0, rules=LandingRules(tries=1000))
    assert flight.fly() is LandingPhase.ABORT
    assert flight.reason == "not above the marker within 120 s"


def test_a_sight_counts_at_the_time_of_its_picture() -> None:
    landing, _ = step(LandingState(), LandingRules(), 0, (2.0, 0.0, 0.0))
    for at in range(20, 520, 20):
        landing, _ = step(landing, LandingRules(), at * MS, (2.0, 0.0, 0.0))
    landing, _ = step(
        landing, LandingRules(), 520 * MS, (2.0, 0.0, 0.0), Sight(310 * MS, (1.0, 0.5, -4.0), (0.1, 0.1, 0.1))
    )
    assert landing.offset == pytest.approx((1.0 - 2.0 * 0.21, 0.5, -4.0))


def test_a_single_false_sight_is_refused_and_a_marker_that_was_moved_is_believed() -> None:
    landing, rules = LandingState(), LandingRules()
    good, false = (Sight(0, (0.0, north, -4.0), (0.02, 0.02, 0.02)) for north in (0.0, 3.0))
    for at in range(10):
        landing, _ = step(landing, rules, at * 100 * MS, (0.0, 0.0, 0.0), good._replace(at=at * 100 * MS))
    landing, _ = step(landing, rules, 1000 * MS, (0.0, 0.0, 0.0), false._replace(at=1000 * MS))
    assert landing.offset == pytest.approx((0.0, 0.0, -4.0))
    for at in range(11, 15):
        landing, _ = step(landing, rules, at * 100 * MS, (0.0, 0.0, 0.0), false._replace(at=at * 100 * MS))
    assert landing.offset == pytest.approx((0.0, 3.0, -4.0))


def test_a_tilted_camera_ahead_of_the_centre_still_gives_the_place() -> None:
    attitude = euler_to_quaternion(0.2, -0.1, 1.0)
    marker = np.array([1.0, -2.0, -5.0])  # east, north, up of the vehicle
    from_camera = np.array(world_to_body(attitude, tuple(marker))) - np.array((0.3, 0.0, -0.1))
    forward, left, up = from_camera  # right, down, ahead of a camera that looks down: -left, -forward, -up
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = np.diag((0.0001, 0.0001, 0.01))
    pose = MarkerPose(7, np.array((-left, -forward, -up)), np.eye(3), covariance, np.zeros((4, 2)), 0.0)
    sight = sight_of(pose, 5, attitude, place=(0.3, 0.0, -0.1))
    assert sight.offset == pytest.approx(tuple(marker))
    assert sight.at == 5
    assert sight.sigma[2] > 2.0 * sight.sigma[0] > 0.02


def test_rules_that_contradict_each_other_are_refused() -> None:
    with pytest.raises(UsageError, match=r"land_below 2 m, blind_below 0\.9 m"):
        LandingRules(land_below=2.0)
