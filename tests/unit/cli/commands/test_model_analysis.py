"""``volery model analyse`` on the delivery example and on a model whose deadline is not guaranteed."""

from __future__ import annotations

import json
from pathlib import Path

from typer.testing import CliRunner

from volery.cli.main import application

DELIVERY = Path(__file__).parents[4] / "examples" / "delivery"

LATE = """
volery: 1
name: late
components:
  Loop: {language: python, at: {processor: rpi4-cortex-a72, frequency: 1500 MHz}, active: {period: 7 ms},
         activation: {time: 4 ms}}
application:
  a: {is: Loop, active: {period: 7 ms, priority: 3}}
  b: {is: Loop, active: {period: 12 ms, deadline: 6 ms, priority: 2}}
platform:
  processors: {pc: {is: rpi4-cortex-a72, frequency: 1500 MHz, cores: 1}}
allocations: {only: {a: pc, b: pc}}
"""


def analyse(*arguments):
    return CliRunner().invoke(application(), ["model", "analyse", *map(str, arguments)])


def test_what_the_model_leaves_open_is_named():
    done = analyse(DELIVERY, "--json")
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    flows = {one["subject"]: one for bounds in found["responses"].values() for one in bounds}
    assert [name for name, one in flows.items() if one["bound"] is None] == ["central"]
    assert flows["landing_1"]["bound"] < 100e6
    assert "at a rate that is not in the model" in flows["central"]["why"]
    assert [one["vehicle"] for one in found["budgets"]["endurance"] if one["feasible"]] == [
        "drone_1",
        "drone_2",
    ]
    unstated = analyse(DELIVERY, "--set", "components.RoverControl.assume={}")
    assert "it commands a vehicle" in unstated.stdout


def test_a_deadline_that_is_not_guaranteed_is_a_failure(tmp_path):
    (tmp_path / "model.yaml").write_text(LATE)
    done = analyse(tmp_path)
    assert done.exit_code == 1
    assert "b: the deadline of 6.000 ms is not guaranteed: 12.000 ms" in done.stderr


def test_a_folder_without_a_run_is_an_error(tmp_path):
    done = analyse(DELIVERY, "--run", tmp_path)
    assert done.exit_code == 2
    assert "cannot read" in done.stderr
