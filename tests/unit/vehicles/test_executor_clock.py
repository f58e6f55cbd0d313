"""Time-outs are in seconds of the vehicle, where its clock runs faster or slower than the program's."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import pytest

from volery.base.errors import NotArrived
from volery.base.time import MS, Ns, S, to_seconds
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.trace.events import Event, Text
from volery.vehicles.driver import Step
from volery.vehicles.executor import StepExecutor
from volery.vehicles.telemetry import Telemetry
from volery.vehicles.vehicle_clock import WRAP, Moment, VehicleClock


@dataclass
class Silent:
    """What the executor reads of a driver that sends nothing."""

    telemetry: Telemetry
    name: str = "fast"
    cycle: None = None
    offboard_mode: str = "GUIDED"

    def problem(self) -> None:
        return None

    def stop(self) -> None:
        pass


def timed_out_after(
    rate: float, within: Ns, *, sends_its_clock: bool = True, booted_before: Ns = 0
) -> tuple[float, list[Event]]:
    """Return after how long of the program's time a step of *within* of the vehicle's ends, s, and texts."""
    events: list[Event] = []
    kernel = VirtualKernel(record=events.append)
    seen = Telemetry(kernel, "fast")
    ended: list[float] = []

    def report() -> None:
        seen.note_message(kernel.now())
        if sends_its_clock:
            seen.update_clock((booted_before + round(rate * kernel.now()) // MS * MS) % WRAP)
        seen.changed.notify()

    def wait() -> None:
        step = Step(ask="arrive", send=lambda: None, done=lambda _: False, within=within)
        driver: Any = Silent(seen)
        with pytest.raises(NotArrived, match=f"within {to_seconds(within):g} s"):
            StepExecutor(kernel, driver).execute("go", lambda: (step,))
        ended.append(to_seconds(kernel.now()))
        reports.cancel()

    reports = kernel.every(100 * MS, report)
    kernel.spawn(wait, "script", ExecutionContext("script"))
    kernel.run(1000 * S)
    kernel.close()
    return ended[0], [event for event in events if isinstance(event, Text)]


def test_ten_times_as_fast() -> None:
    after, texts = timed_out_after(10.0, 100 * S)
    assert after == pytest.approx(10.0, abs=0.3)
    assert re.search(r"(9\.\d|10\.0) times as fast", texts[0].text)
    assert len(texts) == 1


def test_half_as_fast() -> None:
    after, texts = timed_out_after(0.5, 20 * S)
    assert after == pytest.approx(40.0, abs=0.3)
    assert "0.5 times as fast" in texts[0].text


@pytest.mark.parametrize("rate", [1.0, 1.1])
def test_the_programs_clock_counts_where_both_agree(rate: float) -> None:
    assert timed_out_after(rate, 20 * S) == (20.0, [])


def test_the_programs_clock_counts_where_there_is_no_other() -> None:
    assert timed_out_after(10.0, 20 * S, sends_its_clock=False) == (20.0, [])


def test_clocks_are_compared_from_five_seconds_on() -> None:
    assert timed_out_after(10.0, 4900 * MS) == (4.9, [])
    after, texts = timed_out_after(10.0, 5500 * MS)
    assert (after, len(texts)) == (5.0, 1)


def test_a_vehicle_that_was_switched_on_before_the_program() -> None:
    after, texts = timed_out_after(10.0, 100 * S, booted_before=1000 * S)
    assert after == pytest.approx(10.0, abs=0.3)
    assert re.search(r"(9\.\d|10\.0) times as fast", texts[0].text)


@pytest.mark.parametrize("rate", [0.4, 1.0, 3.0])
def test_time_since_boot_begins_anew_after_49_days(rate: float) -> None:
    """A step that is under way then, on a vehicle whose clock is its own, ends when it would have ended."""
    (as_ever, _), (at_the_wrap, _) = (
        timed_out_after(rate, 60 * S, booted_before=before) for before in (0, WRAP - 40 * S)
    )
    assert at_the_wrap == as_ever


def test_a_report_from_before_the_wrap_is_old_and_one_long_after_it_is_a_reboot() -> None:
    clock = VehicleClock()
    clock.note(WRAP - S, 0)
    clock.note(S, 2 * S)
    clock.note(WRAP - S // 2, 2 * S + MS)  # overtaken on the way
    assert clock.time(3 * S) == WRAP + 2 * S
    assert clock.elapsed(Moment(0, WRAP - S), 3 * S) == 3 * S
    clock.note(20 * S, 21 * S)
    clock.note(S, 100 * S)
    assert clock.time(100 * S) == S
