#!/usr/bin/env bash
# aerofiles 1.5.6: a waypoint just south of 52 degrees is written as 51 degrees 60 minutes.
#
# A SeeYou file has latitudes as degrees and minutes with three decimals. The writer splits off the degrees first and rounds the
# minutes then: 51.999995, which is 51 degrees 59.9997 minutes, becomes `5160.000N`, and the longitude 00460.000W. Minutes end
# at 59.999 in every such format, and readers that check refuse the waypoint; its own does not.
# Seen: 5160.000N,00460.000W, read back 52.0, -5.0
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q aerofiles==1.5.6 python-dateutil==4.0.0
"$folder/venv/bin/python" - <<'PYTHON'
import io
import sys

from aerofiles.seeyou import Reader, Writer

file = io.BytesIO()
Writer(file).write_waypoint("Edge", "E", "GB", 51.999995, -4.999995)
text = file.getvalue().decode()
back = Reader().read(io.StringIO(text))["waypoints"][0]
print(text.splitlines()[1], back["latitude"], back["longitude"])
sys.exit(",5160.000N,00460.000W," not in text or (back["latitude"], back["longitude"]) != (52.0, -5.0))
PYTHON
