"""Options and arguments that several commands take, each declared once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from volery.base.errors import UsageError

Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON on standard output.")]
Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]
Seed = Annotated[int, typer.Option(help="Seed of every random stream of the run.")]
Out = Annotated[Path | None, typer.Option(help="Run folder; by default a new one in ./runs.")]
Record = Annotated[
    str,
    typer.Option(
        metavar="trace|/TOPIC,...|full|summary|none",
        help="Keep everything but the content of long messages (images, point clouds); also that of some "
        "topics, or of all; run.json alone; or no run folder.",
    ),
]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="PATH=VALUE", help="Override a value of the model; may be repeated."),
]
Fidelity = Annotated[
    str,
    typer.Option(
        metavar="times|code|firmware",
        help="Charge stated times, or the cost of the components' own code; with `firmware` the vehicles fly "
        "on programs of real firmware, too.",
    ),
]
Scenario = Annotated[str | None, typer.Option(help="Scenario of the model.")]
Allocation = Annotated[str | None, typer.Option(help="Allocation of the model; by default its first.")]
Model = Annotated[Path, typer.Argument(help="Model file, or folder with a model.yaml.")]
Speed = Annotated[
    str, typer.Option(metavar="max|FACTOR", help="Simulated seconds per second, for simulated vehicles.")
]

IfKilled = Annotated[
    Literal["return", "land", "hover"] | None,
    typer.Option(
        help="Let the autopilot do this by itself if this program is killed: its failsafe for a lost link is "
        "set, and restored at the end.",
    ),
]

LogFile = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Write what happens in the run into this file, line by line."),
]
LogLevel = Annotated[
    str,
    typer.Option(metavar="error|warning|info|debug", help="Least severity of a line of the log file."),
]

OnGraph = Annotated[str, typer.Option("--graph", metavar="ros1|ros2", help="ROS graph.")]
Topics = Annotated[
    list[str] | None, typer.Option("--topic", metavar="NAME", help="Only this topic; may be repeated.")
]
Recording = Annotated[Path, typer.Argument(help=".bag or .mcap file, or the folder of a rosbag 2.")]
AllowLoss = Annotated[
    bool, typer.Option("--allow-loss", help="Exit with status 0 although something is left out, not 3.")
]
NewRecording = Annotated[
    Path, typer.Argument(help="NAME.bag for a rosbag 1; any other name for the folder of a rosbag 2.")
]

CATALOGUE = Path("catalogue.yaml")
"""Default of ``CatalogueFile``."""
CatalogueFile = Annotated[
    Path, typer.Option(metavar="FILE", help="Catalogue to write the entry into; created if missing.")
]
EntryName = Annotated[
    str, typer.Option(help="Name of the entry; by default made from the name of this processor.")
]
Frequency = Annotated[
    float | None,
    typer.Option(metavar="MHZ", help="Frequency to set on all cores while measuring (needs root)."),
]


def parse_speed(speed: str) -> float | None:
    """Return the simulated seconds per second, or None for ``max``.

    Raises:
        UsageError: *speed* is neither ``max`` nor a positive finite number.
    """
    if speed == "max":
        return None
    try:
        pace = float(speed)
    except ValueError:
        pace = 0.0
    if not 0.0 < pace < float("inf"):
        raise UsageError(f"--speed {speed}: give max, or simulated seconds per second such as 1 or 10")
    return pace
