"""``volery map``: a map of a recording of scans."""

from __future__ import annotations

from os import W_OK, access
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.progress import track

from volery.base.errors import UsageError
from volery.base.time import clock, to_seconds
from volery.cli.command import LEFT_OUT, OK, Commands
from volery.cli.console import CommandOutput, make_table
from volery.cli.options import AllowLoss

if TYPE_CHECKING:
    from volery.autonomy.slam import Slam

commands = Commands()

SHOWN = 5
"""Warnings of a kind that are printed."""


@commands.add("quiet", "json", "debug")
def map(  # noqa: A001  # the name of the command
    output: CommandOutput,
    recording: Annotated[
        Path,
        typer.Argument(metavar="FILE", help="Bag (ROS 1, ROS 2, MCAP), log of CARMEN, or table of ranges."),
    ],
    out: Annotated[
        Path, typer.Option(help="Name of the map: NAME.pgm, NAME.yaml (map_server's) and NAME.csv (its way).")
    ] = Path("map"),
    source: Annotated[
        Literal["scanner", "camera"],
        typer.Option("--from", help="Laser scans, or pictures of a camera in a bag: depths, or grey ones."),
    ] = "scanner",
    scan: Annotated[
        str, typer.Option(metavar="TOPIC", help="LaserScan or Image topic of a bag with several.")
    ] = "",
    odometry: Annotated[
        str, typer.Option(metavar="TOPIC", help="Odometry topic of a bag with several.")
    ] = "",
    resolution: Annotated[float, typer.Option(metavar="METRES", help="Side of a cell.")] = 0.05,
    allow_loss: AllowLoss = False,
) -> int:
    """Make a map of a recording of scans or pictures: matching, loop closure, an occupancy grid."""
    from volery.autonomy.laser_logs import read_laser_log
    from volery.autonomy.occupancy_grid import OccupancyGrid
    from volery.autonomy.slam import Slam

    _check_names(out)
    grid = OccupancyGrid(resolution)
    log = read_laser_log(recording, scan, odometry, of_camera=source == "camera")
    slam = Slam(log.settings)
    shown = track(
        log.steps, f"mapping {recording.name}", console=output.notes, disable=not output.shows_progress
    )
    number = 0
    for step in shown:
        number += 1
        slam.add(step.odometry, step.scan)
    if not slam.scans:
        why = [f"none of its {number} scans has met anything" if number else "no scan of it can be used"]
        raise UsageError(f"{recording}: {'; '.join(why + log.damage)}")
    slam.finish()
    for kept, pose in zip(slam.scans, slam.poses, strict=True):
        grid.insert(pose, kept.scan)
    way = out.with_name(f"{out.name}.csv")
    try:
        picture, text = grid.save(out)
        _write_way(way, slam)
    except OSError as error:
        raise UsageError(
            f"--out {out}: {error.filename or way} cannot be written: {error.strerror}"
        ) from None
    first, last = slam.scans[0].scan.time, slam.scans[-1].scan.time
    rows, columns = grid.log_odds.shape
    values = {
        "scans": str(number),
        "kept": str(len(slam.scans)),
        "time": f"{to_seconds(last - first):.0f} s",
        "odometry": log.odometry or "none",
        "loops closed": str(slam.loops),
        "size": f"{columns * resolution:.1f} x {rows * resolution:.1f} m",
        "written": f"{picture}, {text}, {way}",
    }
    listed = make_table("", "", show_header=False)
    for name, value in values.items():
        listed.add_row(name, value)
    output.show(listed)
    output.give({**values, "lost": [{"time_ns": time, "what": words} for time, words in slam.lost]})
    for time, words in slam.lost[:SHOWN]:
        output.note(f"{clock(time - first)}: {words}")
    if len(slam.lost) > SHOWN:
        output.note(f"and {len(slam.lost) - SHOWN} times more; --json lists all")
    for words in log.damage:
        output.note(f"{recording}: {words}")
    return LEFT_OUT if log.damage and not allow_loss else OK


def _check_names(out: Path) -> None:
    """Say before the map is made that it could not be written."""
    if not out.name.strip("."):
        raise UsageError(f"--out {str(out)!r}: give a name, such as --out {out / 'map'}")
    if not out.parent.is_dir():
        raise UsageError(f"--out {out}: there is no folder {out.parent}")
    for suffix in ("pgm", "yaml", "csv"):
        file = out.with_name(f"{out.name}.{suffix}")
        if file.is_dir() or not access(file if file.exists() else out.parent, W_OK):
            raise UsageError(f"--out {out}: {file} cannot be written; give another name")


def _write_way(path: Path, slam: Slam) -> None:
    lines = ["# time_s, x_m, y_m, yaw_rad\n"]
    for kept, pose in zip(slam.scans, slam.poses, strict=True):
        sign, (seconds, rest) = "-" * (kept.scan.time < 0), divmod(abs(kept.scan.time), 1_000_000_000)
        lines.append(f"{sign}{seconds}.{rest:09d},{pose.x:.4f},{pose.y:.4f},{pose.yaw:.5f}\n")
    path.write_text("".join(lines), encoding="utf-8")
