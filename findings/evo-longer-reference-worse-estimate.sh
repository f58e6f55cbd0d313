#!/usr/bin/env bash
# evo 1.38.1: a perfect estimate gets an error once the reference goes on after the estimate has ended.
#
# A vehicle drives at 2 m/s. The estimate has 200 poses a second for five seconds, the reference 10 a second, and both are exact. With
# 5 s of reference each of its 50 poses finds its partner, and the error is 0. With 120 s of it the reference is the longer list:
# `associate_trajectories` then walks through the estimate and gives one reference pose to up to five estimated ones, all within the
# usual 10 ms. The result is 250 pairs from 51 poses, with stamps that `check` calls wrong, and errors that are the sampling of
# the reference. One would expect each pose to be used once, and a score that does not depend on what was recorded afterwards.
# Seen: 5 s 50 pairs, APE 0, RPE 0; 120 s 250 pairs, APE 0.0141 m, RPE 0.0200 m, check False
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q evo==1.38.1 numpy==2.4.6
HOME=$folder "$folder/venv/bin/python" - <<'PYTHON'
import sys
from importlib.metadata import version

import numpy as np
from evo.core import metrics, sync
from evo.core.trajectory import PoseTrajectory3D


def drive(rate, seconds):
    time = np.arange(rate * seconds) / rate
    places = np.column_stack([2 * time, 0 * time, 0 * time])
    return PoseTrajectory3D(places, np.tile([1.0, 0, 0, 0], (len(time), 1)), 1000 + time)


print("evo", version("evo"))
seen = []
for seconds in (5, 120):
    reference, estimate = sync.associate_trajectories(drive(10, seconds), drive(200, 5))
    scores = []
    for metric in (metrics.APE(), metrics.RPE()):
        metric.process_data((reference, estimate))
        scores.append(round(float(metric.get_statistic(metrics.StatisticsType.rmse)), 4))
    used = len(np.unique(reference.timestamps))
    seen.append((reference.num_poses, used, *scores, reference.check()[0]))
    print(seconds, "s: pairs, poses of the reference, APE, RPE, check:", *seen[-1])
sys.exit(seen != [(50, 50, 0.0, 0.0, True), (250, 51, 0.0141, 0.02, False)])
PYTHON
