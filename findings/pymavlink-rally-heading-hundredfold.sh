#!/usr/bin/env bash
# pymavlink 2.4.50: every load and save of a rally file multiplies the landing direction by a hundred.
#
# `MAVRallyLoader` reads degrees and keeps centidegrees, as the message RALLY_POINT has them; `save` writes the
# centidegrees into the column of degrees. After one round trip a direction of 90 degrees is 9000 degrees in the file,
# after the second 900000, more than the 16-bit field of the message can carry. The altitude 100.9 m ends as 100 m.
# Seen: direction 9000, then 900000; altitude 100
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q pymavlink==2.4.50
"$folder/venv/bin/python" - "$folder" <<'PYTHON'
import pathlib
import sys

from pymavlink.mavwp import MAVRallyLoader

file = pathlib.Path(sys.argv[1], "rally.txt")
file.write_text("RALLY 52.0 13.0 100.9 50 90 1\n")
seen = []
for _ in range(2):
    rally = MAVRallyLoader()
    rally.load(str(file))
    rally.save(str(file))
    print(file.read_text().strip())
    altitude, _, direction = map(float, file.read_text().split()[3:6])
    seen.append((altitude, direction))
sys.exit(seen != [(100.0, 9000.0), (100.0, 900000.0)])
PYTHON
