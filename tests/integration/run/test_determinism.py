"""Same model, same seed: the same trace, byte for byte, whatever computes it and whoever looks."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys

import pytest

from volery import Options, simulate
from volery.trace.events import VehicleState
from volery.trace.reader import OpenTrace

pytestmark = pytest.mark.integration

SEED = 7


def pocket(delivery, out, seed=SEED, show=None):
    return simulate(delivery, Options(fidelity="code", seed=seed, out=out, show=show), scenario="pocket")


def digest(folder):
    return hashlib.sha256((folder / "trace.mcap").read_bytes()).hexdigest()


def places(folder):
    with OpenTrace(folder / "trace.mcap") as reading:
        return [(state.x, state.y, state.z) for state in reading.events({VehicleState})]


@pytest.fixture(scope="module")
def flown(delivery, tmp_path_factory):
    return pocket(delivery, tmp_path_factory.mktemp("first"))


def test_twice_in_one_process_and_with_progress_shown(delivery, flown, tmp_path):
    seen = []
    again = pocket(delivery, tmp_path, show=seen.append)
    assert digest(again.folder) == digest(flown.folder)
    assert len(seen) > 30
    assert (again.folder / "timeline.json").read_bytes() == (flown.folder / "timeline.json").read_bytes()


@pytest.mark.long  # all that is tested runs beside other programs
def test_beside_programs_that_take_all_the_time_they_get(delivery, flown, tmp_path):
    forever = [sys.executable, "-c", "while True: pass"]
    busy = [subprocess.Popen(forever) for _ in range(os.cpu_count() or 1)]
    try:
        again = pocket(delivery, tmp_path)
    finally:
        for process in busy:
            process.kill()
            process.wait()
    assert digest(again.folder) == digest(flown.folder)


def test_what_is_not_kept_is_the_same_run(delivery, flown):
    lost = pocket(delivery, None)
    differing = {"versions", "wall_s", "real_time_factor"}
    assert lost.record.model_dump(exclude=differing) == flown.record.model_dump(exclude=differing)


def test_as_a_command_with_other_hashes(commands, delivery, flown, tmp_path):
    done = commands.run(
        *("simulate", delivery, "--scenario", "pocket", "--seed", SEED, "--quiet", "--out", "out"),
        PYTHONHASHSEED="1",
    )
    assert done.returncode == 0, done.stderr  # every requirement is met there too
    assert digest(tmp_path / "out") == digest(flown.folder)


def test_another_seed_goes_other_ways(delivery, flown, tmp_path):
    other = pocket(delivery, tmp_path, seed=SEED + 1).folder
    here, there = places(flown.folder), places(other)
    assert sum(one != two for one, two in zip(here, there, strict=False)) > len(here) / 4
