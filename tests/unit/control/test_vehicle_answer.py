"""Gains that suit how a vehicle answers and reports."""

from __future__ import annotations

from math import nan

import pytest

from volery.control.laws import PidGains
from volery.control.manoeuvres import HEIGHT_GAINS, POSITION_GAINS, YAW_GAINS
from volery.control.tuning import Process, margins
from volery.control.vehicle_answer import PREDICTED, SLOWEST, VELOCITY_ANSWERS, answer_of, suited

SAMPLE_S = 0.05


@pytest.mark.parametrize("autopilot", VELOCITY_ANSWERS)
@pytest.mark.parametrize("reports_s", [0.02, 0.25, 1.0, 3.0])
def test_suited_gains_keep_the_margins(autopilot: str, reports_s: float) -> None:
    answer = VELOCITY_ANSWERS[autopilot]
    for loop, usual in (("north", POSITION_GAINS), ("altitude", HEIGHT_GAINS), ("yaw", YAW_GAINS)):
        process = answer.of(loop)
        assert process is not None
        gains, share = suited(usual, process, reports_s, SAMPLE_S)
        assert gains.kp == pytest.approx(usual.kp * share)
        assert gains.ki == pytest.approx(usual.ki * share**2)
        late = process._replace(dead_s=process.dead_s + reports_s / 2.0)
        found = margins(gains, late, SAMPLE_S)
        assert (found.gain >= 2.0, found.phase >= 45.0, found.sensitivity <= 2.0) == (True, True, True)


def test_a_vehicle_that_answers_fast_and_reports_often_gets_the_usual_gains() -> None:
    plane = VELOCITY_ANSWERS["ArduPilot"].plane
    for usual, process, reports_s in ((POSITION_GAINS, plane, 0.05), (YAW_GAINS, PREDICTED, 0.02)):
        gains, share = suited(usual, process, reports_s, SAMPLE_S)
        assert (gains.kp, gains.ki, gains.kd, share) == (usual.kp, usual.ki, usual.kd, 1.0)


def test_rare_reports_lower_the_gains_until_none_is_robust() -> None:
    shares = [
        suited(YAW_GAINS, PREDICTED, reports_s, SAMPLE_S)[1] for reports_s in (nan, 0.2, 1.0, 4.0, 60.0)
    ]
    assert shares == sorted(shares, reverse=True)
    assert shares[0] == 1.0
    assert shares[-1] < 1 / 16
    assert suited(PidGains(kp=50.0), Process(1.0, 1.0, 0.1, 2.0), 0.1, SAMPLE_S)[1] == 0.0


def test_an_unknown_autopilot_counts_as_the_slowest() -> None:
    assert answer_of(VELOCITY_ANSWERS, "DJI A3") is VELOCITY_ANSWERS["DJI"]
    assert answer_of(VELOCITY_ANSWERS, "Another") is answer_of(VELOCITY_ANSWERS, "") is SLOWEST
