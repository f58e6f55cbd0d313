#!/usr/bin/env bash
# gtsam 4.3.0: a solved pose graph in UTM coordinates is saved with steps of 10 m, and no longer agrees with its own edges.
#
# `writeG2o` writes six digits. That is enough for the edges, which are relative, and for poses around a map's own origin. A northing of
# 4481234.6 m becomes 4.48123e+06, so that poses 3 m apart come back at the same place or 10 m apart. The error of the graph, 0
# when saved, is 3394 when `readG2o` has read it. One would expect the digits that a double needs, or a warning: UTM is usual
# where GNSS takes part.
# Seen: error 0.0, then 3394; northings 4481230, 4481240, 4481240, 4481240
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q gtsam==4.3.0 numpy==2.4.6
"$folder/venv/bin/python" - "$folder/utm.g2o" <<'PYTHON'
import sys
from importlib.metadata import version

import gtsam
import numpy as np

POSES = 4
noise = gtsam.noiseModel.Diagonal.Sigmas(np.array([0.1, 0.1, 0.05]))
poses, graph = gtsam.Values(), gtsam.NonlinearFactorGraph()
for key in range(POSES):
    poses.insert(key, gtsam.Pose2(448123.4 + 0.4 * key, 4481234.6 + 3 * key, 0.1))
for key in range(POSES - 1):
    step = poses.atPose2(key).between(poses.atPose2(key + 1))
    graph.add(gtsam.BetweenFactorPose2(key, key + 1, step, noise))
gtsam.writeG2o(graph, poses, sys.argv[1])
graph_read, poses_read = gtsam.readG2o(sys.argv[1], False)
errors = round(graph.error(poses), 6), round(graph_read.error(poses_read))
northings = [poses_read.atPose2(key).y() for key in range(POSES)]
print("gtsam", version("gtsam"), "error before and after", *errors, "northings", northings)
sys.exit((errors, northings) != ((0, 3394), [4481230, 4481240, 4481240, 4481240]))
PYTHON
