#!/usr/bin/env bash
# pyubx2 1.4.0: one of eight values with two decimals is written one unit too low.
#
# NAV-PVT holds pDOP in hundredths. `UBXMessage` divides by the scale and cuts the fraction: 1.15 / 0.01 is
# 114.99999999999999 and becomes 114. A program that reads messages and writes them again (a filter, a simulator) lowers
# such values in each pass, until they reach one that survives.
# Seen: 1.15 -> 1.14; 253 of the 2000 values 0.01 to 20.00 come back changed
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q pyubx2==1.4.0
"$folder/venv/bin/python" - <<'PYTHON'
import sys

from pyubx2 import GET, UBXMessage, UBXReader


def round_trip(value):
    return UBXReader.parse(UBXMessage("NAV", "NAV-PVT", GET, pDOP=value).serialize()).pDOP


changed = sum(round_trip(hundredths / 100) != hundredths / 100 for hundredths in range(1, 2001))
seen = round_trip(1.15), changed
print(seen)
sys.exit(seen != (1.14, 253))
PYTHON
