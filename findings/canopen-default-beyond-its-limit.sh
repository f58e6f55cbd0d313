#!/usr/bin/env bash
# canopen 2.4.1: the default of a signed object is 255, above its own upper limit of 127.
#
# An EDS file writes the value of an INTEGER8 as 0xFF for -1 and its limits as 0x80 and 0x7F. The reader takes the sign of the
# limits (-128, 127) and not of the default. A local node that is asked for its own untouched object raises a ValueError
# ("Value does not fit in specified type") and logs that 255 is greater than 127.
# Seen: default 255, limits -128 and 127; ValueError
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q canopen==2.4.1
"$folder/venv/bin/python" - <<'PYTHON'
import io
import sys

import canopen

eds = io.StringIO("""[DeviceInfo]
[ManufacturerObjects]
SupportedObjects=1
1=0x2000
[2000]
ParameterName=Trim
ObjectType=0x7
DataType=0x0002
AccessType=rw
DefaultValue=0xFF
LowLimit=0x80
HighLimit=0x7F
PDOMapping=0
""")
eds.name = "trim.eds"
objects = canopen.import_od(eds, node_id=5)
trim = objects[0x2000]
try:
    said = canopen.LocalNode(5, objects).get_data(0x2000, 0)
except ValueError as error:
    said = error
print(trim.default, trim.min, trim.max, "|", said)
sys.exit((trim.default, trim.min, trim.max, type(said)) != (255, -128, 127, ValueError))
PYTHON
