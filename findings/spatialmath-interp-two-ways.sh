#!/usr/bin/env bash
# spatialmath-python 1.1.18: the middle between two headings is 180 degrees apart for `SO3` and `UnitQuaternion`.
#
# Between headings of -3 and +3 rad (0.28 rad apart, across south) `SO3.interp` goes the short way, its middle is
# pi. `UnitQuaternion.interp` goes the long way by default, through north, its middle is 0; only with
# `shortest=True` is it pi. Changing the representation of an attitude changes the way that a vehicle turns.
# Seen: SO3 3.142, UnitQuaternion 0.0, UnitQuaternion with shortest=True 3.142
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q spatialmath-python==1.1.18
"$folder/venv/bin/python" - <<'PYTHON'
import math
import sys

from spatialmath import SO3, UnitQuaternion

one, other = UnitQuaternion.Rz(-3), UnitQuaternion.Rz(3)
seen = (
    SO3.Rz(-3).interp(SO3.Rz(3), 0.5).rpy()[2],
    one.interp(other, 0.5).rpy()[2],
    one.interp(other, 0.5, shortest=True).rpy()[2],
)
print([round(float(angle), 3) for angle in seen])
expected = (math.pi, 0.0, math.pi)
sys.exit(any(abs(abs(got) - wanted) > 1e-6 for got, wanted in zip(seen, expected, strict=True)))
PYTHON
