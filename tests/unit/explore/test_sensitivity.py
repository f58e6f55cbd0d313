from math import pi, sin
from random import Random

import numpy as np
import pytest

from volery.base.errors import UsageError
from volery.base.time import S
from volery.explore.flight_phases import EVERYWHERE
from volery.explore.points import FAILED, CampaignRow
from volery.explore.run_process import read_variant
from volery.explore.sensitivity import fault_campaign, margin, sensitivity, worst_case
from volery.explore.space import Choices, Range
from volery.model.faults import FAULTS

MARGINS = 100
"""Margins whose coverage is counted: with a true one of 90 % the test would fail 19 times in 20."""

SPACE = {name: Range(-pi, pi) for name in ("a", "b", "c")}
FIRST = {"a": 0.3139, "b": 0.4424, "c": 0.0}
TOTAL = {"a": 0.5576, "b": 0.4424, "c": 0.2437}


def ishigami(points):
    rows = []
    for one in points:
        a, b, c = (one.values[name] for name in SPACE)
        rows.append(CampaignRow(0, one, observables={"y": sin(a) + 7.0 * sin(b) ** 2 + 0.1 * c**4 * sin(a)}))
    return rows


def test_known_indices_are_inside_their_intervals():
    inside = dict.fromkeys(SPACE, 0)
    for seed in range(20):
        for one in sensitivity(ishigami, SPACE, "y", method="sobol", size=128, seed=seed).parameters:
            inside[one.parameter] += FIRST[one.parameter] in one.first and TOTAL[one.parameter] in one.total
    assert min(inside.values()) >= 17


def test_morris_finds_what_matters_and_a_failed_run_costs_its_trajectory_only():
    failed = []

    def evaluate(points):
        rows = ishigami(points)
        failed.append(rows[5].point)
        rows[5] = CampaignRow(5, rows[5].point, FAILED, observables={"y": 1e9})
        return rows

    found = sensitivity(evaluate, {**SPACE, "d": Range(0, 1)}, "y", size=20)
    assert found.runs == 100
    assert found.left_out == 1
    assert found.parameters[-1].parameter == "d"
    assert found.parameters[-1].first.estimate == 0.0
    assert found.parameters[0].first.estimate > 5.0


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"method": "anova"}, "morris or sobol"),
        ({"method": "sobol", "size": 100}, "power of 2"),
        ({"size": 1}, "2 and more"),
        ({"space": {"a": Range(0, 1)}}, "two parameters"),
        ({"space": {**SPACE, "d": Choices([1, 2, 3])}}, "no order"),
        ({"quantity": "z"}, "no run observed 'z'"),
    ],
)
def test_wrong_analyses_are_refused(options, said):
    space, quantity = options.pop("space", SPACE), options.pop("quantity", "y")
    with pytest.raises(UsageError, match=said):
        sensitivity(ishigami, space, quantity, **options)


class Windy:
    """Meets its requirement with a probability that falls from 1 to 0 around a wind of 12 m/s."""

    def __init__(self, root):
        self.root = root

    def probability(self, speed):
        return 1.0 / (1.0 + np.exp(2.0 * (speed - 12.0)))

    def __call__(self, points):
        rows = []
        for one in points:
            speed = float(one.values["wind"].split()[0])
            drawn = Random(self.root << 32 | one.seed).random()
            rows.append(CampaignRow(0, one, verdicts={"in_time": bool(drawn < self.probability(speed))}))
        return rows


def test_margins_contain_the_limit_as_often_as_they_say():
    truth = 12.0 - np.log(9.0) / 2.0  # met with a probability of 0.9
    found = [margin(Windy(root), "wind", Range(0.0, 20.0, "m/s"), "in_time") for root in range(MARGINS)]
    ends = np.array([[float(end.split()[0]) for end in (one.holds, one.fails)] for one in found])
    assert np.mean((ends[:, 0] <= truth) & (truth <= ends[:, 1])) >= 0.95
    assert np.diff(ends).max() < 5.0
    assert np.mean([one.runs for one in found]) < 3000


def test_ends_of_margins():
    everywhere = margin(Windy(1), "wind", Range(0.0, 5.0, "m/s"), "in_time")
    assert everywhere.fails is None
    assert str(everywhere) == "in_time holds up to 5.0 m/s, the end of the range"
    assert (
        str(margin(Windy(1), "wind", Range(15.0, 20.0, "m/s"), "in_time"))
        == "in_time fails at 15.0 m/s already"
    )
    less = margin(Windy(1), "wind", Range(8.0, 20.0, "m/s"), "in_time", worse="less")
    assert less.holds is None
    with pytest.raises(UsageError, match="'late'"):
        margin(Windy(1), "wind", Range(0.0, 20.0, "m/s"), "late")
    with pytest.raises(UsageError, match="greater"):
        margin(Windy(1), "wind", Range(0.0, 20.0, "m/s"), "in_time", worse="more")


def test_a_failed_run_is_the_worst_case():
    def evaluate(points):
        return [
            CampaignRow(0, one, FAILED) if one.values["a"] > 3.1 else row
            for one, row in zip(points, ishigami(points), strict=True)
        ]

    found = worst_case(evaluate, SPACE, "maximise y", evaluations=300)
    assert found.value > 14.0
    assert found.worst.observables["y"] == found.value
    assert all(one.point.values["a"] > 3.1 for one in found.failed)


PHASES = {"take-off": {"drone_1": 5 * S}, "flight": {EVERYWHERE: 20 * S}, "drive": {"rover_9": 7 * S}}


def test_every_fault_is_tried_in_every_phase():
    asked = []

    def evaluate(points):
        asked.extend(points)
        return [
            CampaignRow(
                0, one, verdicts={"safe": one.values["environment.faults.campaign"]["kind"] != "wind"}
            )
            for one in points
        ]

    system = read_variant("examples/starter", {})
    found = fault_campaign(evaluate, system, PHASES, duration_ns=3 * S)
    table = found.table()
    assert {kind for kind, _ in table} | set(found.without_subject) == set(FAULTS)
    assert table["wind", "all"] == {"take-off": "0/1", "flight": "0/1", "drive": "0/1"}
    vehicle = system.vehicles[0].name
    assert table["gps-lost", vehicle] == {"take-off": "1/1", "flight": "1/1"}
    assert {"sensor-silent", "ranges-maximum"} <= set(found.without_subject), "it has no added sensors"
    times = {one.values["environment.faults.campaign"]["at"] for one in asked}
    assert times == {"5.0 s", "20.0 s", "7.0 s"}
    for one in asked[::2]:  # each is a model; read_variant raises otherwise
        read_variant("examples/starter", one.values)


def test_faults_of_added_sensors_are_tried_on_each_that_can_have_them():
    system = read_variant("examples/mapping", {})
    asked = []

    def evaluate(points):
        asked.extend(points)
        return [CampaignRow(0, one, verdicts={"safe": True}) for one in points]

    found = fault_campaign(evaluate, system, {"flight": {EVERYWHERE: 20 * S}})
    subjects = {kind: {subject for other, subject in found.table() if other == kind} for kind in FAULTS}
    assert subjects["sensor-silent"] == {"drone.lidar", "drone.odometry"}
    assert subjects["ranges-not-a-number"] == {"drone.lidar"}
    assert subjects["camera-black"] == set(), "it has no camera"
    for one in asked:
        read_variant("examples/mapping", one.values)
