"""The same seed gives the same bytes whatever features numba and numpy find, and whatever the hashes."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = Path(__file__).with_name("flown_bytes.py")
PLAIN = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
OLD = {
    "NPY_DISABLE_CPU_FEATURES": "AVX512F AVX2 FMA3",
    "OPENBLAS_CORETYPE": "Nehalem",
    "PYTHONHASHSEED": "1",
}


def flown(**settings):
    environment = {**os.environ, "PYTHONHASHSEED": "0", **settings}
    run = subprocess.run(
        [sys.executable, str(PROGRAM)],
        env=environment,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    return run.stdout.strip()


@pytest.mark.integration
def test_a_flight_is_the_same_to_the_byte_on_every_processor():
    here = flown()
    assert len(here) == 64
    assert flown(**OLD) == here
    assert flown(**PLAIN) == here
