"""Parameters, their values over the unit interval, and the plans that sample a space."""

from __future__ import annotations

from statistics import fmean, stdev

import pytest

from volery.base.errors import UsageError
from volery.explore.space import Choices, Normal, Plan, Range, default_space
from volery.model.system_loader import load
from volery.run.assembly.model_checks import vocabulary

SPACE = {"a": Choices(["x", "y"]), "b": Range(0, 10, "m", steps=3), "c": Range(1, 3, integer=True)}


def numbers(parameter, points=2001):
    return [float(str(parameter.at(k / (points - 1))).partition(" ")[0]) for k in range(points)]


@pytest.mark.parametrize(
    ("parameter", "least", "middle", "most"),
    [
        (Choices(["a", "b"]), "a", "b", "b"),
        (Range(600, 1500, "MHz"), "600.0 MHz", "1050.0 MHz", "1500.0 MHz"),
        (Range(1, 100, log=True), 1.0, 10.0, 100.0),
        (Range(1, 4, integer=True), 1, 3, 4),
        (Normal(5.0, 1.0, "ms", 4.0, 6.0), "4.0 ms", "5.0 ms", "6.0 ms"),
    ],
)
def test_a_parameter_spans_its_values(parameter, least, middle, most):
    assert [parameter.at(0.0), parameter.at(0.5), parameter.at(1.0)] == [least, middle, most]


def test_whole_numbers_are_equally_frequent_and_a_normal_distribution_is_one():
    found = numbers(Range(1, 4, integer=True), 4000)
    assert {one: found.count(one) for one in set(found)} == {1: 1000, 2: 1000, 3: 1000, 4: 1000}
    spread = numbers(Normal(5.0, 2.0))
    assert fmean(spread) == pytest.approx(5.0, abs=0.01)
    assert stdev(spread) == pytest.approx(2.0, abs=0.05)


def test_a_grid_has_all_combinations():
    points = list(Plan().variants(SPACE, 1))
    assert len(points) == 2 * 3 * 3
    assert points[0] == {"a": "x", "b": "0.0 m", "c": 1}
    assert points[-1] == {"a": "y", "b": "10.0 m", "c": 3}
    assert list(Plan().variants({}, 1)) == [{}]  # the model as it is


@pytest.mark.parametrize("method", ["random", "latin-hypercube", "sobol"])
def test_a_sampled_plan_depends_on_its_seed_alone(method):
    plan = Plan(method, 16)
    assert list(plan.variants(SPACE, 1)) == list(plan.variants(SPACE, 1)) != list(plan.variants(SPACE, 2))
    if method != "random":  # one sample in each sixteenth
        lengths = [float(one["b"].removesuffix(" m")) for one in plan.variants(SPACE, 1)]
        assert sorted(int(length / 10.0 * 16) for length in lengths) == list(range(16))


@pytest.mark.parametrize(
    ("make", "what"),
    [
        (lambda: Plan("sobl", 8), "did you mean 'sobol'"),
        (lambda: Plan("random"), "needs its number of points"),
        (lambda: Plan("sobol", 12), "power of 2"),
        (lambda: list(Plan().variants({"a": Range(0, 1)}, 1)), "needs `steps`"),
        (lambda: list(Plan().variants({"a": Normal(0, 1)}, 1)), "a distribution has no grid"),
    ],
)
def test_a_plan_that_cannot_be_is_refused(make, what):
    with pytest.raises(UsageError, match=what):
        make()


def test_the_models_own_design_parameters_are_the_default(tmp_path):
    text = (
        "volery: 1\nname: m\nplatform: {processors: {a: {is: rpi4-cortex-a72, frequency: 1 GHz}, "
        "b: {is: rpi4-cortex-a72, frequency: 1 GHz}}}\n"
        "design_parameters:\n  speed: {paths: [platform.processors.a.frequency, "
        "platform.processors.b.frequency], values: [600 MHz, 1.5 GHz]}\n"
    )
    (tmp_path / "model.yaml").write_text(text)
    space = default_space(load(tmp_path, vocabulary()))
    assert dict(space) == {
        "platform.processors.a.frequency, platform.processors.b.frequency": Choices(("600 MHz", "1.5 GHz"))
    }
