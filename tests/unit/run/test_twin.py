"""A twin of a vehicle and of a record, and the cube of goals on a velocity-level vehicle."""

from __future__ import annotations

from pathlib import Path

import pytest

from volery.base.errors import UsageError
from volery.control.log_signals import read_signals
from volery.control.step_response import step_responses
from volery.run.result import Options
from volery.run.twin import follow_record, follow_vehicle
from volery.run.velocity_cube import fly_cube

ROOT = Path(__file__).parents[3]


def test_a_twin_follows_a_vehicle_that_flies_a_mission(tmp_path: Path) -> None:
    """Cold, the twin is ready half a minute later: the mission begins when it is in the air."""
    mission = ROOT / "examples" / "mission.py"
    run, errors, judged = follow_vehicle("sim:px4", "sim:ardupilot", Options(out=tmp_path / "run"), mission)
    assert run.error is None
    found = {one.quantity.split()[-1]: one for one in errors}
    assert found["horizontal"].rms < 1.0
    assert found["altitude"].rms < 1.0
    figures = (found["horizontal"].rms, found["altitude"].rms, found["yaw"].rms)
    row = "live, both from a cold start | {:.2f} m | {:.2f} m | {:.1f}° |".format(*figures)
    assert row in (ROOT / "docs" / "control.md").read_text(encoding="utf-8")
    assert "0.0 m from its reference, and the first 5 s are not included" in judged


def test_a_record_without_a_flight_is_no_reference(tmp_path: Path) -> None:
    fly_cube(tmp_path / "cube")
    with pytest.raises(UsageError, match="has no north"):
        follow_record(tmp_path / "cube", "sim:ardupilot", Options())


def test_the_loops_of_the_cube_can_be_judged(tmp_path: Path) -> None:
    reached = fly_cube(tmp_path)
    assert len(reached) == 11
    (z,) = (one for one in read_signals(tmp_path) if one.name == "z")
    assert [round(one.size, 1) for one in step_responses(z)] == pytest.approx([1.0, 2.0], abs=0.1)


def test_a_missing_mission_of_the_leader_is_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="nowhere"):
        follow_vehicle("sim:px4", "sim:ardupilot", Options(), tmp_path / "nowhere.py")
