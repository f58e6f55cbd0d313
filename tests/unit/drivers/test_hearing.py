"""What the driver makes of telemetry as ArduPilot 4.5.6 sent it: extracts of recorded flights.

The extracts hold, of the messages that the driver listens to, those that brought a change, with the time in
milliseconds since the recording began.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from volery.base.time import MS
from volery.drivers.ardupilot.hearing import Hearing
from volery.kernel.virtual import VirtualKernel
from volery.links.link import Frame
from volery.links.mavlink import quantised
from volery.vehicles.telemetry import Telemetry

EXTRACTS = Path(__file__).parents[2] / "golden" / "ardupilot_telemetry"


def replayed(name: str) -> Iterator[tuple[float, Telemetry]]:
    """The telemetry after each message of an extract, with its time in seconds."""
    kernel = VirtualKernel()
    seen = Telemetry(kernel, "recorded")
    hearing = Hearing(kernel, seen)
    for ms, message, fields in json.loads((EXTRACTS / f"{name}.json").read_text()):
        kernel.call_at(ms * MS, lambda: None)
        kernel.run(ms * MS)
        frame = quantised(Frame(message, fields, 1, 1))
        assert hearing.hear(frame.name, frame.fields)
        yield ms / 1000.0, seen


def changes(name: str, *facts: str) -> list[Any]:
    """The values of these facts in the order in which they changed."""
    found: list[Any] = []
    for _, seen in replayed(name):
        now = tuple(getattr(seen, fact) for fact in facts)
        if not found or found[-1] != now:
            found.append(now)
    return found


def test_a_guided_flight() -> None:
    assert changes("arducopter-guided-flight", "mode", "armed", "flying") == [
        ("", False, False),
        ("STABILIZE", False, False),
        ("GUIDED", False, False),
        ("GUIDED", True, False),
        ("GUIDED", True, True),
        ("LAND", True, True),
        ("LAND", True, False),
        ("LAND", False, False),
    ]


def test_it_is_ready_only_once_it_has_a_position() -> None:
    ready = next(at for at, seen in replayed("arducopter-guided-flight") if seen.ready)
    armable = next(at for at, seen in replayed("arducopter-guided-flight") if seen.armable)
    assert 22 < armable < 24
    assert 41 < ready < 42


def test_zeros_before_there_is_a_position_are_no_position() -> None:
    for _, seen in replayed("arducopter-guided-flight"):
        assert seen.position is None or seen.position.latitude == pytest.approx(-35.36, abs=0.01)
    assert seen.home is not None
    assert seen.home.altitude.metres == pytest.approx(584.05)


def test_a_failsafe_of_the_ground_station() -> None:
    states = changes("arducopter-gcs-failsafe", "mode", "failsafe")
    assert ("RTL", True) in states
    assert states.index(("RTL", True)) < states.index(("RTL", False))
    *_, (_, seen) = replayed("arducopter-gcs-failsafe")
    assert "GCS Failsafe" in [said.text for said in seen.texts]


def test_a_rover() -> None:
    modes = changes("ardurover-drive", "kind", "mode", "armed", "flying")
    driving = [state for state in modes if state[2]]
    assert driving[0] == ("rover", "MANUAL", True, True)
    assert driving[-1] == ("rover", "HOLD", True, False)
    assert {"GUIDED", "RTL"} <= {mode for _, mode, _, _ in driving}
