#!/usr/bin/env bash
# urchin 0.0.30: a joint that mimics a mimicking joint never moves.
#
# A URDF mimic is defined by value = multiplier * other joint + offset, and the other joint may be any joint. Here the second
# finger mimics the first and the third the second, all about z. With the first at 0.4 the links should be turned
# by 0.4, 0.8 and 1.2 rad; urchin turns the third by nothing and says nothing. (yourdfpy warns about it.)
# Seen: 0.4 0.8 0.8
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q urchin==0.0.30 numpy==2.4.6
"$folder/venv/bin/python" - "$folder" <<'PYTHON'
import math
import pathlib
import sys

from urchin import URDF

text = '<robot name="gripper"><link name="l0"/>'
for number in (1, 2, 3):
    text += f"""<link name="l{number}"/><joint name="j{number}" type="revolute">
      <parent link="l{number - 1}"/><child link="l{number}"/><axis xyz="0 0 1"/>
      <limit lower="-3" upper="3" effort="1" velocity="1"/>
      {f'<mimic joint="j{number - 1}"/>' if number > 1 else ""}</joint>"""
file = pathlib.Path(sys.argv[1], "gripper.urdf")
file.write_text(text + "</robot>")
poses = URDF.load(str(file)).link_fk({"j1": 0.4})
turned = {link.name: round(math.atan2(pose[1, 0], pose[0, 0]), 6) for link, pose in poses.items()}
print(turned)
sys.exit([turned[name] for name in ("l1", "l2", "l3")] != [0.4, 0.8, 0.8])
PYTHON
