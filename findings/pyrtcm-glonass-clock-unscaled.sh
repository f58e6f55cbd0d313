#!/usr/bin/env bash
# pyrtcm 1.2.1: of one GLONASS ephemeris the orbit comes in kilometres, the clock in raw bits.
#
# In RTCM 3 message 1020 the position has steps of 2**-11 km, the clock offset tau steps of 2**-30 s and the frequency
# offset gamma steps of 2**-40. pyrtcm scales what it knows the step of, which is the orbit and the whole of the GPS
# message 1019; for the GLONASS clock its table has none. A clock that is 1 microsecond slow reads as -1074 seconds.
# Seen: DF112 1000.0 (km), DF124 -1074 (2**-30 s), DF121 5 (2**-40)
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q pyrtcm==1.2.1
"$folder/venv/bin/python" - <<'PYTHON'
import sys

from pyrtcm import RTCMMessage
from pyrtcm.rtcmtypes_core import RTCM_DATA_FIELDS
from pyrtcm.rtcmtypes_get import RTCM_PAYLOADS_GET

values = {"DF002": 1020, "DF112": 1000 * 2**11, "DF121": 5, "DF124": (1 << 21) | 1074}
bits = ""
for name in RTCM_PAYLOADS_GET["1020"]:
    bits += format(values.get(name, 0), f"0{RTCM_DATA_FIELDS[name][1]}b")
bits += "0" * (-len(bits) % 8)
read = RTCMMessage(payload=int(bits, 2).to_bytes(len(bits) // 8, "big"))
print("x", read.DF112, "tau", read.DF124, "gamma", read.DF121)
sys.exit((read.DF112, read.DF124, read.DF121) != (1000.0, -1074, 5))
PYTHON
