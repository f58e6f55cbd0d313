#!/usr/bin/env bash
# filterpy 2.0.0: a missing measurement leaves a log-likelihood as if it had been met exactly.
#
# `update(None)` is the way to say that a sensor was silent. It sets the residual to zero and keeps the innovation
# covariance of the update before, and `log_likelihood` answers of these: -1.81 here, the best value that a measurement
# could have had. A sum over the flight, by which filters are compared and tuned, counts each gap as a perfect hit.
# Seen: measured -3.90, missing -1.81, a perfect hit of that covariance -1.81
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q filterpy==2.0.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import math
import sys

import numpy as np
from filterpy.kalman import KalmanFilter

kalman = KalmanFilter(dim_x=1, dim_z=1)
kalman.F = kalman.H = kalman.Q = kalman.R = np.eye(1)
kalman.P = 4 * np.eye(1)
kalman.predict()
kalman.update(5.0)
measured, spread = float(kalman.log_likelihood), float(kalman.S[0, 0])
kalman.predict()
kalman.update(None)
seen = [round(value, 2) for value in (measured, float(kalman.log_likelihood), -0.5 * math.log(2 * math.pi * spread))]
print(seen)
sys.exit(seen != [-3.90, -1.81, -1.81])
PYTHON
