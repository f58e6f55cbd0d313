#!/usr/bin/env bash
# roslib 2.1.0 (npm), urdf-parser-py 0.0.4: an origin written with two spaces is where it says for the one, and none for the other.
#
# `xyz` and `rpy` of a URDF are numbers with white space between them; files aligned by hand or by an exporter have two spaces here and
# there, and ROS's own parser for Python reads them. `UrdfModel` splits at each single space, finds an empty second number and leaves
# position and orientation as they were made, without a word: the joint stands at its parent, unturned. The same text as an axis
# is an error.
# Seen: urdf-parser-py 1 2 3, 0 0 1.5; roslib 1 2 3, w 0.732 with single spaces, 0 0 0, w 1 with two; the axis an Error
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q urdf-parser-py==0.0.4 lxml==6.1.3 PyYAML==6.0.3
npm install --silent --no-audit --no-fund roslib@2.1.0
write() {
    cat > "$1.urdf" <<XML
<robot name="rover"><link name="base"/><link name="tool"/><joint name="tool" type="continuous">
<parent link="base"/><child link="tool"/><origin xyz="$2" rpy="$3"/><axis xyz="$4"/></joint></robot>
XML
}
write single "1 2 3" "0 0 1.5" "0 0 1"
write double "1  2 3" "0  0 1.5" "0 0 1"
write axis "1 2 3" "0 0 1.5" "0  0 1"
venv/bin/python - <<'PYTHON'
import pathlib
import sys

from urdf_parser_py.urdf import URDF

seen = []
for name in ("single", "double", "axis"):
    joint = URDF.from_xml_string(pathlib.Path(f"{name}.urdf").read_text()).joint_map["tool"]
    seen.append((joint.origin.xyz, joint.origin.rpy, joint.axis))
    print("urdf-parser-py 0.0.4", name, *seen[-1])
sys.exit(seen != [([1, 2, 3], [0, 0, 1.5], [0, 0, 1])] * 3)
PYTHON
cat > read.mjs <<'JAVASCRIPT'
import fs from "fs";
import { REVISION, UrdfModel } from "roslib";

const seen = {};
for (const name of ["single", "double", "axis"]) {
  try {
    const { position, orientation } = new UrdfModel({ string: fs.readFileSync(`${name}.urdf`, "utf8") }).joints.tool.origin;
    seen[name] = `${position.x} ${position.y} ${position.z}, w ${orientation.w.toFixed(3)}`;
  } catch (error) {
    seen[name] = error.name;
  }
}
console.log("roslib", REVISION, seen);
const expected = { single: "1 2 3, w 0.732", double: "0 0 0, w 1.000", axis: "Error" };
process.exit(JSON.stringify(seen) === JSON.stringify(expected) ? 0 : 1);
JAVASCRIPT
node read.mjs
