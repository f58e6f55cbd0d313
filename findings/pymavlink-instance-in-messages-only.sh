#!/usr/bin/env bash
# pymavlink 2.4.50: the name of a sensor's instance is a key of `messages` and matches nothing in `recv_match`.
#
# A DataFlash log whose FMTU names the column I as the instance ("#") holds one IMU record each of instances 0 and 1. The
# reader files them as `messages["IMU[0]"]` and `messages["IMU[1]"]`. `recv_match(type="IMU[1]")` reads to the end of
# the file and answers None, as if the log had no such sensor; only type "IMU" finds both.
# Seen: keys IMU, IMU[0], IMU[1]; matches of IMU 2, of IMU[1] 0
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q pymavlink==2.4.50
"$folder/venv/bin/python" - "$folder" <<'PYTHON'
import struct
import sys

from pymavlink import mavutil


def layout(kind, length, name, form, columns):
    return b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", kind, length, name, form, columns)


log = layout(128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
log += layout(129, 44, b"FMTU", b"QBNN", b"TimeUS,FmtType,UnitIds,MultIds") + layout(140, 16, b"IMU", b"QBf", b"TimeUS,I,GyrX")
log += b"\xa3\x95\x81" + struct.pack("<QB16s16s", 0, 140, b"s#E", b"F--")
for instance in (0, 1):
    log += b"\xa3\x95\x8c" + struct.pack("<QBf", 1000000, instance, 0.5)
with open(f"{sys.argv[1]}/flight.bin", "wb") as file:
    file.write(log)
seen = []
for kind in ("IMU", "IMU[1]"):
    reader = mavutil.mavlink_connection(file.name)
    seen.append(sum(1 for _ in iter(lambda: reader.recv_match(type=kind), None)))
keys = sorted(key for key in reader.messages if key.startswith("IMU"))
print(keys, seen)
sys.exit((keys, seen) != (["IMU", "IMU[0]", "IMU[1]"], [2, 0]))
PYTHON
