"""Same model, same seed: the same trace, byte for byte, whatever computes it and whoever looks."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys

import pytest

from volery import Options, simulate
from volery.trace.events import VehicleState
from volery.trace.reader import Reading

pytestmark = pytest.mark.integration

SEED = 7

NEWER = {
    "PYTHONHASHSEED": "1",
    "NPY_DISABLE_CPU_FEATURES": "AVX512F AVX2 FMA3",
    "OPENBLAS_CORETYPE": "Nehalem",
}
PLAIN = {"PYTHONHASHSEED": "0", "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}


def pocket(delivery, out, seed=SEED, show=None):
    return simulate(delivery, Options(fidelity="code", seed=seed, out=out, show=show), scenario="pocket")


def digest(folder):
    return hashlib.sha256((folder / "trace.mcap").read_bytes()).hexdigest()


def places(folder):
    with Reading(folder / "trace.mcap") as reading:
        return [(state.x, state.y, state.z) for state in reading.events({VehicleState})]


@pytest.fixture(scope="module")
def flown(delivery, tmp_path_factory):
    return pocket(delivery, tmp_path_factory.mktemp("first")).folder


def test_twice_in_one_process_and_with_progress_shown(delivery, flown, tmp_path):
    seen = []
    again = pocket(delivery, tmp_path, show=seen.append)
    assert digest(again.folder) == digest(flown)
    assert len(seen) > 30
    assert (again.folder / "timeline.json").read_bytes() == (flown / "timeline.json").read_bytes()


def test_beside_programs_that_take_all_the_time_they_get(delivery, flown, tmp_path):
    forever = [sys.executable, "-c", "while True: pass"]
    busy = [subprocess.Popen(forever) for _ in range(os.cpu_count() or 1)]
    try:
        again = pocket(delivery, tmp_path)
    finally:
        for process in busy:
            process.kill()
            process.wait()
    assert digest(again.folder) == digest(flown)


def test_what_is_not_kept_is_the_same_run(delivery, tmp_path, flown):
    kept = pocket(delivery, tmp_path)
    lost = pocket(delivery, None)
    differing = {"versions", "wall_s", "real_time_factor"}
    assert lost.record.model_dump(exclude=differing) == kept.record.model_dump(exclude=differing)


@pytest.mark.parametrize("settings", [NEWER, PLAIN], ids=["hash 1, no AVX2", "hash 0, generic"])
def test_on_another_kind_of_processor(commands, delivery, flown, tmp_path, settings):
    cache = {"NUMBA_CACHE_DIR": str(tmp_path / "compiled")} if settings is PLAIN else {}
    done = commands.run(
        *("simulate", delivery, "--scenario", "pocket", "--seed", SEED, "--quiet", "--out", "out"),
        **settings,
        **cache,
    )
    assert done.returncode == 0, done.stderr  # every requirement is met there too
    assert digest(tmp_path / "out") == digest(flown)


def test_another_seed_goes_other_ways(delivery, flown, tmp_path):
    other = pocket(delivery, tmp_path, seed=SEED + 1).folder
    here, there = places(flown), places(other)
    assert sum(one != two for one, two in zip(here, there, strict=False)) > len(here) / 4
