#!/usr/bin/env bash
# pygeodesy 26.10.26: a triangle around the North Pole does not enclose it, and has the area of half the Earth.
#
# `ispolar` tells whether a polygon encloses a pole, and `areaOf` wants to be told of that by `polar`. Three corners at 85 N, 120
# degrees apart, are not polar for it, and 254630 thousand km2; four corners are, and 619 thousand. `triangle7` of the same
# module says 402 for the three, and `isEnclosedBy` that the pole lies inside.
# Seen: triangle False, 254630.5, 402.4, pole inside True; square True, 619.0
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q pygeodesy==26.10.26
"$folder/venv/bin/python" - <<'PYTHON'
import sys

from pygeodesy import ispolar
from pygeodesy.sphericalTrigonometry import LatLon, areaOf, triangle7

triangle = [LatLon(85, longitude) for longitude in (0, 120, -120)]
square = [LatLon(85, longitude) for longitude in (0, 90, 180, -90)]
inside = LatLon(90, 0).isEnclosedBy(triangle)
sizes = [round(areaOf(points, polar=ispolar(points)) / 1e9, 1) for points in (triangle, square)]
other = round(triangle7(85, 0, 85, 120, 85, -120).area / 1e9, 1)
print(ispolar(triangle), sizes[0], other, inside, "|", ispolar(square), sizes[1])
sys.exit((ispolar(triangle), sizes, other, inside, ispolar(square)) != (False, [254630.5, 619.0], 402.4, True, True))
PYTHON
