#!/usr/bin/env bash
# pysbf2 1.0.7: the coefficients of the Galileo ionosphere are read as zero, whatever the satellites say.
#
# Septentrio's GALIon block holds a_i0 as a float in units of 1e-22 W/(m2 Hz), for instance 54. pysbf2 multiplies by 1e-22
# and then rounds every scaled value to twelve decimals, which leaves 0.0 for any coefficient that a satellite sends. A
# correction computed of it has no ionosphere. `scaling=False` gives 54.0.
# Seen: a_i0 0.0 a_i1 0.0, without scaling 54.0 0.25
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q pysbf2==1.0.7
"$folder/venv/bin/python" - <<'PYTHON'
import struct
import sys

from pysbf2 import SBFMessage

block = struct.pack("<IHBBfffB3x", 1000, 2400, 71, 2, 54.0, 0.25, 0.0, 0)
scaled = SBFMessage("GALIon", payload=block)
raw = SBFMessage("GALIon", payload=block, scaling=False)
seen = (scaled.a_i0, scaled.a_i1), (raw.a_i0, raw.a_i1)
print(*seen)
sys.exit(seen != ((0.0, 0.0), (54.0, 0.25)))
PYTHON
