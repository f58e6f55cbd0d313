"""Error of EKF2's estimate: a receiver without the delay that EKF2 expects, and SIH's noise."""

from math import pi

import numpy as np
import pytest

from volery.simulation.autopilots.px4.error_states import SPIN, TILT, YAW
from volery.simulation.autopilots.px4.estimate_error import AHEAD, start_errors
from volery.simulation.autopilots.px4.loop_state import (
    A_ACCEL,
    A_FLOWN,
    A_HEADING,
    A_THRUST,
    E_COVARIANCE,
    E_POSITION,
    E_PUSH,
    E_RATE,
    E_STATES,
    E_VELOCITY,
    GRAVITY,
    I_NOISY,
    I_TASK,
    LOOP_COLUMNS,
    REST,
    STATES,
    SUBSTEP,
)
from volery.simulation.autopilots.px4.loop_step import fly_px4_loops
from volery.simulation.world.state_layout import Array


class Estimate:
    """The estimate alone, of an aircraft whose motion is set."""

    def __init__(self, noisy: bool = False, seed: int = 7) -> None:
        self.row: Array = np.zeros(LOOP_COLUMNS)
        self.row[I_TASK], self.row[I_NOISY] = REST, float(noisy)
        start_errors(self.row)
        self.span = np.zeros(2, dtype=np.int64)
        self.advance = fly_px4_loops.bind(self.row, np.array([seed], dtype=np.uint64), self.span)

    def run(self, seconds: float) -> None:
        """Advance at the motion that is set."""
        self.span[:] = self.span[1], self.span[1] + round(seconds / SUBSTEP)
        self.advance()

    def move(self, velocity: float, accel: float, seconds: float) -> None:
        """Advance while the aircraft accelerates to the north."""
        self.row[A_ACCEL] = accel
        for tenth in range(round(10 * seconds)):
            self.row[A_FLOWN] = velocity + accel * tenth / 10.0
            self.run(0.1)

    @property
    def deviations(self) -> Array:
        """Deviations of the states as the filter has them."""
        return np.sqrt(self.row[E_COVARIANCE : E_COVARIANCE + STATES * STATES : STATES + 1])


def test_at_constant_speed_the_position_is_ahead_and_the_velocity_right() -> None:
    estimate = Estimate()
    estimate.move(5.0, 0.0, 200.0)
    assert estimate.row[E_POSITION] == pytest.approx(AHEAD * 5.0, abs=0.01)
    assert estimate.row[E_VELOCITY] == pytest.approx(0.0, abs=0.005)


def test_while_it_brakes_the_estimate_is_slower_than_the_aircraft() -> None:
    estimate = Estimate()
    estimate.move(5.0, 0.0, 60.0)
    estimate.move(5.0, -1.0, 4.0)
    assert -0.2 < estimate.row[E_VELOCITY] < -0.03


def test_at_rest_the_error_ends() -> None:
    estimate = Estimate()
    estimate.move(5.0, -1.0, 5.0)
    estimate.move(0.0, 0.0, 200.0)
    assert estimate.row[[E_POSITION, E_VELOCITY]] == pytest.approx([0.0, 0.0], abs=2e-3)


def test_the_position_grows_at_its_rate() -> None:
    estimate = Estimate()
    estimate.move(3.0, 0.0, 1.0)
    before = estimate.row[E_POSITION]
    estimate.run(SUBSTEP)
    assert estimate.row[E_POSITION] - before == pytest.approx(estimate.row[E_RATE] * SUBSTEP)


def test_the_filter_settles_to_the_deviations_that_ekf2_logs() -> None:
    """Logged of a hover: 0.217 to 0.227 m, 0.101 to 0.106 m/s, 4.0e-4 rad/s; down 0.33 m, 0.117 m/s."""
    estimate = Estimate()
    estimate.run(60.0)
    logged = estimate.deviations
    assert logged[:2] == pytest.approx(0.222, abs=0.006)
    assert logged[2:4] == pytest.approx(0.1035, abs=0.006)
    assert logged[6:8] / GRAVITY == pytest.approx(4.0e-4, abs=0.3e-4)
    assert logged[12] == pytest.approx(0.33, abs=0.01)
    assert logged[13] == pytest.approx(0.117, abs=0.006)


def test_a_filter_that_began_a_short_time_ago_is_as_unsure_as_ekf2_logs() -> None:
    """Logged 9 s after the heading was aligned, mean of 51 starts."""
    estimate = Estimate()
    estimate.run(9.0)
    logged = estimate.deviations
    assert logged[:4] == pytest.approx([0.23, 0.23, 0.157, 0.157], rel=0.1)
    assert logged[4:6] / GRAVITY == pytest.approx(0.0232, rel=0.05)
    assert logged[6:8] / GRAVITY == pytest.approx(0.00179, rel=0.05)
    assert logged[8:10] == pytest.approx(0.205, abs=0.005)
    assert logged[[YAW, SPIN]] == pytest.approx([0.0356, 0.00515], rel=0.05)
    assert logged[12:15] == pytest.approx([0.349, 0.143, 0.03], rel=0.1)


