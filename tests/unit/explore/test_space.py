"""Parameters, their values over the unit interval, and the plans that sample a space."""

from __future__ import annotations

from statistics import fmean, stdev

import numpy as np
import pytest
from scipy.stats import beta, lognorm, norm, triang, truncnorm

from volery.base.errors import UsageError
from volery.explore.space import Choices, DistributedParameter, Range, SamplingPlan, default_space
from volery.model.system_loader import load
from volery.run.assembly.model_checks import vocabulary

SPACE = {
    "a": Choices(["x", "y"]),
    "b": Range(0, 10, "m", steps=3),
    "c": Range(1, 3, integer=True),
}


def numbers(parameter, points=2001):
    return [float(str(parameter.at(k / (points - 1))).partition(" ")[0]) for k in range(points)]


@pytest.mark.parametrize(
    ("parameter", "least", "middle", "most"),
    [
        (Choices(["a", "b"]), "a", "b", "b"),
        (Range(600, 1500, "MHz"), "600.0 MHz", "1050.0 MHz", "1500.0 MHz"),
        (Range(1, 100, log=True), 1.0, 10.0, 100.0),
        (Range(1, 4, integer=True), 1, 3, 4),
        (
            DistributedParameter("normal", {"mean": 5.0, "sd": 1.0, "least": 4.0, "most": 6.0}, "ms"),
            "4.0 ms",
            "5.0 ms",
            "6.0 ms",
        ),
        (
            DistributedParameter("triangular", {"least": 1, "mode": 3, "most": 5}, "m"),
            "1.0 m",
            "3.0 m",
            "5.0 m",
        ),
        (DistributedParameter("beta", {"a": 2, "b": 2, "least": 1, "most": 5}), 1.0, 3.0, 5.0),
        (Choices(["a", "b", "c"], [0, 3, 1]), "b", "b", "c"),
        (Choices(["a", "b", "c"], [1, 1, 0]), "a", "b", "b"),
    ],
)
def test_a_parameter_spans_its_values(parameter, least, middle, most):
    assert [parameter.at(0.0), parameter.at(0.5), parameter.at(1.0)] == [least, middle, most]


def test_whole_numbers_are_equally_frequent_and_a_normal_distribution_is_one():
    found = numbers(Range(1, 4, integer=True), 4000)
    assert {one: found.count(one) for one in set(found)} == {1: 1000, 2: 1000, 3: 1000, 4: 1000}
    spread = numbers(DistributedParameter("normal", {"mean": 5.0, "sd": 2.0}))
    assert fmean(spread) == pytest.approx(5.0, abs=0.01)
    assert stdev(spread) == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize(
    ("law", "stated", "reference"),
    [
        ("normal", {"mean": 5.0, "sd": 2.0}, norm(5.0, 2.0)),
        ("normal", {"mean": 5.0, "sd": 2.0, "least": 4.0, "most": 8.0}, truncnorm(-0.5, 1.5, 5.0, 2.0)),
        ("normal", {"mean": 0.0, "sd": 1.0, "least": 9.0, "most": 10.0}, truncnorm(9.0, 10.0)),
        ("normal", {"mean": 0.0, "sd": 1.0, "most": -9.0}, truncnorm(-np.inf, -9.0)),
        ("lognormal", {"median": 3.0, "sigma": 0.4}, lognorm(0.4, scale=3.0)),
        ("triangular", {"least": 1.0, "mode": 2.0, "most": 5.0}, triang(0.25, 1.0, 4.0)),
        ("triangular", {"least": 1.0, "mode": 5.0, "most": 5.0}, triang(1.0, 1.0, 4.0)),
        ("beta", {"a": 2.0, "b": 5.0, "least": 1.0, "most": 3.0}, beta(2.0, 5.0, 1.0, 2.0)),
    ],
)
def test_quantiles_are_those_of_scipy(law, stated, reference):
    shares = np.linspace(0.0005, 0.9995, 200)
    found = [DistributedParameter(law, stated).at(float(one)) for one in shares]
    assert found == pytest.approx(reference.ppf(shares), rel=1e-7)


def test_a_truncated_lognormal_distribution_keeps_within_its_bounds():
    found = numbers(
        DistributedParameter("lognormal", {"median": 2.0, "sigma": 1.0, "least": 1.0, "most": 4.0})
    )
    assert min(found) == pytest.approx(1.0)
    assert max(found) == pytest.approx(4.0)
    assert found[1000] == pytest.approx(2.0)
    assert set(numbers(DistributedParameter("normal", {"mean": 0, "sd": 1, "least": 50, "most": 60}), 3)) == {
        50.0
    }


def test_weights_are_frequencies():
    found = [Choices(["a", "b", "c"], [1, 0, 3]).at(k / 4000) for k in range(4000)]
    assert [found.count(one) for one in "abc"] == [1000, 0, 3000]
    assert Choices(["a", "b"], [1, 3]).grid() == ["a", "b"]


def test_a_grid_has_all_combinations():
    points = list(SamplingPlan().variants(SPACE, 1))
    assert len(points) == 2 * 3 * 3
    assert points[0] == {"a": "x", "b": "0.0 m", "c": 1}
    assert points[-1] == {"a": "y", "b": "10.0 m", "c": 3}
    assert list(SamplingPlan().variants({}, 1)) == [{}]  # the model as it is


@pytest.mark.parametrize("method", ["random", "latin-hypercube", "sobol"])
def test_a_sampled_plan_depends_on_its_seed_alone(method):
    plan = SamplingPlan(method, 16)
    assert list(plan.variants(SPACE, 1)) == list(plan.variants(SPACE, 1)) != list(plan.variants(SPACE, 2))
    if method != "random":  # one sample in each sixteenth
        lengths = [float(one["b"].removesuffix(" m")) for one in plan.variants(SPACE, 1)]
        assert sorted(int(length / 10.0 * 16) for length in lengths) == list(range(16))


@pytest.mark.parametrize(
    ("make", "what"),
    [
        (lambda: SamplingPlan("sobl", 8), "did you mean 'sobol'"),
        (lambda: SamplingPlan("random"), "needs its number of points"),
        (lambda: SamplingPlan("sobol", 12), "power of 2"),
        (lambda: list(SamplingPlan().variants({"a": Range(0, 1)}, 1)), "needs `steps`"),
        (
            lambda: list(
                SamplingPlan().variants({"a": DistributedParameter("normal", {"mean": 0, "sd": 1})}, 1)
            ),
            "a distribution has no grid",
        ),
        (lambda: DistributedParameter("weibull", {}), "no distribution 'weibull'; there is"),
        (lambda: DistributedParameter("normal", {"mean": 1.0}), "needs `sd`"),
        (lambda: DistributedParameter("beta", {"a": 0, "b": 1, "least": 0, "most": 1}), "`a` .* more than 0"),
        (
            lambda: DistributedParameter("triangular", {"least": 0, "mode": 3, "most": 2}),
            "`mode` .* less than `most`",
        ),
        (
            lambda: DistributedParameter("normal", {"mean": 0, "sd": 1, "least": 2, "most": 2}),
            "less than `most`",
        ),
        (
            lambda: DistributedParameter("lognormal", {"median": 1, "sigma": 1, "most": 0}),
            "as all its values are",
        ),
        (lambda: Choices([1, 2], [1]), "2 values have 1 weights"),
        (lambda: Choices([1, 2], [0, 0]), "more than 0"),
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
