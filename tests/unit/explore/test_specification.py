"""The keys of ``explore``: read with file and line, refused with a remedy, kept in a campaign's folder."""

from __future__ import annotations

import pytest

from volery.base.errors import ModelError, UsageError
from volery.explore.space import Choices, DistributedParameter, Range
from volery.explore.specification import (
    parameter_from_option,
    read_specification,
    run_seed,
    specification_of,
)
from volery.model.text import parse

WHOLE = """
seeds: 20
seed: 7
common: false
plan: sobol
points: 64
fidelity: times
limit: 10 min
memory: 2 GB
space:
  allocation: [fast, slow]
  platform.processors.onboard.frequency: 600 MHz .. 1500 MHz
  environment.wind.speed: {from: 0 m/s, to: 8 m/s, steps: 5}
  components.Patrol.activation.time: {normal: {mean: 2 ms, sd: 0.5 ms, least: 1 ms}}
  a.lognormal: {lognormal: {median: 2 ms, sigma: 0.3, most: 9 ms}}
  a.triangular: {triangular: {least: 1 kg, mode: 2 kg, most: 4 kg}}
  a.beta: {beta: {a: 2, b: 5, least: 0 m/s, most: 12 m/s}}
  a.discrete: {discrete: {values: [600 MHz, 1 GHz], weights: [3, 1]}}
  run.duration: 10 min
"""


def test_everything_that_can_be_stated_is_read_and_written_again():
    found = read_specification(parse(WHOLE, "m.yaml"))
    assert (found.seeds, found.seed, found.common, found.plan, found.points) == (20, 7, False, "sobol", 64)
    assert (found.fidelity, found.limit_ns, found.memory_b) == ("times", 600 * 10**9, 2e9)
    assert list(found.space.values()) == [
        Choices(["fast", "slow"]),
        Range(600, 1500, "MHz"),
        Range(0, 8, "m/s", steps=5),
        DistributedParameter("normal", {"mean": 2, "sd": 0.5, "least": 1}, "ms"),
        DistributedParameter("lognormal", {"median": 2, "most": 9, "sigma": 0.3}, "ms"),
        DistributedParameter("triangular", {"least": 1, "mode": 2, "most": 4}, "kg"),
        DistributedParameter("beta", {"least": 0, "most": 12, "a": 2, "b": 5}, "m/s"),
        Choices(["600 MHz", "1 GHz"], [3, 1]),
        Choices(["10 min"]),
    ]
    assert read_specification(found.plain()) == found


@pytest.mark.parametrize(
    ("text", "line", "what"),
    [
        ("seeds: 0", 1, "at least 1"),
        ("seed: 1\nseedz: 3", 2, "did you mean 'seed'"),
        ("plan: sobl", 1, "did you mean 'sobol'"),
        ("space:\n  a: []", 2, "at least one value"),
        ("space:\n  a: 3 m .. 2 m", 2, "a range goes up"),
        ("space:\n  a: 3 m .. 2 s", 2, "the units 'm' and 's'"),
        ("space:\n  a: 3 .. parsec", 2, "'parsec' is no number"),
        ("space:\n  a: {from: 1 m, too: 2 m}", 2, "unknown key 'too'"),
        ("space:\n  a: {from: 0, to: 2, log: true}", 2, "begins above 0"),
        ("space:\n  a: {normal: {mean: 1, sd: 0}}", 2, "more than 0"),
        ("space:\n  a:\n    normal:\n      mean: 1 m\n      sdd: 2 m", 5, "no number 'sdd'"),
        ("space:\n  a:\n    normal:\n      mean: 1 m\n      sd: -1 m", 5, "more than 0"),
        ("space:\n  a: {gamma: {a: 1}}", 2, "no distribution 'gamma'; there is"),
        ("space:\n  a: {trianglar: {a: 1}}", 2, "did you mean 'triangular'"),
        ("space:\n  a:\n    beta: {a: 1, b: 2}", 3, "needs `least`"),
        (
            "space:\n  a:\n    beta:\n      a: 1 m\n      b: 2\n      least: 0\n      most: 1",
            4,
            "has no unit",
        ),
        ("space:\n  a: {lognormal: 3}", 2, "needs median, sigma"),
        (
            "space:\n  a:\n    discrete:\n      values: [1, 2]\n      weights: [1]",
            5,
            "2 values have 1 weights",
        ),
        ("space:\n  a:\n    discrete:\n      values: [1]\n      weights:\n        - 1 m", 6, "no unit"),
        ("space:\n  a: {discrete: {values: [1]}}", 2, "a discrete distribution is"),
        ("limit: 3", 1, "such as"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(text, line, what):
    with pytest.raises(ModelError, match=what) as caught:
        read_specification(parse(text, "m.yaml"))
    assert f"m.yaml:{line}" in str(caught.value)


def test_the_section_is_in_the_model_or_beside_it(tmp_path):
    (tmp_path / "model.yaml").write_text("volery: 1\nname: m\nexplore: {seeds: 3}\n")
    assert specification_of(tmp_path).seeds == 3
    (tmp_path / "explore.yaml").write_text("explore: {seeds: 4}\n")
    assert specification_of(tmp_path).seeds == 4
    (tmp_path / "other.yaml").write_text("seeds: 5\n")
    with pytest.raises(ModelError, match=r"other\.yaml.*`explore` is missing"):
        specification_of(tmp_path, tmp_path / "other.yaml")


@pytest.mark.parametrize(
    ("option", "path", "parameter"),
    [
        ("a.b=1,2,3", "a.b", Choices([1, 2, 3])),
        ("a.b=600 MHz, 1 GHz", "a.b", Choices(["600 MHz", "1 GHz"])),
        ("a.b='x, y'", "a.b", Choices(["x, y"])),
        ("a.b=[x, y]", "a.b", Choices(["x", "y"])),
        ("a, b=0 m .. 2 m", "a, b", Range(0, 2, "m")),
        ("a={from: 1, to: 9, log: true}", "a", Range(1, 9, log=True)),
        (
            "a={triangular: {least: 1 m, mode: 2 m, most: 4 m}}",
            "a",
            DistributedParameter("triangular", {"least": 1, "mode": 2, "most": 4}, "m"),
        ),
        ("a={discrete: {values: [1, 2], weights: [3, 1]}}", "a", Choices([1, 2], [3, 1])),
    ],
)
def test_an_option_states_a_parameter(option, path, parameter):
    assert parameter_from_option(option) == (path, parameter)


def test_an_option_without_values_is_refused():
    with pytest.raises(UsageError, match="a path and a value"):
        parameter_from_option("a.b")
    with pytest.raises(UsageError, match=r"--set a=1 \.\. 1"):
        parameter_from_option("a=1 .. 1")
    with pytest.raises(UsageError, match=r"--set a=.*needs `sd`"):
        parameter_from_option("a={normal: {mean: 1}}")


def test_seeds_are_those_of_the_campaign_and_common_to_variants():
    text = "seeds: 3\nspace: {allocation: [fast, slow]}"
    points = list(read_specification(parse(text, "m")).run_points())
    assert [one.values["allocation"] for one in points] == ["fast"] * 3 + ["slow"] * 3
    seeds = [one.seed for one in points]
    assert seeds[:3] == seeds[3:] == [run_seed(1, k) for k in range(3)]
    own = [one.seed for one in read_specification(parse(text + "\ncommon: false", "m")).run_points()]
    assert len(set(own)) == 6
    assert {run_seed(2, k) for k in range(3)}.isdisjoint(seeds)
