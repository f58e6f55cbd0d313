#!/usr/bin/env bash
# @loaders.gl/pcd 4.4.2: the red points of a PCD file are blue.
#
# PCL packs a colour as 0x00RRGGBB into the bits of a float, so that its bytes lie as blue, green, red on the usual computers.
# The loader hands them out in that order as `COLOR_0`, which is red, green, blue. pypcd4, which writes the binary files here,
# reads (255, 128, 7). Grey points look right, which is why it lasts.
# Seen: ascii, binary and binary_compressed 7,128,255
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q pypcd4==1.5.1 numpy==2.4.6
npm install --silent --no-audit --no-fund @loaders.gl/core@4.4.2 @loaders.gl/pcd@4.4.2 @math.gl/types@4.1.0
venv/bin/python - <<'PYTHON'
import numpy as np
from pypcd4 import Encoding, PointCloud

colour = PointCloud.encode_rgb(np.array([[255, 128, 7]], dtype=np.uint8))
cloud = PointCloud.from_xyzrgb_points(np.column_stack([np.array([[1, 2, 3]], dtype=np.float32), colour]))
for name in ("BINARY", "BINARY_COMPRESSED"):
    cloud.save(f"{name.lower()}.pcd", encoding=Encoding[name])
    print(name, PointCloud.decode_rgb(PointCloud.from_path(f"{name.lower()}.pcd").pc_data["rgb"]))
with open("binary.pcd", "rb") as file:
    head = file.read().split(b"DATA")[0].decode()
with open("ascii.pcd", "w") as file:
    file.write(f"{head}DATA ascii\n1 2 3 {float(colour.ravel()[0])!r}\n")
PYTHON
cat > read.mjs <<'JAVASCRIPT'
import fs from "fs";
import { PCDLoader } from "@loaders.gl/pcd";

const seen = {};
for (const name of ["ascii", "binary", "binary_compressed"]) {
  const bytes = fs.readFileSync(`${name}.pcd`);
  const read = await PCDLoader.parse(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length), {});
  seen[name] = Array.from(read.attributes.COLOR_0.value).join();
}
console.log(seen);
const expected = { ascii: "7,128,255", binary: "7,128,255", binary_compressed: "7,128,255" };
process.exit(JSON.stringify(seen) === JSON.stringify(expected) ? 0 : 1);
JAVASCRIPT
node read.mjs
