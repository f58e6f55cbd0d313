#!/usr/bin/env bash
# pyrtcm 1.2.1: an auxiliary station three metres north of its master is decoded 25 million units away.
#
# RTCM 3 message 1014 gives the station's offset in steps of 25e-6 degrees (20 bits, so up to 13.1 degrees). The step in
# the package's table is 25000000, which makes +1 of latitude 25000000 and -4 of longitude -100000000, while the
# fields around them are right. With 25e-6 they are 0.000025 and -0.0001 degrees.
# Seen: DF062 25000000, DF063 -100000000, DF064 1000
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q pyrtcm==1.2.1
"$folder/venv/bin/python" - <<'PYTHON'
import sys

from pyrtcm import RTCMMessage

fields = [(1014, 12), (0, 8), (0, 4), (1, 5), (1, 12), (2, 12), (1, 20), (-4, 21), (1000, 23)]
bits = "".join(format(value % (1 << size), f"0{size}b") for value, size in fields)
bits += "0" * (-len(bits) % 8)
read = RTCMMessage(payload=int(bits, 2).to_bytes(len(bits) // 8, "big"))
print(read)
sys.exit((read.DF062, read.DF063, read.DF064) != (25000000, -100000000, 1000))
PYTHON
