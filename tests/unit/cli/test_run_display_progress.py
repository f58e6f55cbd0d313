"""The picture of a run under way."""

import io

from rich.console import Console

from volery.base.time import MINUTE, S
from volery.cli.console import CommandOutput
from volery.cli.run_display import LINE_PERIOD_S, LineProgress, draw_progress, run_progress
from volery.run.result import RunProgress, VehicleProgress

PROGRESS = RunProgress(
    83 * S,
    15 * MINUTE,
    (VehicleProgress("drone_1", "GUIDED", True, 24.96), VehicleProgress("rover_1", "HOLD", False, 0.0)),
    {"parcel": {"delivered": 1, "in the air": 2}, "battery": {"charged": 1}},
)


def test_it_tells_time_speed_vehicles_and_notes():
    console = Console(file=io.StringIO(), width=100)
    console.print(draw_progress("delivery", PROGRESS, 0.5))
    said = console.file.getvalue()
    for piece in (
        "delivery",
        "0:01:23",
        "166× real time",
        "parcels: 1 delivered, 2 in the air, batteries: 1 charged",
        "GUIDED",
        "25.0 m",
    ):
        assert piece in said
    assert "on the ground" in said


def test_nothing_is_shown_quietly():
    with run_progress(CommandOutput(quiet=True, notes=Console(file=io.StringIO())), "x") as show:
        assert show is None


def test_a_pipe_gets_a_line_now_and_then():
    said, now = io.StringIO(), [0.0]
    lines = LineProgress(CommandOutput(notes=Console(file=said)), lambda: now[0])
    for now[0] in (1.0, LINE_PERIOD_S, LINE_PERIOD_S + 1.0):
        lines.show("delivery", PROGRESS)
    assert said.getvalue() == (
        "delivery: 0:01:23 of at most 0:15:00, 8.3× real time, parcels: 1 delivered, 2 in the air, "
        "batteries: 1 charged\n"
    )


def test_a_terminal_is_drawn_on():
    screen = io.StringIO()
    with run_progress(
        CommandOutput(notes=Console(file=screen, force_terminal=True, width=100)), "delivery"
    ) as show:
        show(PROGRESS)
    assert "drone_1" in screen.getvalue()
