#!/usr/bin/env bash
# NavPy 1.0: a place on the equator has no latitude, and the North Pole lies 6400 km under the ground.
#
# `ecef2lla` iterates with a division by z and by the cosine of the latitude. At z = 0, the whole equator, the latitude is NaN
# (NumPy's warning about an invalid value is all one gets); at the pole the height of 100 m comes out as -6399593.6 m. Its
# inverse, `lla2ecef`, made both inputs.
# Seen: equator (nan, 8.0, ...), pole (90.0, 0.0, -6399593.6)
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q navpy==1.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import math
import sys
import warnings

import navpy
import numpy as np

warnings.simplefilter("ignore", RuntimeWarning)
equator = navpy.ecef2lla(navpy.lla2ecef(0, 8, 100))
pole = navpy.ecef2lla(np.array([0.0, 0.0, 6356752.314245 + 100]))
print("equator", *equator, "pole", *pole)
sys.exit(not math.isnan(equator[0]) or round(float(pole[2]), 1) != -6399593.6)
PYTHON
