"""``go``: addresses, files of gains, and the thesis's comparison."""

from __future__ import annotations

from pathlib import Path

import pytest

from volery.base.errors import UsageError
from volery.control.log_signals import read_signals
from volery.control.manoeuvres import Rotation
from volery.control.safety_switch import SwitchSettings
from volery.run.go import GoSettings, go, with_rates
from volery.run.result import Options
from volery.run.thesis_comparison import fly_thesis_comparison


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


def test_wrong_settings_are_refused() -> None:
    with pytest.raises(UsageError, match="by 'stick'"):
        GoSettings(by="stick")
    with pytest.raises(UsageError, match="above 0"):
        GoSettings(height=0.0)
    with pytest.raises(UsageError, match="no graph 'ros3'"):
        GoSettings(graph="ros3")


def test_the_figures_of_the_thesis_are_met_and_beaten(tmp_path: Path) -> None:
    """The laws of the thesis behave as it states, and ours keeps its stated bounds."""
    flown = {one.law: one.responses for one in fly_thesis_comparison(tmp_path, ("p", "pid-thesis", "pid"))}
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
