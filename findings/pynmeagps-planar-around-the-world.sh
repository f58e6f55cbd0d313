#!/usr/bin/env bash
# pynmeagps 1.1.8: the distance for short ways says 40075 km for 222 m across the date line.
#
# `planar` is the package's quick distance for points near each other. It subtracts the longitudes as they are: from
# 179.999 to -179.999 degrees is once around the Earth. `haversine` of the same package says 0.22 (in km; `planar` is in m).
# Seen: planar 40074794 m, haversine 0.223 km
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q pynmeagps==1.1.8
"$folder/venv/bin/python" - <<'PYTHON'
import sys

from pynmeagps.nmeahelpers import haversine, planar

seen = round(planar(0, 179.999, 0, -179.999)), round(haversine(0, 179.999, 0, -179.999), 3)
print(*seen)
sys.exit(seen != (40074794, 0.223))
PYTHON
