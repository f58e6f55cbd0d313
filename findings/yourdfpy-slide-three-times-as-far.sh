#!/usr/bin/env bash
# yourdfpy 0.0.60, urchin 0.0.30: one prismatic joint at 0.2 m stands at 0.6 m for one library, at 0.2 m for the other.
#
# The axis of a URDF joint is a direction; the specification says that it should be normalized, and exporters write axes like
# `0 0 3` or `1 1 0` all the same. yourdfpy normalizes the axis of a revolute joint and multiplies by the raw one of
# a prismatic joint, so that limits and positions are no metres any more. Neither warns.
# Seen: yourdfpy 0.6, urchin 0.2
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q yourdfpy==0.0.60 urchin==0.0.30 numpy==2.4.6
"$folder/venv/bin/python" - "$folder" <<'PYTHON'
import pathlib
import sys

import urchin
import yourdfpy

file = pathlib.Path(sys.argv[1], "lift.urdf")
file.write_text("""<robot name="lift"><link name="base"/><link name="fork"/>
<joint name="mast" type="prismatic"><parent link="base"/><child link="fork"/><axis xyz="0 0 3"/>
<limit lower="0" upper="1" effort="1" velocity="1"/></joint></robot>""")
lift = yourdfpy.URDF.load(str(file))
lift.update_cfg({"mast": 0.2})
first = round(float(lift.get_transform("fork", "base")[2, 3]), 6)
poses = urchin.URDF.load(str(file)).link_fk({"mast": 0.2})
second = {link.name: round(float(pose[2, 3]), 6) for link, pose in poses.items()}["fork"]
print("yourdfpy", first, "urchin", second)
sys.exit((first, second) != (0.6, 0.2))
PYTHON
