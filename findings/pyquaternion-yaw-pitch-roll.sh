#!/usr/bin/env bash
# pyquaternion 0.9.9: `yaw_pitch_roll` gives other angles than those that the attitude was made of.
#
# Its documentation promises the intrinsic z-y'-x'' angles of aviation. Turned by yaw 0.5, pitch 0.3 and roll 0.1 rad it
# answers 0.494, 0.311, -0.056: that are the intrinsic x-y'-z'' angles, in reverse order. With one angle alone the two
# agree, which is why nobody's first test fails. SciPy answers what went in.
# Seen: pyquaternion 0.494 0.311 -0.056, SciPy ZYX 0.5 0.3 0.1, SciPy XYZ reversed 0.494 0.311 -0.056
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q pyquaternion==0.9.9 scipy==1.17.1 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import sys

from pyquaternion import Quaternion
from scipy.spatial.transform import Rotation

yaw, pitch, roll = (Quaternion(axis=axis, angle=angle) for axis, angle in (((0, 0, 1), 0.5), ((0, 1, 0), 0.3), ((1, 0, 0), 0.1)))
attitude = yaw * pitch * roll
w, x, y, z = attitude.elements
rotation = Rotation.from_quat([x, y, z, w])
answers = attitude.yaw_pitch_roll, rotation.as_euler("ZYX"), rotation.as_euler("XYZ")[::-1]
seen = [[round(float(angle), 3) for angle in answer] for answer in answers]
print(*seen)
wrong = [0.494, 0.311, -0.056]
sys.exit(seen != [wrong, [0.5, 0.3, 0.1], wrong])
PYTHON
