"""A program: fly a mission on each autopilot and a delivery, print a digest of each trace.

    python tests/rigs/flown_digests.py [numba]

Run on two processors, by two versions of Python, from object code or compiled by numba: it prints the same.
"""

import hashlib
import sys
import tempfile
from pathlib import Path

import volery
from volery.base import numeric_code

EXAMPLES = Path(__file__).parents[2] / "examples"
AUTOPILOTS = ("ardupilot", "px4", "paparazzi", "dji")


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        if "numba" in sys.argv:
            numeric_code.OBJECT_CODE = out / "none"
        for autopilot in AUTOPILOTS:
            options = volery.Options(seed=1, out=out / autopilot)
            assert volery.fly(EXAMPLES / "mission.py", f"sim:{autopilot}", options).completed
        options = volery.Options(fidelity="code", seed=7, out=out / "delivery")
        assert volery.simulate(EXAMPLES / "delivery", options, scenario="pocket").ok
        for name in (*AUTOPILOTS, "delivery"):
            digest = hashlib.sha256((out / name / "trace.mcap").read_bytes()).hexdigest()
            sys.stdout.write(f"{name} {digest}\n")


if __name__ == "__main__":
    main()
