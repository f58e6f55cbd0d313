#!/usr/bin/env bash
# geotiff 3.0.5 (npm), rasterio 1.4.4: the box of one height map lies half a cell further south-east for the one.
#
# A GeoTIFF tells by `GTRasterTypeGeoKey` whether its tie point is the corner of the first cell (PixelIsArea) or the place of the first
# sample, its middle (PixelIsPoint, usual for heights). rasterio (GDAL) writes and reads the same map in both ways and
# answers one box. `getBoundingBox` of geotiff takes the tie point as a corner in either case, though its `pixelIsArea` knows: six cells
# from the first sample on, which is neither the box of the samples (five steps) nor that of the cells. With 30 m cells
# each height is 15 m off in both directions.
# Seen: rasterio 8.000 46.994 8.006 47.000 for both; geotiff the same for Area, 8.0005 46.9935 8.0065 46.9995 for Point
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q rasterio==1.4.4 numpy==2.4.6
npm install --silent --no-audit --no-fund geotiff@3.0.5
venv/bin/python - <<'PYTHON'
import sys

import numpy as np
import rasterio
from rasterio.transform import from_origin

heights = np.arange(36, dtype=np.int16).reshape(6, 6)
grid = from_origin(8, 47, 0.001, 0.001)
boxes = []
for kind in ("Area", "Point"):
    with rasterio.open(
        f"{kind}.tif", "w", driver="GTiff", height=6, width=6, count=1, dtype="int16", crs="EPSG:4326", transform=grid
    ) as file:
        file.update_tags(AREA_OR_POINT=kind)
        file.write(heights, 1)
    with rasterio.open(f"{kind}.tif") as file:
        boxes.append([round(each, 6) for each in file.bounds])
        print("rasterio", rasterio.__version__, file.tags(), boxes[-1])
sys.exit(boxes != [[8, 46.994, 8.006, 47]] * 2)
PYTHON
cat > read.mjs <<'JAVASCRIPT'
import { fromFile } from "geotiff";

const seen = {};
for (const kind of ["Area", "Point"]) {
  const image = await (await fromFile(`${kind}.tif`)).getImage();
  seen[kind] = [image.pixelIsArea(), ...image.getBoundingBox().map((each) => Number(each.toFixed(6)))].join(" ");
}
console.log("geotiff 3.0.5", seen);
const expected = { Area: "true 8 46.994 8.006 47", Point: "false 8.0005 46.9935 8.0065 46.9995" };
process.exit(JSON.stringify(seen) === JSON.stringify(expected) ? 0 : 1);
JAVASCRIPT
node read.mjs
