#!/usr/bin/env bash
# pyproj 3.7.2: from the height over the sea to the height over the ellipsoid nothing is added, without a word.
#
# EPSG:5773 is the height over the EGM96 geoid, which lies 48 m above the ellipsoid at 47 N 8 E. The wheel has no geoid grids, and
# where one is missing PROJ takes a "ballpark" that adds zero: 500 m become 500 m, without a warning, even with
# `only_best=True`. `description` tells, and `allow_ballpark=False` raises. On a computer with the grids it is 548 m.
# Seen: 500, "... ballpark vertical transformation ...", only_best 500, allow_ballpark=False ProjError
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q pyproj==3.7.2
"$folder/venv/bin/python" - <<'PYTHON'
import sys

from pyproj import Transformer, network
from pyproj.exceptions import ProjError

network.set_network_enabled(False)
sea, ellipsoid = "EPSG:4326+5773", "EPSG:4979"
usual = Transformer.from_crs(sea, ellipsoid)
height = usual.transform(47, 8, 500)[2]
best = Transformer.from_crs(sea, ellipsoid, only_best=True).transform(47, 8, 500)[2]
try:
    strict = Transformer.from_crs(sea, ellipsoid, allow_ballpark=False)
except ProjError as error:
    strict = error
print(height, "|", usual.description, "|", best, "|", strict)
sys.exit((height, best, type(strict)) != (500, 500, ProjError))
PYTHON
