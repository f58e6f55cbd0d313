"""``volery vehicle params``, ``mission``, ``logs``, ``files`` on a simulated autopilot, as a user calls."""

from __future__ import annotations

import json
from pathlib import Path

from typer.testing import CliRunner, Result

from volery.cli.main import application


def volery(*words: object) -> Result:
    return CliRunner().invoke(application(), [str(word) for word in words])


def test_parameters_are_saved_compared_and_set(tmp_path: Path) -> None:
    file = tmp_path / "all.params"
    assert volery("vehicle", "params", "save", "sim:px4", file).exit_code == 0
    assert volery("vehicle", "params", "diff", "sim:px4", file).exit_code == 0
    file.write_text("LND_FLIGHT_T_LO 5\n", encoding="utf-8")
    counted = volery("vehicle", "params", "diff", "sim:px4", file)
    assert (counted.exit_code, "left alone: LND_FLIGHT_T_LO" in counted.output) == (0, True)
    file.write_text("MPC_XY_CRUISE 3.5\n", encoding="utf-8")
    found = volery("vehicle", "params", "diff", "sim:px4", file, "--json")
    assert found.exit_code == 1
    assert json.loads(found.stdout)[0]["there"] == 3.5
    assert "1 parameters were set" in volery("vehicle", "params", "load", "sim:px4", file).output
    assert json.loads(
        volery("vehicle", "params", "get", "sim:px4", "MPC_XY_CRUISE", "--json").stdout
    ).keys() == {"MPC_XY_CRUISE"}
    assert "-> 4" in volery("vehicle", "params", "set", "sim:px4", "MPC_XY_CRUISE", "4").output


def test_mistakes_are_answered_in_one_line(tmp_path: Path) -> None:
    for words, said in (
        (
            ("vehicle", "params", "get", "sim:dji", "X"),
            "an ArduPilot or PX4 offers it, over MAVLink or MAVROS",
        ),
        (("vehicle", "params", "get", "sim:px4", "NO_SUCH"), "has no parameter NO_SUCH"),
        (("vehicle", "params", "get", "sim:px4", "--kind", "plane"), "--kind plane: give drone or rover"),
        (("vehicle", "mission", "upload", "sim:px4", tmp_path / "no.plan"), "there is no such file"),
        (
            ("vehicle", "mission", "download", "sim:px4", tmp_path / "a.plan", "--only", "fences"),
            "no part 'fences'",
        ),
        (("vehicle", "logs", "sim:ardupilot", "--get", "7"), "--get 7: there is no such log"),
        (("vehicle", "files", "sim:ardupilot", "/none"), "list /none: there is no such file or folder"),
        (
            ("vehicle", "files", "sim:px4", "/log", "--out", tmp_path / "x"),
            "open /log: there is no such file or folder",
        ),
        (
            ("vehicle", "files", "sim:paparazzi"),
            "files on board: not with this driver; an ArduPilot or PX4 offers them",
        ),
    ):
        result = volery(*words)
        assert result.exit_code != 0
        assert said in " ".join(result.output.split())
        assert "Traceback" not in result.output


def test_a_plan_and_the_logs(tmp_path: Path) -> None:
    file = tmp_path / "empty.plan"
    assert volery("vehicle", "mission", "download", "sim:ardupilot", file).exit_code == 0
    assert json.loads(file.read_text(encoding="utf-8"))["fileType"] == "Plan"
    assert "0 mission items" in volery("vehicle", "mission", "upload", "sim:ardupilot", file).output
    assert volery("vehicle", "logs", "sim:ardupilot", "--json").exit_code == 0


def test_files_are_listed_and_downloaded(tmp_path: Path) -> None:
    assert volery("vehicle", "files", "sim:ardupilot").output.strip() == "/ is empty"
    packed = tmp_path / "param.pck"
    assert volery("vehicle", "files", "sim:ardupilot", "@PARAM/param.pck", "--out", packed).exit_code == 0
    assert packed.read_bytes()[:2] == b"\x1b\x67"  # the magic number of ArduPilot's packed parameters
    again = volery("vehicle", "files", "sim:ardupilot", "@PARAM/param.pck", "--out", packed)
    assert "exists; choose another name" in again.output
