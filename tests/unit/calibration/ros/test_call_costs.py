import json
from math import isclose

import pytest

from volery.base.errors import LinkError
from volery.calibration.ros.call_costs import call_costs, fit, points_of, read_round

from .ros_rounds import (
    ACCEPT,
    AGAIN,
    ONCE,
    PER_SUBSCRIBER,
    PER_US,
    PUBLISH,
    RECEIVE,
    RECEIVE_NEXT,
    SLEEP,
    SPIN,
    WARMER,
    Probe,
)


def test_an_exact_probe_gives_back_its_law() -> None:
    found = call_costs([Probe().round() for _ in range(3)])
    assert isclose(found["publish"].whole.constant, PUBLISH, rel_tol=1e-3)
    assert isclose(found["publish"].whole.per_x, PER_SUBSCRIBER, rel_tol=1e-3)
    assert isclose(found["sleep"].whole.constant, SLEEP, rel_tol=1e-3)
    assert isclose(found["sleep"].whole.per_x, PER_US, rel_tol=1e-3)
    once = {**ONCE, "connect": 800_000.0, "accept": ACCEPT, "spin_once_next": SPIN, "receive": RECEIVE}
    for call, cost in once.items():
        assert found[call].typical == pytest.approx(cost, rel=1e-3), call
    assert found["publish_next"].typical == pytest.approx(AGAIN + 2 * PER_SUBSCRIBER, rel=1e-3)
    assert found["wait"].typical == pytest.approx(2e6, rel=1e-3)


def test_publications_in_short_cycles_have_figures_of_their_own() -> None:
    found = call_costs([Probe(period_us=period).round() for period in (20_000.0, 50_000.0)])
    for call, cost in (
        ("publish", PUBLISH + 4 * PER_SUBSCRIBER),
        ("publish_next", AGAIN + 2 * PER_SUBSCRIBER),
    ):
        assert found[call].typical == pytest.approx(cost, rel=1e-3)
        assert found[f"{call}_often"].typical == pytest.approx(WARMER * cost, rel=1e-3)


def test_messages_that_follow_each_other_or_come_often_have_figures_of_their_own() -> None:
    found = call_costs([Probe().round() for _ in range(3)])
    for ending, warm in (("", 1.0), ("_often", WARMER)):
        assert found[f"receive{ending}"].typical == pytest.approx(warm * RECEIVE, rel=1e-3)
        assert found[f"receive_next{ending}"].typical == pytest.approx(warm * RECEIVE_NEXT, rel=1e-3)


def test_exact_points_leave_no_residual_and_are_tight() -> None:
    for cost in call_costs([Probe().round() for _ in range(3)]).values():
        assert cost.residual < 1e-3
        assert cost.spread < 1e-3
        assert cost.is_tight(0.01)


def test_noise_widens_the_interval_and_more_rounds_narrow_it() -> None:
    def publish(rounds: int) -> float:
        return call_costs([Probe(seed, noise=0.1).round() for seed in range(rounds)])["publish"].half_width

    assert publish(4) > publish(40) > 0.0
    found = call_costs([Probe(seed, noise=0.1).round() for seed in range(40)])["publish"]
    assert found.low < PUBLISH + 4 * PER_SUBSCRIBER < found.high
    assert not call_costs([Probe(seed, noise=0.3).round() for seed in range(4)])["publish"].is_tight(0.02)


def test_the_same_rounds_give_the_same_figures() -> None:
    rounds = [Probe(seed, noise=0.2).round() for seed in range(5)]
    assert call_costs(rounds) == call_costs(rounds)


def test_an_outlier_does_not_move_a_median() -> None:
    rounds = [Probe().round() for _ in range(4)]
    wild = tuple(one._replace(process_ns=one.process_ns * 7) for one in Probe().round())
    assert call_costs([*rounds, wild])["publish"].whole.constant == pytest.approx(PUBLISH, rel=1e-3)


def test_the_callers_part_goes_by_its_own_clock() -> None:
    points = points_of(Probe().round(), "caller_ns")
    assert points["publish"][8.0] == [pytest.approx((PUBLISH + 8 * PER_SUBSCRIBER) / 2, rel=1e-3)]


def test_rospy_has_no_spin_once() -> None:
    found = call_costs([Probe(spins=False).round() for _ in range(3)])
    assert not {"spin_once_first", "spin_once_next"} & set(found)
    assert found["receive"].typical == pytest.approx(RECEIVE, rel=1e-3)


@pytest.mark.parametrize(
    ("points", "line"),
    [
        ({0.0: [3.0, 1.0, 2.0]}, (2.0, 0.0)),
        ({4.0: [8.0]}, (0.0, 2.0)),
        ({1.0: [3.0], 2.0: [5.0]}, (1.0, 2.0)),
        ({1.0: [5.0], 2.0: [3.0]}, (4.0, 0.0)),  # a cost does not fall
        ({10.0: [1.0], 20.0: [4.0]}, (0.0, 0.15)),  # nor is any below zero
        ({0.0: [-1.0]}, (0.0, 0.0)),
    ],
)
def test_lines(points: dict[float, list[float]], line: tuple[float, float]) -> None:
    assert fit(points) == pytest.approx(line)


def test_the_output_of_a_probe_is_parsed() -> None:
    sample = Probe().round()[0]
    lines = ["[INFO] something of ROS", json.dumps(sample._asdict())]
    assert read_round(lines) == (sample,)
    with pytest.raises(LinkError, match="not a measurement"):
        read_round(['{"what": "idle"}'])
    with pytest.raises(LinkError, match="not a measurement"):
        read_round(["{half"])


def test_tiny_costs_are_judged_by_the_negligible_time() -> None:
    rounds = [Probe(seed, noise=0.2).round() for seed in range(6)]
    shy = call_costs(rounds)["service_client"]
    assert shy.typical < 60_000.0
    assert 0.0 < shy.half_width < 10.0
    assert 0.0 < shy.spread < 20.0
