#!/usr/bin/env bash
# pynmeagps 1.1.8: the ISO 6709 text of a point below the ellipsoid has two signs before its height.
#
# ISO 6709 writes a point as sign and fixed digits of each part, `-05.5-003.25-10CRS...`. `llh2iso6709` joins plain
# numbers and puts a second minus before a negative height, so that a reader of
# the format finds no height. The degrees lack their leading zeros as well.
# Seen: -5.5-3.25--10CRSWGS_84/
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q pynmeagps==1.1.8
"$folder/venv/bin/python" - <<'PYTHON'
import sys

from pynmeagps.nmeahelpers import llh2iso6709

seen = llh2iso6709(-5.5, -3.25, -10)
print(seen)
sys.exit(seen != "-5.5-3.25--10CRSWGS_84/")
PYTHON