def test_the_covariance_stays_symmetric() -> None:
    estimate = Estimate()
    covariance = estimate.row[E_COVARIANCE : E_COVARIANCE + STATES * STATES].reshape(STATES, STATES)
    estimate.run(200.0)
    settled = estimate.deviations
    covariance[0, 1] += 1e-6
    covariance[0, TILT] += 1e-6
    estimate.run(7200.0)
    assert covariance == pytest.approx(covariance.T, abs=1e-6)
    assert estimate.deviations == pytest.approx(settled, rel=0.1)


def test_a_bias_is_distinguished_from_a_tilt_once_the_nose_turns() -> None:
    """Logged: 0.205 m/s^2 until the nose turns, and 0.04 to 0.06 m/s^2 after it."""
    estimate = Estimate()
    estimate.run(30.0)
    assert estimate.deviations[8:10] == pytest.approx(0.205, abs=0.005)
    estimate.row[A_HEADING] = 2.0
    estimate.run(30.0)
    assert max(estimate.deviations[8:10]) < 0.06


def test_a_wrong_heading_counts_as_much_as_the_aircraft_accelerates() -> None:
    """A cruise at constant speed shows no error of the heading: 0.15 rad were logged for 25 s of it."""
    estimate = Estimate()
    estimate.run(30.0)
    estimate.row[E_STATES + YAW] = 0.1
    estimate.row[A_THRUST], estimate.row[A_FLOWN] = 5.0, 5.0
    estimate.run(0.2)
    assert estimate.row[E_VELOCITY + 1] == pytest.approx(0.0, abs=2e-3)
    estimate.row[A_ACCEL] = 3.0
    estimate.run(0.2)
    assert estimate.row[E_VELOCITY + 1] == pytest.approx(0.1 * 3.0 * 0.2, rel=0.2)


def test_a_wrong_tilt_is_a_climb_while_the_aircraft_accelerates_and_pushes_it_while_it_leans() -> None:
    estimate = Estimate()
    estimate.run(30.0)
    estimate.row[E_STATES + TILT] = 0.5
    estimate.row[A_THRUST] = 5.0
    estimate.run(SUBSTEP)
    assert estimate.row[E_PUSH + 2] == pytest.approx(0.5 * 5.0 / GRAVITY, rel=0.01)
    still = estimate.row[E_VELOCITY + 2]
    assert still == pytest.approx(0.0, abs=1e-3)
    estimate.row[A_ACCEL] = 3.0
    estimate.run(SUBSTEP)
    assert estimate.row[E_VELOCITY + 2] - still == pytest.approx(0.5 * 3.0 / GRAVITY * SUBSTEP, rel=0.1)


def test_noise_about_the_forward_axis_turns_the_heading_of_an_aircraft_that_leans() -> None:
    """0.14 rad/s about the forward axis, 0.03 about the one down: in a cruise with 27 degrees, 0.07."""

    def wander(lean: float) -> float:
        turned = []
        for seed in range(200):
            estimate = Estimate(noisy=True, seed=seed)
            estimate.row[A_THRUST] = lean
            estimate.row[E_COVARIANCE : E_COVARIANCE + STATES * STATES] = 0.0  # nothing is corrected
            estimate.run(0.5)
            turned.append(estimate.row[E_STATES + YAW])
        return float(np.std(turned))

    assert wander(0.0) == pytest.approx(0.03 * (0.004 * 0.5) ** 0.5, rel=0.15)
    assert wander(5.0) == pytest.approx(0.069 * (0.004 * 0.5) ** 0.5, rel=0.15)


@pytest.mark.parametrize("heading", [0.0, pi / 2.0])
def test_the_estimate_wanders_as_logged(heading: float) -> None:
    """Logged in a hover of PX4 1.14 in SIH, forward and sideways: 0.16 and 0.30 m, 0.18 and 0.37 m/s; down
    0.21 m, 0.16 m/s.
    """
    estimate = Estimate(noisy=True)
    estimate.row[A_HEADING] = heading
    estimate.run(60.0)
    seen = []
    for _ in range(10_000):
        estimate.run(0.1)
        seen.append(estimate.row[[*range(E_POSITION, E_POSITION + 3), *range(E_VELOCITY, E_VELOCITY + 3)]])
    north, east, down, speed_north, speed_east, climb = np.std(seen, axis=0)
    ahead, aside = (north, east) if heading == 0.0 else (east, north)
    speed_ahead, speed_aside = (speed_north, speed_east) if heading == 0.0 else (speed_east, speed_north)
    assert (ahead, aside, speed_ahead, speed_aside) == pytest.approx((0.16, 0.30, 0.18, 0.37), rel=0.2)
    assert (down, climb) == pytest.approx((0.21, 0.16), rel=0.25)
