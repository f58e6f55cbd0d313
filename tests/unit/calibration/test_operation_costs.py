"""Costs of Python's operations: found again from times that were made up, written where a run finds them."""

from __future__ import annotations

import numpy as np
import pytest

from volery.calibration.host_machine import Machine, put_law
from volery.calibration.operation_costs import evaluate, fit_costs
from volery.calibration.timed_code import (
    Rounds,
    TimedCode,
    measure,
    timed_program,
    timed_programs,
    timed_statements,
)
from volery.cost import load_catalogue
from volery.cost.python_operations import OPERATIONS, operation_table

HERE = Machine("bench", "A Processor", 4, 2600.0)


def test_costs_are_recovered_from_times():
    random = np.random.default_rng(3)
    counts = random.integers(0, 5, (60, 12)).astype(float)
    costs = random.uniform(1.0, 50.0, 12)
    costs[3] = 0.0
    assert fit_costs(counts, counts @ costs, np.ones(60), 1.0) == pytest.approx(costs, abs=0.05)


def test_no_cost_is_negative_and_one_odd_measurement_changes_little():
    counts = np.array([[1.0, 0.0], [1.0, 1.0], [2.0, 1.0], [3.0, 1.0], [4.0, 1.0], [5.0, 0.0]])
    times = counts @ np.array([10.0, 3.0])
    times[2] *= 5.0
    found = fit_costs(counts, times, np.ones(6), 1.0)
    assert found == pytest.approx([10.0, 3.0], rel=0.1)
    assert (fit_costs(counts, counts @ np.array([10.0, -9.0]), np.ones(6), 1.0) >= 0.0).all()


def test_a_calibration_whose_programs_run_slower_than_their_operations_finds_by_how_much():
    made_up = {name: 1.0 + number % 7 for number, name in enumerate(OPERATIONS)}
    statements, whole = timed_statements()[::3], timed_programs()[:3]
    for one in statements:
        one.nanoseconds += [one.counted_ns(made_up)] * 4
    for one in whole:
        one.nanoseconds += [1.5 * one.counted_ns(made_up)] * 4
    found = evaluate(statements, whole, Rounds(4, 4))
    assert found.in_context == pytest.approx(1.5, rel=0.1)
    assert sorted(abs(error) for error in found.statements.values())[60] < 0.05
    assert found.loose == {}
    shipped = [one.median / one.counted_ns(operation_table().nanoseconds) for one in whole]
    assert found.slowdown == sorted(shipped)[1]


def test_pieces_are_counted_the_same_each_time():
    for one in timed_programs():
        assert one.counted_ns(operation_table().nanoseconds) == one.counted_ns(operation_table().nanoseconds)


def test_only_uncertain_pieces_are_timed_in_further_rounds():
    text = "def prepare(seed):\n    return seed\ndef run(state):\n    return sum(range(2000))\n"
    steady, loose = timed_program("steady", text), timed_program("loose", text)
    steady.nanoseconds += [100.0] * 40
    loose.nanoseconds += [1.0, 1e6] * 100
    shown = []
    measure([steady, loose], Rounds(2, 5, 0.5), lambda done, most, pieces: shown.append((done, pieces)))
    assert shown == [(0, 2), (1, 2), (2, 1), (3, 1), (4, 1)]


def test_an_entry_that_was_written_is_a_law_of_the_catalogue(tmp_path):
    statements, whole = timed_statements()[:40], timed_programs()[:3]
    for one in [*statements, *whole]:
        one.nanoseconds += [3.0 * one.counted_ns(operation_table().nanoseconds)] * 4
    law = evaluate(statements, whole, Rounds(4, 4)).law("A Processor", 2600.0)
    file = tmp_path / "catalogue.yaml"
    put_law(file, HERE, ("code", "python"), law, (2600.0, 2600.0))
    read = load_catalogue(file).processor("bench").code_law()
    assert read.ns_per_step(1300.0) == pytest.approx(0.6)
    assert read.warnings() == ()
    assert "measured within" in read.how_good()


def test_a_piece_that_takes_long_to_load_is_still_run_often_enough_to_be_timed():
    loaded = []

    def load(steps):
        loaded.append(sum(range(400_000)))  # more than what is worth timing
        return lambda times: [None for _ in range(times)]

    piece = TimedCode("nothing much", "", load)
    piece.warm_up()
    assert len(loaded) == 1
    assert piece.times > 1000
