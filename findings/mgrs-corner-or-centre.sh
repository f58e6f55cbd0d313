#!/usr/bin/env bash
# mgrs 1.6.0, pygeodesy 26.10.26: one grid reference, two UTM coordinates, and two readings within one library.
#
# `33UUT67` names a square of 10 km. pygeodesy's `toUtm` answers its south-west corner, which the reference denotes by
# definition; `MGRSToUTM` of mgrs answers the centre, 7 km away; and pygeodesy's `toLatLon` answers the centre, too. A
# mission planned with one and flown with the other is off by half a square in both axes.
# Seen: mgrs (365000, 5775000), pygeodesy (360000, 5770000); latitudes of both 52.109
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q mgrs==1.6.0 pygeodesy==26.10.26
"$folder/venv/bin/python" - <<'PYTHON'
import sys

from mgrs import MGRS
from pygeodesy import parseMGRS

reference = "33UUT67"
_, _, east, north = MGRS().MGRSToUTM(reference)
utm = parseMGRS(reference).toUtm()
latitudes = MGRS().toLatLon(reference)[0], parseMGRS(reference).toLatLon().lat
seen = (east, north), (utm.easting, utm.northing), [round(latitude, 3) for latitude in latitudes]
print(*seen)
sys.exit(seen != ((365000.0, 5775000.0), (360000.0, 5770000.0), [52.109, 52.109]))
PYTHON
