"""A map of the Intel Research Lab's log by ``volery map``, judged by the data set's own evaluator.

    python bench/slam.py --dataset FOLDER

The folder has ``scans.csv``, ``gmapping-trajectory.csv`` and ``evaluate.py``. The reference, in the same run
by the same evaluator, is gmapping's trajectory. Times are processor time of one core against the time of the
log.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path
from time import process_time

from volery.autonomy.laser_logs import read_laser_log
from volery.autonomy.slam import Slam
from volery.base.time import to_seconds


def evaluated(folder: Path, trajectory: Path) -> str:
    """Return the evaluator's words on a trajectory."""
    made = subprocess.run(
        [sys.executable, str(folder / "evaluate.py"), str(trajectory)],
        capture_output=True,
        text=True,
        check=True,
    )
    return made.stdout.strip()


def main() -> None:
    """Print the errors of both trajectories and the speed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--dataset", type=Path, required=True, metavar="FOLDER")
    folder = parser.parse_args().dataset
    steps = list(read_laser_log(folder / "scans.csv").steps)
    warm = Slam()
    for step in steps[:60]:
        warm.add(step.odometry, step.scan)
    warm.finish()
    start = process_time()
    slam = Slam()
    for step in steps:
        slam.add(step.odometry, step.scan)
    online = process_time() - start
    slam.finish()
    whole = process_time() - start
    lasted = to_seconds(steps[-1].scan.time - steps[0].scan.time)
    with tempfile.TemporaryDirectory() as made:
        ours = Path(made) / "ours.csv"
        ours.write_text(
            "".join(
                f"{kept.scan.time / 1e9:.6f},{pose.x},{pose.y},{pose.yaw}\n"
                for kept, pose in zip(slam.scans, slam.poses, strict=True)
            )
        )
        print("volery  ", evaluated(folder, ours))
    print("gmapping", evaluated(folder, folder / "gmapping-trajectory.csv"))
    print(f"{len(steps)} scans of {lasted:.0f} s; real time over processor time:")
    print(f"online {lasted / online:.0f} ({online:.1f} s)")
    print(f"with the last fit {lasted / whole:.0f} ({whole:.1f} s)")


if __name__ == "__main__":
    main()
