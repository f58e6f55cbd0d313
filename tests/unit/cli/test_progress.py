"""The picture of a run under way."""

import io

from rich.console import Console

from volery.base.time import MINUTE, S
from volery.cli.console import Output
from volery.cli.progress import draw_progress, run_progress
from volery.run.progress import Progress, VehicleProgress

PROGRESS = Progress(
    83 * S,
    15 * MINUTE,
    (VehicleProgress("drone_1", "GUIDED", True, 24.96), VehicleProgress("rover_1", "HOLD", False, 0.0)),
    {"delivered": 1, "in the air": 2},
)


def test_it_tells_time_speed_vehicles_and_parcels():
    console = Console(file=io.StringIO(), width=100)
    console.print(draw_progress("delivery", PROGRESS, 0.5))
    said = console.file.getvalue()
    for piece in ("delivery", "0:01:23", "166× real time", "1 delivered, 2 in the air", "GUIDED", "25.0 m"):
        assert piece in said
    assert "on the ground" in said


def test_progress_is_not_drawn_into_a_pipe():
    with run_progress(Output(notes=Console(file=io.StringIO())), "x") as show:
        assert show is None


def test_a_terminal_is_drawn_on():
    screen = io.StringIO()
    with run_progress(Output(notes=Console(file=screen, force_terminal=True, width=100)), "delivery") as show:
        show(PROGRESS)
    assert "drone_1" in screen.getvalue()
