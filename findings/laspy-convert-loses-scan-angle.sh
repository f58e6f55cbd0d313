#!/usr/bin/env bash
# laspy 2.7.0: converting a point cloud to LAS 1.4 sets every scan angle to zero.
#
# The old point formats hold the scan angle in degrees (`scan_angle_rank`), those from 6 on in steps of 0.006 degrees
# (`scan_angle`). `convert` copies what has the same name, so that 15 degrees are neither 15 nor 2500 but 0, for all
# points and without a warning; intensity, return number and the rest survive, and the conversion back gives zeros as well.
# Seen: [15, -15, 90] -> [0, 0, 0] -> [0, 0, 0], intensity [1, 2, 3]
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q laspy==2.7.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import sys

import laspy
import numpy as np

old = laspy.LasData(laspy.LasHeader(point_format=3, version="1.2"))
old.x = old.y = old.z = np.arange(3.0)
old.intensity = np.array([1, 2, 3])
old.scan_angle_rank = np.array([15, -15, 90], dtype=np.int8)
new = laspy.convert(old, point_format_id=6)
back = laspy.convert(new, point_format_id=3)
seen = np.array(new.scan_angle).tolist(), np.array(back.scan_angle_rank).tolist(), np.array(new.intensity).tolist()
print(*seen)
sys.exit(seen != ([0, 0, 0], [0, 0, 0], [1, 2, 3]))
PYTHON
