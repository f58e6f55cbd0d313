from __future__ import annotations

import bz2
import gzip
import lzma
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from rigs.floor_plans import OFFICE, ranges
from volery.autonomy.laser_logs import read_laser_log
from volery.autonomy.planar_pose import Pose2
from volery.base.errors import UsageError

HALF = np.radians(np.arange(-90.0, 90.0))
SEEN = ranges(OFFICE, Pose2(2.0, 3.0, 0.0), HALF, 30.0)


def row(time: float, count: int = 180) -> str:
    return ",".join(map(str, (time, 1.0, 2.0, 0.5, *SEEN[:count].round(2))))


def flaser(time: float) -> str:
    words = [
        "FLASER",
        "180",
        *map(str, SEEN.round(2)),
        "9",
        "9",
        "9",
        "1",
        "2",
        "0.5",
        str(time),
        "host",
        "0.1",
    ]
    return " ".join(words)


def robotlaser(time: float) -> str:
    head = ["ROBOTLASER1", "0", "-1.5707963", "3.1415927", "0.0174533", "30", "0.01", "0", "180"]
    rest = ["0", "1.3", "2", "0.5", "1", "2", "0.5", "0", "0", "1", "0.5", "0", str(time), "host", "0.1"]
    return " ".join([*head, *map(str, SEEN.round(2)), *rest])


def test_a_table_of_ranges(tmp_path: Path) -> None:
    file = tmp_path / "scans.csv"
    file.write_text(f"# time, odometry, ranges\n{row(3.25)}\n{row(4.5)}\n")
    log = read_laser_log(file)
    first, second = log.steps
    assert (first.scan.time, second.scan.time) == (3_250_000_000, 4_500_000_000)
    assert first.odometry == (1.0, 2.0, 0.5)
    assert first.scan.points[0] == pytest.approx((0.0, -3.0), abs=0.01)
    assert len(first.scan.points) == 180
    assert not log.damage


def test_logs_of_carmen_in_both_forms(tmp_path: Path) -> None:
    file = tmp_path / "lab.log"
    file.write_text(
        f"PARAM robot_width 0.5\nODOM 1 2 0.5 0 0 0 1.0 host 1.0\n{flaser(1.0)}\n{robotlaser(2.0)}\n"
    )
    old, new = read_laser_log(file).steps
    assert (old.scan.time, new.scan.time) == (1_000_000_000, 2_000_000_000)
    assert old.odometry == new.odometry == (1.0, 2.0, 0.5)
    forward = np.cos(0.5) * 0.3, -np.sin(0.5) * 0.3
    assert new.scan.points[0] - old.scan.points[0] == pytest.approx(forward, abs=1e-3)


def rawlaser(time: float) -> str:
    head = ["RAWLASER1", "0", "-1.5707963", "3.1415927", "0.0174533", "81.9", "0.01", "0", "180"]
    return " ".join([*head, *map(str, SEEN.round(2)), "0", str(time), "host", "0.1"])


def odom(time: float, x: float) -> str:
    return f"ODOM {x} 2 0.5 0.1 0 0 {time} host {time}"


def test_raw_scans_get_the_odometry_between_its_lines(tmp_path: Path) -> None:
    file = tmp_path / "lab.clf"
    file.write_text("\n".join((odom(1.0, 1.0), rawlaser(1.5), odom(2.0, 2.0), rawlaser(9.0))))
    first, last = read_laser_log(file).steps
    assert first.odometry == pytest.approx((1.5, 2.0, 0.5))
    assert last.odometry == pytest.approx((2.0, 2.0, 0.5)), "the nearest at its ends"
    assert len(first.scan.points) == 180
    file.write_text(rawlaser(1.5))
    assert [step.odometry for step in read_laser_log(file).steps] == [None]
    file.write_text("\n".join((rawlaser(1.0), flaser(1.0))))
    assert len(list(read_laser_log(file).steps)) == 1, "the same scan without and with odometry"


@pytest.mark.parametrize(("pack", "suffix"), [(gzip, "gz"), (bz2, "bz2"), (lzma, "xz")])
def test_packed_logs_also_when_they_end_early(tmp_path: Path, pack: ModuleType, suffix: str) -> None:
    noise = np.random.default_rng(1).random((200, 300))
    lines = (f"{flaser(time)}\n# {numbers.tolist()}\n" for time, numbers in enumerate(noise))
    whole = pack.compress("".join(lines).encode())
    file = tmp_path / f"lab.log.{suffix}"
    file.write_bytes(whole)
    log = read_laser_log(file)
    assert (len(list(log.steps)), log.damage) == (200, [])
    file.write_bytes(whole[: len(whole) // 2])
    log = read_laser_log(file)
    try:
        assert len(list(log.steps)) < 200
    except UsageError:
        assert suffix != "gz", "those of blocks may lose all"
    assert any("cannot be unpacked" in words for words in log.damage)


def test_a_range_that_is_largest_again_and_again_met_nothing(tmp_path: Path) -> None:
    seen = SEEN.copy()
    seen[:20] = 32.76
    words = ["FLASER", "180", *map(str, seen), *flaser(1.0).split()[182:]]
    file = tmp_path / "lab.log"
    file.write_text(" ".join(words))
    (step,) = read_laser_log(file).steps
    assert len(step.scan.points) == 160
    assert not len(step.scan.open_ends), "it may have met glass"


def test_stamps_and_numbers_that_cannot_be(tmp_path: Path) -> None:
    file = tmp_path / "lab.log"
    bad = flaser(3.0).replace(" 1 2 0.5 ", " 1 nan 0.5 ")
    file.write_text("\n".join((flaser(-0.5), flaser(4294967295.5), flaser(0.2), bad, flaser(float("nan")))))
    log = read_laser_log(file)
    assert [step.scan.time / 1e9 for step in log.steps] == pytest.approx([-0.5, 4294967295.5, 0.2])
    assert log.damage == [
        "2 lines that are no whole scan are left out",
        "1 scans are older than the one before; they are taken in the order of the file",
    ]


def test_lines_that_are_no_scan_are_counted(tmp_path: Path) -> None:
    file = tmp_path / "scans.csv"
    file.write_text(f"{row(1.0)}\n1,2,3\n{row(2.0)[:300]}x\nnan,{row(3.0)[4:]}\n{row(4.0)}\n")
    log = read_laser_log(file)
    assert len(list(log.steps)) == 2
    assert log.damage == ["3 lines that are no whole scan are left out"]


def test_a_row_that_was_cut_is_no_scan_of_fewer_beams(tmp_path: Path) -> None:
    file = tmp_path / "scans.csv"
    file.write_text(f"{row(1.0)[:300].rpartition(',')[0]}\n{row(2.0)}\n{row(3.0)}\n")
    log = read_laser_log(file)
    assert [step.scan.time for step in log.steps] == [2_000_000_000, 3_000_000_000]
    assert log.damage == ["1 lines that are no whole scan are left out"]


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("x.csv", b"a,b,c\n", "at least 10 ranges"),
        ("x.log", b"hello\n", "FLASER"),
        ("x.csv", b"\0\1\2", "neither text nor a bag"),
    ],
)
def test_files_without_scans_are_refused(tmp_path: Path, name: str, content: bytes, words: str) -> None:
    file = tmp_path / name
    file.write_bytes(content)
    with pytest.raises(UsageError, match=words):
        list(read_laser_log(file).steps)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no such file"):
        read_laser_log(tmp_path / "none.csv")
