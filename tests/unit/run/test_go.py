"""``go``: addresses, files of gains, and the thesis's comparison."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import hypot, isnan
from pathlib import Path

import pytest

from volery.base.errors import CapabilityError, NotArrived, OffTrack, UsageError
from volery.control.log_signals import read_signals
from volery.control.manoeuvres import Altitude, LawManoeuvre, Rotation, Waypoints
from volery.control.safety_switch import SwitchSettings
from volery.control.step_response import StepResponse
from volery.run.go import GoSettings, go, with_rates
from volery.run.result import Options
from volery.run.thesis_comparison import STEPS, fly_thesis_comparison
from volery.trace.events import ControlSample, Event, Text


def test_the_telemetry_of_a_loop_is_requested_unless_stated() -> None:
    assert with_rates("sim:ardupilot", None) == "sim:ardupilot?rate=20&attitude=50"
    assert with_rates("ardupilot+udp://:14550?attitude=10", SwitchSettings()) == (
        "ardupilot+udp://:14550?attitude=10&rate=20&rc=20"
    )
    assert with_rates("sim:ardupilot", SwitchSettings(channel=7)).endswith("transmitter=7:1450")
    assert with_rates("sim:dji", None) == "sim:dji"


def test_a_flight_records_its_loops(tmp_path: Path) -> None:
    run = go(
        lambda: Rotation([45.0], 10.0),  # the real one settles in 4 to 8 s
        "sim:px4?start=warm",
        GoSettings(by="rc"),
        Options(out=tmp_path / "run"),
    )
    assert run.error is None
    (yaw,) = (one for one in read_signals(tmp_path / "run") if one.name == "yaw")
    assert abs(yaw.measured[-1] - 45.0) < 2.0


STEERED = {
    "ardupilot": ("setpoints", "attitude", "rc"),
    "px4": ("setpoints", "attitude", "rc"),
    "dji": ("setpoints", "attitude"),
    "paparazzi": ("setpoints",),
}
"""Simulated autopilots and their ways of steering."""
MANOEUVRES: dict[str, Callable[[], LawManoeuvre]] = {
    "altitude": lambda: Altitude([9.0, 6.0], 8.0),
    "rotation": lambda: Rotation([90.0, 0.0], 8.0),
    "waypoints": lambda: Waypoints([(6.0, 0.0, 5.0), (6.0, 6.0, 7.0)]),
}


@pytest.mark.parametrize("name", MANOEUVRES)
@pytest.mark.parametrize(("autopilot", "by"), [(one, by) for one, ways in STEERED.items() for by in ways])
def test_every_law_ends_within_1_m_on_every_autopilot(autopilot: str, by: str, name: str) -> None:
    last: dict[str, ControlSample] = {}

    def note(event: Event) -> None:
        if isinstance(event, ControlSample):
            last[event.loop] = event

    run = go(MANOEUVRES[name], f"sim:{autopilot}?start=warm", GoSettings(by=by), Options(), listener=note)
    assert run.ok, run.error
    assert {"north", "east"} <= set(last)
    errors = [one.error for one in last.values() if one.unit == "m"]
    assert hypot(*errors) < 1.0


@pytest.mark.parametrize("by", ["attitude", "rc"])
def test_a_way_of_steering_that_a_vehicle_lacks_is_refused(by: str) -> None:
    run = go(MANOEUVRES["rotation"], "sim:paparazzi?start=warm", GoSettings(by=by), Options())
    assert isinstance(run.error, CapabilityError | UsageError)
    assert "Paparazzi" in str(run.error) or "paparazzi" in str(run.error)


def test_gains_that_let_the_error_grow_end_in_a_hold_and_a_landing(tmp_path: Path) -> None:
    """The gains of a fast vehicle, stated for a slow one."""
    gains = tmp_path / "gains.toml"
    gains.write_text("[north]\nkp = 0.9\nki = 0.02\n[east]\nkp = 0.9\n")
    texts: list[str] = []

    def note(event: Event) -> None:
        if isinstance(event, Text):
            texts.append(event.text)

    run = go(
        lambda: Altitude([8.0], 120.0),
        "sim:paparazzi?start=warm",
        GoSettings(gains=gains),
        Options(out=tmp_path / "run"),
        listener=note,
    )
    assert isinstance(run.error, OffTrack)
    assert "grew from" in str(run.error)
    assert "under kp 0.9" in str(run.error)
    assert "it held and landed" in str(run.error)
    assert any("holds, then the autopilot lands it" in one for one in texts)
    assert not run.ok


def test_a_flight_that_ends_far_from_its_goal_has_failed() -> None:
    run = go(lambda: Rotation([170.0], 1.0), "sim:ardupilot?start=warm", GoSettings(), Options())
    assert isinstance(run.error, NotArrived)
    assert "degrees from its set-point, beyond 10 degrees" in str(run.error)
    assert not run.ok


def test_reports_that_are_too_rare_for_a_law_are_refused_by_name() -> None:
    run = go(
        MANOEUVRES["rotation"],
        "sim:ardupilot?start=warm&rate=2&attitude=2",
        GoSettings(by="attitude"),
        Options(),
    )
    assert isinstance(run.error, CapabilityError)
    assert "ardupilot reports its velocity each 0.50 s" in str(run.error)


def test_wrong_settings_are_refused() -> None:
    with pytest.raises(UsageError, match="by 'stick'"):
        GoSettings(by="stick")
    with pytest.raises(UsageError, match="above 0"):
        GoSettings(height=0.0)
    with pytest.raises(UsageError, match="no graph 'ros3'"):
        GoSettings(graph="ros3")


PAGE = Path(__file__).parents[3] / "docs" / "control.md"


def documented(responses: Sequence[StepResponse]) -> list[str]:
    """Return the rows of a law as the page has them, but for the first column."""
    return [
        f"| {step:.0f}° | {one.settled_10:.2f} s | {one.settled_3:.2f} s | {one.overshoot:.1f}° "
        f"| {one.steady_share:.1%} |".replace("%", " %")
        for step, one in zip(STEPS, responses, strict=True)
    ]


def test_the_figures_of_the_thesis_are_met_and_beaten(tmp_path: Path) -> None:
    """The laws of the thesis behave as it states, ours keeps its bounds, and the page has these figures."""
    flown = {one.law: one.responses for one in fly_thesis_comparison(tmp_path)}
    page = PAGE.read_text(encoding="utf-8")
    rows = [*documented(flown["pid-thesis"]), *documented(flown["pid"])]
    assert "\n".join(row for row in rows if row not in page) == "", f"{PAGE} lacks these figures"
    ours, theirs = flown["pid"][3], flown["pid-thesis"][3]
    assert (
        f"after {ours.recovery:.2f} s (thesis's PID: {theirs.pushed:.0f}°, {theirs.recovery:.2f} s)" in page
    )
    assert all(isnan(one.settled_10) for one in (*flown["on-off"], *flown["p"][:3]))
    offset = [one.steady_error for one in flown["p"]]
    assert offset[:3] == pytest.approx(
        [20.0] * 3, abs=1.0
    )  # (20 us dead band + 20 us trim) / 2 us per degree
    assert abs(offset[3]) < 1.0
    assert flown["pid-thesis"][3].overshoot == pytest.approx(57.0, abs=10.0)  # the thesis: about 50
    for one in flown["pid"]:
        assert one.overshoot_share <= 0.05
        assert one.steady_share < 0.005
    assert all(one.settled_10 <= 1.5 for one in flown["pid"][:3])
    assert flown["pid"][3].pushed == pytest.approx(50.0, abs=5.0)
    assert flown["pid"][3].recovery < 2.0
