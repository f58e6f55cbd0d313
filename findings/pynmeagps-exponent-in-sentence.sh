#!/usr/bin/env bash
# pynmeagps 1.1.8: a small value is written into a NMEA sentence with an exponent.
#
# NMEA 0183 numbers are digits with a decimal point. A boat at anchor with a speed of 0.00001 kn, the usual residue of a
# filter, becomes the field `1e-05` of a sentence with a good checksum, a form that NMEA has no place for. pynmeagps
# itself reads it back, so that a round trip shows nothing.
# Seen: spd field 1e-05, read back 1e-05
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q pynmeagps==1.1.8
"$folder/venv/bin/python" - <<'PYTHON'
import sys

from pynmeagps import GET, NMEAMessage, NMEAReader

sentence = NMEAMessage("GN", "RMC", GET, status="A", lat=52.0, lon=13.0, spd=0.00001, cog=90.0).serialize()
field = sentence.decode().split(",")[7]
print(sentence, field)
sys.exit((field, NMEAReader.parse(sentence).spd) != ("1e-05", 1e-05))
PYTHON
