"""``volery control response``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from rigs.flight_log_files import dataflash
from volery.cli.main import application


def run(*arguments: object) -> Any:
    return CliRunner().invoke(application(), ["control", "response", *(str(one) for one in arguments)])


def turn(path: Path, lag: float) -> Path:
    times = np.arange(0.0, 10.0, 0.05)
    yaw = 90.0 * (1.0 - np.exp(-np.maximum(times - 2.0, 0.0) / lag))
    rows = zip(times, np.where(times >= 2.0, 90.0, 0.0), yaw, strict=True)
    return dataflash(path, {"ATT": ("DesYaw,Yaw", rows)})


def test_a_step_is_judged(tmp_path: Path) -> None:
    log = turn(tmp_path / "a.bin", 0.5)
    shown = run(log)
    assert shown.exit_code == 0
    assert "yaw in deg" in shown.stdout
    (found,) = json.loads(run(log, "--json").stdout)
    assert found["steps"][0]["settled_10"] == pytest.approx(1.15, abs=0.06)


def test_several_records_are_compared_and_drawn(tmp_path: Path) -> None:
    fast, slow = turn(tmp_path / "fast.bin", 0.3), turn(tmp_path / "slow.bin", 1.0)
    figure = tmp_path / "figure.png"
    shown = run(fast, slow, "--plot", figure)
    assert shown.exit_code == 0
    assert "fast.bin" in shown.stdout
    assert "slow.bin" in shown.stdout
    assert all(heading in shown.stdout for heading in ("delay", "10 %", "steady", "ITAE"))
    assert max(len(line.rstrip()) for line in shown.stdout.splitlines()) <= 80
    assert "…" not in shown.stdout
    assert figure.read_bytes().startswith(b"\x89PNG")
    named = fast.rename(tmp_path / "a long name of a log.bin")
    assert "1: a long name of a log.bin" in run(named, slow).stdout
    assert run(named, "--plot", tmp_path / "one.svg").exit_code == 0
    assert b"<svg" in (tmp_path / "one.svg").read_bytes()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("nowhere.bin",), "there is no file or folder nowhere.bin"),
        (("LOG", "--signal", "warp"), "no signal 'warp'; it has yaw"),
        (("LOG", "--plot", "figure.bmp"), "a figure is a .png"),
        (("LOG", "--plot", "nowhere/figure.png"), "no folder nowhere"),
        (("LOG", "--goal", "ATT.Yaw"), "state --measured"),
        (("LOG", "--step", "-3"), "above 0"),
        (("EMPTY",), "is empty"),
    ],
)
def test_bad_input_is_named(tmp_path: Path, arguments: tuple[str, ...], said: str) -> None:
    files = {"LOG": turn(tmp_path / "a.bin", 0.5), "EMPTY": tmp_path / "empty.tlog"}
    files["EMPTY"].touch()
    result = run(*(files.get(one, one) for one in arguments))
    assert result.exit_code == 2
    assert said in result.stderr
    assert "Traceback" not in result.stderr


def test_what_is_not_judged_is_listed_with_the_reason(tmp_path: Path) -> None:
    times = np.arange(0.0, 30.0, 0.05)
    pulse = np.where((times >= 5.0) & (times < 6.2), 15.0, 0.0)
    lagging = np.interp(times - 1.0, times, np.where(times >= 20.0, 30.0, pulse * 0.2))
    rows = zip(times, np.where(times >= 20.0, 30.0, pulse), lagging, strict=True)
    events = [(0.0, 10.0), (19.0, 11.0)]
    log = dataflash(tmp_path / "a.bin", {"ATT": ("DesYaw,Yaw", rows), "EV": ("Id", events)})
    shown = " ".join(run(log).stdout.split())
    assert "not judged: yaw at 5.0 s: a pulse: it is held for less than 2 s" in shown
    assert "not judged: yaw at 20.0 s: the vehicle is disarmed" in shown
    (found,) = json.loads(run(log, "--json").stdout)
    assert found["steps"] == []
    assert [one["why"] for one in found["not_judged"]][-1] == "the vehicle is disarmed"


def test_a_record_without_steps_says_so(tmp_path: Path) -> None:
    log = turn(tmp_path / "a.bin", 0.5)
    assert "no step was found" in run(log, "--step", "500").stdout
