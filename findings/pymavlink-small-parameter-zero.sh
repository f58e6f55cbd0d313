#!/usr/bin/env bash
# pymavlink 2.4.50: a parameter file keeps six decimals, so that a small parameter comes back as 0.
#
# `MAVParmDict.save` writes `%f`. A float32 of 2.5e-07 is saved
# as 0.000000 and loaded as 0, without a word; 0.000123456 keeps three of its six digits. `load` itself reads 2.5e-07 well.
# Seen: 2.5e-07 -> 0.0, 0.000123456 -> 0.000123, read from text 2.5e-07
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q pymavlink==2.4.50
"$folder/venv/bin/python" - "$folder" <<'PYTHON'
import pathlib
import sys

from pymavlink.mavparm import MAVParmDict

file = pathlib.Path(sys.argv[1], "all.parm")
saved = MAVParmDict()
saved["NOISE"], saved["SCALE"] = 2.5e-07, 0.000123456
saved.save(str(file))
loaded = MAVParmDict()
loaded.load(str(file))
file.write_text("NOISE 2.5e-07\n")
by_hand = MAVParmDict()
by_hand.load(str(file))
print(dict(saved), "->", dict(loaded), "| read from text", dict(by_hand))
sys.exit((loaded["NOISE"], loaded["SCALE"], by_hand["NOISE"]) != (0.0, 0.000123, 2.5e-07))
PYTHON
