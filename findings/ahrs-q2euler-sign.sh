#!/usr/bin/env bash
# AHRS 0.4.0: two functions of one package turn the same quaternion into yaw angles of opposite sign.
#
# A turn of +1 rad about z is the quaternion (cos 0.5, 0, 0, sin 0.5). `q2R` makes the matrix of +1 rad of it, and
# `Quaternion.to_angles` and `q2rpy` say +1; `q2euler` says -1. A program that takes `q2euler` for the inverse of
# the package's other conversions steers the wrong way, without an error.
# Seen: q2R +1.0, to_angles +1.0, q2rpy +1.0, q2euler -1.0
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q ahrs==0.4.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import math
import sys

import numpy as np
from ahrs import Quaternion
from ahrs.common.orientation import q2euler, q2R, q2rpy

q = np.array([math.cos(0.5), 0.0, 0.0, math.sin(0.5)])
matrix = q2R(q)
seen = {
    "q2R": math.atan2(matrix[1, 0], matrix[0, 0]),
    "to_angles": Quaternion(q).to_angles()[2],
    "q2rpy": q2rpy(q)[2],
    "q2euler": q2euler(q)[2],
}
print({name: round(float(angle), 3) for name, angle in seen.items()})
expected = {"q2R": 1.0, "to_angles": 1.0, "q2rpy": 1.0, "q2euler": -1.0}
sys.exit(any(abs(seen[name] - expected[name]) > 1e-6 for name in expected))
PYTHON
