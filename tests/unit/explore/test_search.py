from dataclasses import replace

import numpy as np
import pytest

from volery.base.errors import UsageError
from volery.explore.points import FAILED, CampaignRow, VariantPoint
from volery.explore.search import (
    Objective,
    analysis_discards,
    front_of,
    hardware_cost,
    hypervolume,
    read_objective,
    search,
)
from volery.explore.space import Choices, Range

UNIT = {f"x{number}": Range(0.0, 1.0) for number in range(6)}
BOTH = ("minimise cost", "minimise time")


class Bench:
    """Evaluates ZDT1 in six variables, with noise, with failed runs, and remembers what it was asked for."""

    def __init__(self, noise=0.0, fails=lambda values: False):
        self.noise, self.fails, self.rows = noise, fails, {}

    def truth(self, values):
        x = [values[name] for name in UNIT]
        g = 1.0 + 9.0 * sum(x[1:]) / 5.0
        return x[0], g * (1.0 - np.sqrt(x[0] / g))

    def __call__(self, points):
        return [self.rows.get(one.key) or self._run(one) for one in points]

    def _run(self, point):
        random = np.random.default_rng([point.seed, *point.variant.encode()])
        cost, time = np.array(self.truth(point.values)) * (1.0 + self.noise * random.standard_normal(2))
        # the figures of a run that fails are tempting
        row = (
            CampaignRow(0, point, FAILED, observables={"cost": -1.0, "time": -1.0})
            if self.fails(point.values)
            else CampaignRow(
                0, point, verdicts={"cheap": cost < 0.5}, observables={"cost": cost, "time": time}
            )
        )
        return self.rows.setdefault(point.key, row)


def test_the_front_of_a_known_problem_is_found():
    front = search(Bench(), UNIT, BOTH, evaluations=600, confirmations=0)
    assert front.evaluated == 600
    assert front.runs == 600
    assert hypervolume(front.points(), [1.1, 1.1]) > 0.7  # random points have 0.2, the true front 0.876
    assert not front.alike


def test_the_same_seed_gives_the_same_front_after_an_interrupt():
    whole, interrupted = Bench(0.05), Bench(0.05)
    wanted = search(whole, UNIT, BOTH, evaluations=100, seed=3)
    again, left = Bench(0.05), [45]

    def killed(points):
        left[0] -= len(points)
        if left[0] < 0:
            raise KeyboardInterrupt
        return again(points)

    with pytest.raises(KeyboardInterrupt):
        search(killed, UNIT, BOTH, evaluations=100, seed=3)
    finished = len(again.rows)
    assert 0 < finished < len(whole.rows)
    assert search(again, UNIT, BOTH, evaluations=100, seed=3) == wanted
    assert again.rows.keys() == whole.rows.keys()  # nothing else was asked for
    assert search(interrupted, UNIT, BOTH, evaluations=100, seed=4) != wanted


def test_a_run_that_failed_never_wins():
    bench = Bench(fails=lambda values: values["x0"] < 0.3)
    front = search(bench, UNIT, BOTH, evaluations=100, confirmations=0)
    assert front.failed
    assert all(one.values["x0"] >= 0.3 for one in front.solutions)
    assert not search(Bench(fails=lambda values: True), UNIT, BOTH, evaluations=40).solutions


def test_constraints_hold_in_the_front():
    front = search(Bench(), UNIT, ["minimise time"], evaluations=200, constraints=["cheap"], confirmations=0)
    (best,) = front.solutions
    assert 0.4 < best.values["x0"] < 0.5
    assert best.requirements["cheap"].estimate == 1.0


def test_a_variant_need_not_meet_a_requirement_that_it_does_not_have():
    def evaluate(points):
        return [
            replace(row, verdicts={"fits": True} | ({"quick": False} if row.point.values["n"] == 2 else {}))
            for row in mixed(points)
        ]

    front = search(
        evaluate, SMALL, ["minimise time"], evaluations=100, constraints=["fits", "quick"], confirmations=0
    )
    (best,) = front.solutions
    assert best.values["n"] == 1
    assert list(best.requirements) == ["fits"]
    with pytest.raises(UsageError, match="no run judges a requirement 'quik'; there is fits, quick"):
        search(evaluate, SMALL, ["minimise time"], evaluations=100, constraints=["quik"], confirmations=0)


def test_what_noise_hides_is_not_reported_as_a_front():
    wrong = 0
    for seed in range(4):
        bench = Bench(0.05)
        front = search(bench, UNIT, BOTH, evaluations=150, seed=seed)
        truth = np.array([bench.truth(one.values) for one in front.solutions])
        assert len(front.solutions) >= 3
        wrong += len(front_of(truth)) < len(truth)
        assert all(0 <= one.like < len(front.solutions) for one in front.alike)
        assert all(one.objectives[0].runs == 20 for one in front.solutions)
    assert wrong == 0


