#!/usr/bin/env bash
# pymap3d 3.2.0: the rhumb line between two points left and right of the date line goes around the other side.
#
# From longitude 179 to -179 on the parallel of 40 degrees it is 2 degrees east, 171 km. `loxodrome_inverse` answers
# 15200 km with course 270, and no warning; `vdist` of the same package, and `loxodrome_inverse` for longitudes 179 and
# 181, know better. `loxodrome_direct`, its own inverse, sails across the line.
# Seen: -179: 15200.1 km course 270; 181: 170.8 km course 90; geodesic 170.8 km
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q pymap3d==3.2.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import sys

from pymap3d.lox import loxodrome_inverse
from pymap3d.vincenty import vdist

around, course = loxodrome_inverse(40, 179, 40, -179)
across, right_course = loxodrome_inverse(40, 179, 40, 181)
geodesic, _ = vdist(40, 179, 40, -179)
seen = [round(float(number), 1) for number in (around / 1e3, course, across / 1e3, right_course, geodesic / 1e3)]
print(seen)
sys.exit(seen != [15200.1, 270.0, 170.8, 90.0, 170.8])
PYTHON
