#!/usr/bin/env bash
# cantools 45.1.0: a decoded choice equals its name and can't be looked up by it.
#
# `decode_message` answers the name of a choice as an object that equals the string "On". The next line of most programs,
# a dictionary from the name to what is to be done, raises a TypeError: the object defines equality and no hash.
# `decode_choices=False` or `str()` around it helps.
# Seen: equal True; TypeError ... unhashable type
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q cantools==45.1.0
"$folder/venv/bin/python" - <<'PYTHON'
import sys

import cantools

database = cantools.database.load_string(
    'VERSION ""\nBU_: A\nBO_ 256 M: 1 A\n SG_ Mode : 0|2@1+ (1,0) [0|3] "" A\nVAL_ 256 Mode 0 "Off" 1 "On" ;\n', "dbc"
)
mode = database.decode_message("M", b"\x01")["Mode"]
try:
    found = {"On": "start", "Off": "stop"}[mode]
except TypeError as error:
    found = f"TypeError: {error}"
print("equal", mode == "On", "|", found)
sys.exit(mode != "On" or "unhashable" not in found)
PYTHON
