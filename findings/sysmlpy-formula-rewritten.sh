#!/usr/bin/env bash
# sysmlpy 0.97.1: formulas come back with other paths, without their arguments, or as the text of a Python dictionary.
#
# In SysML v2 `a.b.c` is a chain of features of an individual and `b::c` the name of a member, so `a.b::c` means something
# else. `dump` writes that for the chain, `f()` for a call with named arguments, and for a power of a power a dictionary
# of the parser, which no SysML tool can read. `loads` took all three without complaint.
# Seen: drone.battery::charge, thrust(), 2 ** {'name': 'UnaryExpression' ...
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q sysmlpy==0.97.1
HOME="$folder" "$folder/venv/bin/python" - <<'PYTHON'
import sys
import warnings

import sysmlpy

warnings.simplefilter("ignore")
formulas = "drone.battery.charge", "thrust(speed = 1, density = 2)", "2 ** 3 ** 2"
seen = []
for formula in formulas:
    dump = sysmlpy.loads(f"package P {{ attribute a; attribute x = {formula}; }}").dump()
    seen.append(dump.split("x=")[1].strip()[:30])
print(*seen, sep="\n")
sys.exit(not (seen[0].startswith("drone.battery::charge") and seen[1].startswith("thrust()") and "{'name'" in seen[2]))
PYTHON
