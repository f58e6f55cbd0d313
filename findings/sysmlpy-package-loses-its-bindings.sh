#!/usr/bin/env bash
# sysmlpy 0.97.1: a package that is loaded and dumped has lost its bindings, its variants and the types of its ends.
#
# The documentation promises that `loads` and `dump` give the text back. Of the four valid SysML v2 members below `bind` and
# `succession` are missing from the dump, the variation has no variants, and the ends of the interface have no port
# definition. Nothing is said; within a part the same `bind` survives. A tool that saves through it thins the model out.
# Seen: no "bind", no "succession", no "variant", "end a;"
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
text = """package Drone {
  part battery; part rotor; action check; action fly;
  bind battery = rotor;
  succession order first check then fly;
  variation part def Frame { variant part quad; variant part hexa; }
  interface def Cable { end a : Plug; end b : Socket; }
}"""
dump = sysmlpy.loads(text).dump()
print(dump)
kept = [word for word in ("bind ", "succession", "variant ", ": Plug", ": Socket") if word in dump]
sys.exit(bool(kept) or "variation part def Frame" not in dump or "interface def Cable" not in dump)
PYTHON
