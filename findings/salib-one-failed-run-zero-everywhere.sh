#!/usr/bin/env bash
# SALib 1.6.0: one failed run of 384, and no parameter has any influence.
#
# Of Y = a + 2 b the Sobol indices are 0.2 and 0.8. With one of the outputs NaN, as a campaign has it for a run that broke
# off, `sobol.analyze` answers 0 for all first-order and total indices, with confidence intervals of 0: the strongest
# statement that it can make, and a wrong one. It neither raises nor warns; NaN would have said that nothing is known.
# Seen: complete 0.2 0.8; one NaN 0 0, total 0 0, confidence 0 0
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q salib==1.6.0 scipy==1.17.1 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import sys
import warnings

import numpy as np
from SALib.analyze import sobol
from SALib.sample import sobol as sampler

problem = {"num_vars": 2, "names": ["a", "b"], "bounds": [[0, 1], [0, 1]]}
points = sampler.sample(problem, 64, seed=1)
output = points[:, 0] + 2 * points[:, 1]
complete = sobol.analyze(problem, output, seed=1)["S1"].round(1).tolist()
output[5] = np.nan
with warnings.catch_warnings(record=True) as warned:
    warnings.simplefilter("always")
    broken = sobol.analyze(problem, output, seed=1)
seen = [broken[name].tolist() for name in ("S1", "ST", "S1_conf", "ST_conf")]
print(len(points), "runs", complete, "with one NaN", seen, len(warned), "warnings")
sys.exit(complete != [0.2, 0.8] or seen != [[0, 0]] * 4 or bool(warned))
PYTHON
