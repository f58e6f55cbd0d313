#!/usr/bin/env bash
# geomag 0.9.2015: north of Canada it is 2.5 degrees off, with a model that ended in 2020.
#
# A World Magnetic Model is valid for five years. geomag carries that of 2015 and continues it in a straight line to any date,
# without a word; pygeomag (model of 2025) raises an error beyond its five years. At 70 N 100 W on 29 November 2026 the two
# say -2.30 and +0.17 degrees, and even the sign of what a compass is to be corrected by differs.
# Seen: geomag -2.30 in 2026, and an answer for 2100; pygeomag 0.17, ValueError for 2031
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q geomag==0.9.2015 pygeomag==1.1.0
"$folder/venv/bin/python" - <<'PYTHON'
import datetime
import sys

import geomag
from pygeomag import GeoMag

old = round(geomag.declination(70, -100, 0, datetime.date(2026, 11, 29)), 2)
far = round(geomag.declination(70, -100, 0, datetime.date(2100, 1, 1)), 2)
model = GeoMag(coefficients_file="wmm/WMM_2025.COF")
new = round(model.calculate(glat=70, glon=-100, alt=0, time=2026.91).d, 2)
try:
    beyond = model.calculate(glat=70, glon=-100, alt=0, time=2031.0).d
except ValueError as error:
    beyond = error
print("geomag", old, "in 2100", far, "pygeomag", new, "in 2031", beyond)
sys.exit((old, new, type(beyond)) != (-2.3, 0.17, ValueError))
PYTHON
