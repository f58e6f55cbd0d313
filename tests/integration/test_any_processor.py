"""The same seed gives the same trace on processors with and without fused multiplication and wide vectors.

The C library, numpy and numba choose their code by the processor; environment variables limit the choice.
A run compiled by numba for this processor, and one of a wheel's object code as on a processor of 2008, must
write the same bytes.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import rigs.flown_digests

pytestmark = [pytest.mark.integration, pytest.mark.timeout(1200)]

ROOT = Path(__file__).parents[2]
OLD_PROCESSOR = {
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-FMA,-FMA4,-AVX2,-FMA_Usable,-AVX2_Usable",
    "NPY_DISABLE_CPU_FEATURES": "AVX2,FMA3,AVX512F,AVX512CD,AVX512_SKX,AVX512_CLX,AVX512_CNL,AVX512_ICL",
    "OPENBLAS_CORETYPE": "Nehalem",
}
SINES = "import math; print([math.sin(n / 7) for n in range(20_000)])"
FLOWN = Path(rigs.flown_digests.__file__)


def _output(*command: str | Path, **environment: str) -> str:
    done = subprocess.run(
        [sys.executable, "-W", "ignore", *command],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_trace_does_not_depend_on_the_processor() -> None:
    if " fma " in Path("/proc/cpuinfo").read_text():  # else there is one sine only
        assert _output("-c", SINES) != _output("-c", SINES, **OLD_PROCESSOR)
    _output(ROOT / "scripts" / "compile_numerics.py")
    here = _output(FLOWN, "numba", PYTHONHASHSEED="0")
    assert here.count("\n") == 5
    assert _output(FLOWN, PYTHONHASHSEED="1", **OLD_PROCESSOR) == here
