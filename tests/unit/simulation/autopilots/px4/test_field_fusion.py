"""Fusion of the magnetometer: three axes or the heading, the reset in flight, and a bias that is learnt."""

from math import pi

import numpy as np
import pytest

from volery.simulation.autopilots.px4.error_states import FIELD, IRON, TILT, YAW, variance_at
from volery.simulation.autopilots.px4.estimate_error import start_errors, step_errors
from volery.simulation.autopilots.px4.field_fusion import DOWN, EAST, NORTH, use_field, watch_motion
from volery.simulation.autopilots.px4.loop_state import (
    A_ACCEL,
    A_HEADING,
    A_POSITION,
    A_THRUST,
    A_TURN,
    E_ALIGNED,
    E_COVARIANCE,
    E_FUSES_FIELD,
    E_KEPT,
    E_STATES,
    GRAVITY,
    I_NOISY,
    I_TASK,
    LOOP_COLUMNS,
    REST,
    STATES,
    SUBSTEP,
    TO_POINT,
)
from volery.simulation.world.state_layout import Array

SILENT = 0.0, 0.0, 0.0


class Filter:
    """The filter of an aircraft whose motion is set."""

    def __init__(self, seed: int = 7, noisy: bool = False) -> None:
        self.row: Array = np.zeros(LOOP_COLUMNS)
        self.row[I_TASK], self.row[I_NOISY] = REST, float(noisy)
        start_errors(self.row)
        self.key, self.step = np.uint64(seed), 0

    def run(self, seconds: float) -> "Filter":
        """Advance at the motion that is set."""
        for _ in range(round(seconds / SUBSTEP)):
            step_errors(self.row, self.key, self.step)
            self.row[A_HEADING] += SUBSTEP * self.row[A_TURN]
            self.step += 1
        return self

    def climb(self) -> "Filter":
        """Fly at 10 m."""
        self.row[I_TASK], self.row[A_POSITION + 2] = TO_POINT, -10.0
        return self

    def turn(self, angle: float) -> "Filter":
        """Turn with 45 degrees/s."""
        self.row[A_TURN] = pi / 4.0
        self.run(angle / (pi / 4.0))
        self.row[A_TURN] = 0.0
        return self

    def deviation(self, number: int) -> float:
        """Return the deviation of a state."""
        return float(np.sqrt(self.row[variance_at(number)]))


def test_on_the_ground_the_heading_alone_is_fused() -> None:
    on_ground = Filter().run(1.0)
    on_ground.row[A_TURN] = 1.0
    assert on_ground.run(1.0).row[[E_ALIGNED, E_FUSES_FIELD]].tolist() == [0.0, 0.0]


def test_the_heading_is_set_anew_above_1_5_m() -> None:
    flying = Filter().run(10.0)
    flying.row[I_TASK], flying.row[A_POSITION + 2] = TO_POINT, -1.4
    assert flying.run(0.2).row[E_ALIGNED] == 0.0
    flying.row[E_STATES + TILT] = 0.02 * GRAVITY
    before = flying.deviation(YAW)
    flying.row[A_POSITION + 2] = -1.6
    flying.run(0.1)
    assert flying.row[E_ALIGNED] == 1.0
    assert flying.row[E_STATES + YAW] == pytest.approx(-EAST * 0.02 * DOWN / (NORTH**2 + EAST**2), rel=0.2)
    assert flying.deviation(YAW) == pytest.approx((before**2 + 0.01) ** 0.5, rel=0.1)


def test_three_axes_are_fused_in_a_turn_and_for_two_seconds_after_it() -> None:
    flying = Filter().run(10.0).climb().run(1.0)
    assert flying.row[E_FUSES_FIELD] == 0.0
    assert flying.turn(pi / 2.0).row[E_FUSES_FIELD] == 1.0
    assert flying.run(1.8).row[E_FUSES_FIELD] == 1.0
    assert flying.run(0.4).row[E_FUSES_FIELD] == 0.0


