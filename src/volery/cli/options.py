"""Options and arguments that several commands have."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Say nothing but what is wrong.")]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON on standard output.")]
Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]
Seed = Annotated[int, typer.Option(help="Seeds every random stream of the run.")]
Out = Annotated[Path | None, typer.Option(help="The run folder; by default a new one in ./runs.")]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="PATH=VALUE", help="Override a value of the model; may be repeated."),
]
Fidelity = Annotated[
    str,
    typer.Option(metavar="times|code", help="Stated times, or the cost of the components' own code."),
]
On = Annotated[
    list[str],
    typer.Option(metavar="URL", help="sim:ardupilot, ardupilot+tcp://127.0.0.1:5760 ...; one per vehicle."),
]
Listen = Annotated[
    str | None,
    typer.Option(metavar="URL", help="tcp://HOST:PORT or udp://:PORT; without it, send to UDP 14550."),
]
Scenario = Annotated[str | None, typer.Option(help="A scenario of the model.")]
Allocation = Annotated[str | None, typer.Option(help="An allocation of the model; by default its first.")]
OnGraph = Annotated[str, typer.Option("--graph", metavar="ros1|ros2", help="The graph.")]
Topics = Annotated[
    list[str] | None, typer.Option("--topic", metavar="NAME", help="Only this topic; may be repeated.")
]
Recording = Annotated[Path, typer.Argument(help="A .bag or .mcap file, or the folder of a rosbag 2.")]
Model = Annotated[Path, typer.Argument(help="A model file, or a folder with a model.yaml.")]
IntoCatalogue = Annotated[
    Path, typer.Option(metavar="FILE", help="The catalogue to write the entry into; made if need be.")
]
CATALOGUE = Path("catalogue.yaml")
"""Where `volery calibrate` writes by default."""
EntryName = Annotated[str, typer.Option(help="The entry's name; by default made from the processor's.")]
Frequency = Annotated[
    float | None, typer.Option(metavar="MHZ", help="Of all cores, where it can be set (needs root).")
]
