#!/usr/bin/env bash
# pymavlink 2.4.50, crc 8.0.0, crcmod 1.7: the X.25 checksum of MAVLink is X.25 in none of the CRC libraries.
#
# MAVLink's own code and guide call its checksum X.25 (`x25crc`, ITU X.25). Of the usual test text 123456789 that is 0x6f91. The
# CRC libraries, and the catalogue that they follow, have another under this name, with the result inverted: 0x906e. What
# MAVLink computes is catalogued as CRC-16/MCRF4XX. A parser built on a library by the name drops every packet.
# Seen: pymavlink 0x6f91, crc X25 0x906e, crcmod x-25 0x906e, fastcrc mcrf4xx 0x6f91
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q pymavlink==2.4.50 crc==8.0.0 crcmod==1.7 fastcrc==0.5.0
"$folder/venv/bin/python" - <<'PYTHON'
import sys

import crc
import crcmod.predefined
import fastcrc
from pymavlink.generator.mavcrc import x25crc

text = b"123456789"
seen = [
    x25crc(text).crc,
    crc.Calculator(crc.Crc16.X25).checksum(text),
    crcmod.predefined.mkPredefinedCrcFun("x-25")(text),
    fastcrc.crc16.mcrf4xx(text),
]
print(*(hex(value) for value in seen))
sys.exit(seen != [0x6F91, 0x906E, 0x906E, 0x6F91])
PYTHON
