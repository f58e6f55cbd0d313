#!/usr/bin/env bash
# pypcd4 1.5.1: saved as ASCII, every coloured point is black.
#
# A PCD colour is packed into the bits of a float, which makes numbers like 2.3e-38. `save` in `Encoding.ASCII` writes floats
# with ten decimals, so the text is 0.0000000000 for every colour; both binary encodings keep them. Coordinates and times of
# day survive the ten decimals: only the colours show it.
# Seen: BINARY [255 128 7], ASCII [0 0 0]
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q pypcd4==1.5.1 numpy==2.4.6
"$folder/venv/bin/python" - "$folder" <<'PYTHON'
import pathlib
import sys

import numpy as np
from pypcd4 import Encoding, PointCloud

colour = PointCloud.encode_rgb(np.array([[255, 128, 7]], dtype=np.uint8))
cloud = PointCloud.from_xyzrgb_points(np.column_stack([np.array([[1, 2, 3]], dtype=np.float32), colour]))
seen = {}
for encoding in (Encoding.BINARY, Encoding.BINARY_COMPRESSED, Encoding.ASCII):
    file = pathlib.Path(sys.argv[1], "cloud.pcd")
    cloud.save(file, encoding=encoding)
    seen[encoding.name] = PointCloud.decode_rgb(PointCloud.from_path(file).pc_data["rgb"])[0].tolist()
print(seen, file.read_text().splitlines()[-1])
sys.exit(seen != {"BINARY": [255, 128, 7], "BINARY_COMPRESSED": [255, 128, 7], "ASCII": [0, 0, 0]})
PYTHON
