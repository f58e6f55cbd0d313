#!/usr/bin/env bash
# SALib 1.6.0: a Morris plan for a normally distributed parameter asks for runs at minus infinity.
#
# `dists` names the distribution of each parameter. Morris takes levels of the unit interval, the ends included, and maps them
# through the distribution: a mass of 5 +- 2 kg becomes -inf, 4.1, 5.9 or inf, and about half of the runs are at an infinity.
# The sampler does not say so; the Sobol and Latin samplers keep to finite values for the same problem.
# Seen: half of the values infinite, none of the Latin hypercube
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q salib==1.6.0 scipy==1.17.1 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import sys

import numpy as np
from SALib.sample import latin, morris

problem = {"num_vars": 2, "names": ["wind", "mass"], "bounds": [[0, 10], [5, 2]], "dists": ["unif", "norm"]}
plan = morris.sample(problem, 100, num_levels=4, seed=1)
levels = sorted(set(plan[:, 1].round(1).tolist()))
share = float(np.isinf(plan[:, 1]).mean())
other = bool(np.isinf(latin.sample(problem, 300, seed=1)).any())
print("masses", levels, "infinite", round(share, 2), "Latin infinite", other)
sys.exit(levels != [-np.inf, 4.1, 5.9, np.inf] or not 0.3 < share < 0.7 or other)
PYTHON
