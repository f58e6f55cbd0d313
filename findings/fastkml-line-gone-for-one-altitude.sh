#!/usr/bin/env bash
# fastkml 1.4.0: a line of which one point has no altitude has no geometry at all, and is gone when saved.
#
# KML writes a point as longitude, latitude and, if wanted, altitude; each point of a line may leave it out. Where some do and
# some do not, `geometry` is None: no error, no warning, although the reader is strict by default. `to_string` writes the
# placemark without its line; the placemark of a line with all altitudes stays.
# Seen: geometry None, 'LineString' in the output once (of two)
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q fastkml==1.4.0
"$folder/venv/bin/python" - <<'PYTHON'
import sys

from fastkml import KML

text = '<kml xmlns="http://www.opengis.net/kml/2.2"><Document>'
for name, points in (("mixed", "8,47,10 8.1,47.1 8.2,47.2,30"), ("full", "8,47,10 8.1,47.1,20 8.2,47.2,30")):
    text += f"<Placemark><name>{name}</name><LineString><coordinates>{points}</coordinates></LineString></Placemark>"
read = KML.from_string(text + "</Document></kml>")
shapes = {mark.name: mark.geometry for mark in read.features[0].features}
lines = read.to_string().count("<LineString>") + read.to_string().count("<kml:LineString>")
print(shapes, "lines written", lines)
sys.exit(shapes["mixed"] is not None or shapes["full"] is None or lines != 1)
PYTHON