SMALL = {
    "x0": Choices([0.1, 0.4, 0.9]),
    "allocation": Choices(["one", "two"]),
    "n": Range(1, 2, integer=True),
}


def mixed(points):
    rows = []
    for one in points:
        v = one.values
        price = v["n"] + (v["allocation"] == "two")
        rows.append(CampaignRow(0, one, observables={"price": price, "time": v["x0"] + 1.0 / price}))
    return rows


def test_a_search_over_mixed_parameters_equals_the_exhaustive_one():
    prices = [n + (allocation == "two") for n in (1, 2) for allocation in ("one", "two")]
    every = [(price, x + 1.0 / price) for price in prices for x in (0.1, 0.4, 0.9)]
    wanted = {every[place] for place in front_of(np.array(every))}
    for evaluations in (100, 11):  # all variants, and one fewer than all
        front = search(
            mixed, SMALL, ["minimise price", "minimise time"], evaluations=evaluations, confirmations=0
        )
        assert {tuple(one) for one in front.points()} == wanted
        assert front.evaluated <= min(12, evaluations)


def test_what_analysis_discards_is_not_run():
    asked = []

    def evaluate(points):
        asked.extend(points)
        return mixed(points)

    front = search(
        evaluate, SMALL, ["minimise price"], evaluations=100, confirmations=0,
        discard=lambda values: "too slow" if values["allocation"] == "one" else "",
    )  # fmt: skip
    assert all(one.values["allocation"] == "two" for one in asked)
    assert front.discarded == {"too slow": 6}
    assert front.discarded_share == 0.5


def test_more_of_a_measured_quantity_may_be_better():
    more = Objective("speed", maximise=True, measure=lambda row: 1.0 / row.observables["time"])
    (best,) = search(mixed, SMALL, [more], evaluations=100, confirmations=0).solutions
    assert best.objectives[0].estimate == pytest.approx(1.0 / (0.1 + 1.0 / 3.0))


@pytest.mark.parametrize(
    ("space", "objectives", "options", "said"),
    [
        (SMALL, ["time"], {}, "write `minimise"),
        (SMALL, [], {}, "one to three"),
        (SMALL, ["minimise time", "maximise time"], {}, "different"),
        ({}, ["minimise time"], {}, "nothing is varied"),
        (SMALL, ["minimise time"], {"evaluations": 0}, "from 1 on"),
        (SMALL, ["minimise time"], {"confirmations": 1}, "from 2 on"),
    ],
)
def test_wrong_searches_are_refused(space, objectives, options, said):
    with pytest.raises(UsageError, match=said):
        search(mixed, space, objectives, **({"evaluations": 10} | options))


def test_objectives_are_written_as_text():
    assert str(read_objective("maximise delivered")) == "maximise delivered"


def test_hypervolumes():
    assert hypervolume([[1.0, 2.0], [2.0, 1.0], [2.5, 2.5]], [3.0, 3.0]) == 3.0
    assert hypervolume([[1.0]], [3.0]) == 2.0
    assert hypervolume([[4.0, 4.0]], [3.0, 3.0]) == 0.0
    assert hypervolume([[0.0, 1.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 0.0]], [2.0] * 3) == 4.0
    points = np.random.default_rng(1).random((20, 3))
    grid = np.random.default_rng(2).random((40_000, 3))
    counted = np.mean([(points <= one).all(axis=1).any() for one in grid[:10_000]])
    assert hypervolume(points, [1.0] * 3) == pytest.approx(counted, abs=0.02)
    with pytest.raises(UsageError, match="3 at most"):
        hypervolume([[0.0] * 4], [1.0] * 4)


def test_analysis_discards_what_overloads_a_computer_and_nothing_that_is_open():
    discards = analysis_discards("examples/starter", "times")
    period = "components.Patrol.active"
    took = {"components.Patrol.activation": {"time": "30 ms", "best": "20 ms", "worst": "90 ms"}}
    assert discards({period: {"period": "4 ms"}, **took}) == "onboard has more to execute than it can"
    assert not discards(
        {period: {"period": "10 ms"}, **took}
    )  # only its longest time overloads the four cores
    assert not discards({"platform.processors.onboard.frequency": "9 parsec"})  # its run says what is wrong
    assert not discards({})


def test_the_price_of_the_hardware_is_an_objective():
    row = CampaignRow(0, VariantPoint())
    assert hardware_cost("examples/starter", "USD").value(row) > 0.0
    assert np.isnan(hardware_cost("examples/starter", "XAU").value(row))
