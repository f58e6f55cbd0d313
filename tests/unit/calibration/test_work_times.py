"""Blocks of ``volery.autonomy``: what they say that they did, and how their times are divided."""

from __future__ import annotations

import pytest

from volery.base.metered_work import Work, metered
from volery.calibration.work_times import TOGETHER, fitted, work_snippets
from volery.cost import library_table

DRIVES = ("slam", "exploration")
"""Blocks that are whole drives: one of each is enough here."""


@pytest.mark.long
def test_each_block_says_what_it_did_and_the_table_has_a_time_for_it() -> None:
    table = library_table().work
    seen: set[str] = set()
    for one in work_snippets():
        if one.block in seen and one.block in DRIVES:
            continue
        seen.add(one.block)
        with metered() as work:
            one.execute()
        assert set(TOGETHER.get(one.block, (one.block,))) & set(work), one.block
        assert set(work) <= set(table), one.block
        assert library_table().of_work(work) > 500.0
    assert {*seen, *(block for blocks in TOGETHER.values() for block in blocks)} == set(table)


def test_the_times_of_amounts_are_found_again_beside_what_is_known() -> None:
    true = {"align": {"calls": 900.0, "points": 12.0}}
    known = {"turned": {"calls": 50.0}}
    measured: list[tuple[Work, float]] = []
    for calls, points in ((1, 10), (1, 400), (3, 90)):
        work: Work = {"align": {"calls": calls, "points": points}, "turned": {"calls": 7}}
        measured.append((work, 900.0 * calls + 12.0 * points + 350.0))
    found = fitted(("align",), measured, known)
    assert found["align"] == pytest.approx(true["align"], rel=1e-3)


def test_no_amount_takes_a_negative_time() -> None:
    measured: list[tuple[Work, float]] = [
        ({"way": {"calls": 1, "cells": cells}}, took) for cells, took in ((10, 500.0), (100, 450.0))
    ]
    assert min(fitted(("way",), measured, {})["way"].values()) >= 0.0