def test_three_axes_are_fused_from_1_m_s2_on_and_down_to_half_of_it() -> None:
    flying = Filter().run(10.0).climb().run(1.0)
    flying.row[A_ACCEL] = 0.9
    assert flying.run(5.0).row[E_FUSES_FIELD] == 0.0
    flying.row[A_ACCEL] = 1.2
    assert flying.run(5.0).row[E_FUSES_FIELD] == 1.0
    flying.row[A_ACCEL] = 0.6
    assert flying.run(5.0).row[E_FUSES_FIELD] == 1.0
    flying.row[A_ACCEL] = 0.4
    assert flying.run(5.0).row[E_FUSES_FIELD] == 0.0


def test_field_and_bias_are_as_unsure_as_ekf2_logs_after_a_turn() -> None:
    """Logged 5 s after the first leg began, mean of six flights."""
    flying = Filter().run(10.0).climb().run(5.0)
    flying.row[A_THRUST], flying.row[A_ACCEL] = 3.0, 1.5
    flying.turn(0.86)
    flying.row[A_THRUST], flying.row[A_ACCEL] = 4.5, 0.3
    flying.run(2.5)
    assert [flying.deviation(FIELD + axis) for axis in range(3)] == pytest.approx(
        [0.0215, 0.0044, 0.0318], rel=0.25
    )
    assert [flying.deviation(IRON + axis) for axis in range(3)] == pytest.approx(
        [0.0185, 0.0150, 0.0314], rel=0.25
    )


def test_an_unsure_bias_leaves_the_attitude_alone() -> None:
    flying = Filter().run(10.0).climb().run(1.0)
    flying.row[E_STATES + YAW] = 0.1
    flying.row[A_TURN] = 0.5
    flying.run(0.4)
    assert flying.row[E_FUSES_FIELD] == 1.0
    attitude = flying.row[E_STATES : E_STATES + FIELD].copy()
    use_field(flying.row, SILENT)
    assert flying.row[E_STATES : E_STATES + FIELD] == pytest.approx(attitude, abs=1e-12)
    flying.row[[variance_at(IRON + axis) for axis in range(3)]] = 0.0003
    use_field(flying.row, SILENT)
    assert abs(flying.row[E_STATES + YAW] - 0.1) > 1e-5


@pytest.mark.parametrize(("heading", "sign"), [(0.0, 1.0), (pi, -1.0)])
def test_a_wrong_bias_is_a_wrong_heading_that_turns_with_the_nose(heading: float, sign: float) -> None:
    """18 milligauss to the right are a tenth of the field in the plane."""
    flying = Filter().run(10.0).climb().run(1.0)
    flying.row[E_STATES + IRON + 1] = 0.018
    flying.row[A_HEADING] = heading
    flying.run(60.0)
    assert flying.row[E_STATES + YAW] == pytest.approx(sign * 0.018 * NORTH / (NORTH**2 + EAST**2), rel=0.1)


def test_variances_are_kept_until_three_axes_are_fused_again() -> None:
    flying = Filter().run(10.0).climb().run(1.0).turn(pi / 2.0).run(2.5)
    kept = flying.row[E_KEPT : E_KEPT + 7].copy()
    flying.row[A_TURN] = 0.5
    flying.run(0.4)
    fused = np.array([flying.row[variance_at(number)] for number in range(FIELD, STATES)])
    assert np.all(fused <= kept[:6])
    assert np.all(fused >= 0.4 * kept[:6])  # without covariances the sum of field and bias is measured anew


def test_the_covariance_stays_symmetrical() -> None:
    flying = Filter().run(10.0).climb().run(1.0).turn(pi).run(1.0)
    covariance = flying.row[E_COVARIANCE : E_COVARIANCE + STATES * STATES].reshape(STATES, STATES)
    assert covariance == pytest.approx(covariance.T, abs=1e-9)


def test_after_a_landing_the_heading_alone_is_fused_by_the_declination_of_the_map() -> None:
    flying = Filter().run(10.0).climb().run(1.0)
    flying.row[E_STATES + FIELD + 1] = 0.02
    flying.row[I_TASK] = REST
    watch_motion(flying.row, 0.0, 0.0)
    assert flying.row[E_ALIGNED] == 0.0
    assert flying.row[E_STATES + FIELD + 1] == 0.0
