"""References of a twin, and its tracking error in flight."""

from __future__ import annotations

from math import nan

import numpy as np
import pytest

from rigs.controlled_flights import fly_watched
from volery.base.errors import UsageError
from volery.control.digital_twin import (
    RecordedReference,
    Reference,
    Twin,
    recorded_reference,
    tracking_errors,
)
from volery.control.step_response import Signal, make_signal

TIMES = np.arange(0.0, 40.0, 0.1)


def record(height: float = 6.0) -> list[Signal]:
    up = np.clip(TIMES - 5.0, 0.0, height)
    north = 100.0 + np.clip(TIMES - 15.0, 0.0, 10.0)
    yaw = np.where(TIMES < 20.0, 350.0, (350.0 + np.clip(TIMES - 20.0, 0.0, 2.0) * 15.0) % 360.0)
    columns = {"yaw": yaw, "north": north, "east": np.full_like(TIMES, 7.0), "altitude": up + 900.0}
    return [
        make_signal(
            name, "deg" if name == "yaw" else "m", (TIMES, values), period=360.0 if name == "yaw" else None
        )
        for name, values in columns.items()
    ]


def test_a_record_becomes_a_reference_about_its_own_start() -> None:
    reference = recorded_reference(record())
    first, late = reference(0.0), reference(15.0)
    assert first is not None
    assert late is not None
    assert (first.north, first.east, first.up) == pytest.approx((0.0, 0.0, 1.5), abs=0.06)
    assert late.velocity_north == pytest.approx(1.0, abs=0.05)
    assert late.turn_rate == pytest.approx(15.0, abs=1.0)
    assert 350.0 < late.heading < 381.0  # it goes on through north
    assert reference(reference.duration + 0.1) is None


def test_a_record_in_which_nothing_flies_or_lacks_a_quantity_is_refused() -> None:
    with pytest.raises(UsageError, match="nothing flies"):
        recorded_reference(record(height=0.5))
    with pytest.raises(UsageError, match="has no north"):
        recorded_reference([one for one in record() if one.name != "north"])


def test_a_twin_follows_a_record() -> None:
    reference: RecordedReference = recorded_reference(record())
    flown = fly_watched(lambda: Twin(reference), limit_s=120.0)
    assert flown.error is None
    assert not flown.end.armed
    loops: dict[str, list] = {}
    for one in flown.samples:
        if one.controller == "twin":
            loops.setdefault(one.loop, []).append(one)
    signals = [
        Signal(
            name,
            rows[0].unit,
            np.array([one.at / 1e9 for one in rows]),
            np.array([one.measurement for one in rows]),
            np.array([one.goal for one in rows]),
            rows[0].period or None,
            "twin",
        )
        for name, rows in loops.items()
    ]
    errors = {one.quantity: one for one in tracking_errors(signals)}
    assert errors["horizontal"].rms < 0.5
    assert errors["altitude"].rms < 0.6
    assert errors["yaw"].rms < 6.0


def test_without_a_reference_the_twin_hovers() -> None:
    twin = Twin(lambda _: Reference(nan, nan, nan, nan, nan, nan, nan))
    from volery.control.actuation import Measured

    command, _ = twin.step(Measured(10.0, 1.0, 2.0, 5.0, 0.0, 0.0, 0.0), 0.05)
    assert tuple(command)[:2] == (0.0, 0.0)
    assert command.yaw_rate == 0.0
