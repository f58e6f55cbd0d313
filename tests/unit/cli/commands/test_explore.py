"""`volery explore`: the methods of a campaign, what they show, and what is refused before a run."""

import json
from concurrent.futures import Future
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rigs.small_campaigns import COUNT, StubEngine, model  # noqa: F401  # a fixture
from volery.cli.main import application
from volery.explore.points import CampaignRow

ENERGY = "drone_1.energy"
ONE = ("--set", f"{COUNT}=1 .. 9")
TWO = (*ONE, "--set", "platform.processors.pc.frequency=600 MHz .. 1500 MHz")


@pytest.fixture
def explore(model, tmp_path):  # noqa: F811
    def run(*options):
        stated = ("--out", str(tmp_path / "out"), "--on", "stub", "--json")
        return CliRunner().invoke(application(), ["explore", str(model), *stated, *options])

    return run


def found(result):
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def test_a_search_shows_its_front_and_draws_it(explore, tmp_path):
    values = ("--set", f"{COUNT}=3, 4")
    shown = found(explore(*values, "--minimise", ENERGY, "--maximise", "drone_1.distance"))
    front = shown["findings"][0]
    assert front["title"] == "Pareto front"
    assert {"minimise drone_1.energy", "maximise drone_1.distance"} < set(front["rows"][0])
    assert "drone_1.distance against drone_1.energy" in (tmp_path / "out" / "campaign.html").read_text()


def test_seeds_end_when_the_interval_is_narrow(explore):
    shown = found(explore("--seeds", "500", "--until", "drone_1.energy.mean within 2 %"))
    (row,) = shown["findings"][0]["rows"]
    assert shown["variants"][0]["runs"] < 500
    assert row["variant"] == "the model"
    assert row["how sure"].startswith("drone_1.energy.mean: 10")


def test_influences_are_shown_with_intervals(explore, monkeypatch):
    def submit(self, function, /, task, **options):
        future = Future()
        observables = {ENERGY: 10.0 * task.point.values[COUNT]}
        future.set_result(CampaignRow(task.run, task.point, observables=observables))
        return future

    monkeypatch.setattr(StubEngine, "submit", submit)
    first, second = found(explore(*TWO, "--influence", ENERGY))["findings"][0]["rows"]
    assert first == {"parameter": COUNT, "estimate": "80", "95 % interval": "80 to 80"}
    assert second["estimate"] == "0"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--until", "soon"), "soon"),
        (("--until", "counted within 5 %", "--minimise", ENERGY), "one of them at a time"),
        (("--faults", "=5 s"), "write a phase, such as `landing`"),
        (("--faults", "take-off=5 m"), "'5 m' is a length"),
        (("--faults", "all"), "no vehicle was armed"),
        ((*ONE, "--minimise", ENERGY, "--minimise", ENERGY), "one to three different objectives"),
        ((*ONE, "--maximise", "hardware_price"), "hardware_price is minimised in one currency"),
        ((*ONE, "--influence", ENERGY), "compares two parameters"),
        ((*TWO, "--influence", "drone_1.enrgy"), "did you mean 'drone_1.energy'"),
        ((*TWO, "--influence", ENERGY, "--method", "guess"), "there is morris or sobol"),
    ],
)
def test_what_is_wrong_with_a_method_is_refused_by_name(explore, options, said):
    result = explore(*options)
    assert result.exit_code == 2
    assert said in " ".join(result.output.split())


def test_a_space_in_which_nothing_can_work_is_refused_with_the_reasons(tmp_path):
    slow = "platform.processors.onboard_1.frequency, platform.processors.onboard_2.frequency=600 MHz, 800 MHz"
    options = ("--scenario", "pocket", "--fidelity", "times", "--on", "stub", "--out", str(tmp_path / "out"))
    delivery = str(Path(__file__).parents[4] / "examples" / "delivery")
    result = CliRunner().invoke(
        application(), ["explore", delivery, *options, "--set", slow, "--minimise", ENERGY]
    )
    assert result.exit_code == 2
    assert "the analysis discards every variant" in result.output
    assert (
        "landing_1 takes 138.8 ms at least on onboard_1: landing_in_time_1 cannot be met (1)" in result.output
    )


def test_faults_are_tried_in_the_phases_of_the_flight(tmp_path):
    def run(*options):
        command = ["explore", "examples/starter", "--fidelity", "times", "--on", "stub", "--json"]
        return CliRunner().invoke(application(), [*command, "--out", str(tmp_path / "out"), *options])

    rows = found(run("--faults", "hover", "--faults", "late=90 s"))["findings"][0]["rows"]
    assert {"fault": "gps-lost", "of": "drone_1", "hover": "1/1", "late": "1/1"} in rows
    assert (tmp_path / "out" / "undisturbed" / "trace.mcap").exists()
    wrong = run("--faults", "hovr")
    assert wrong.exit_code == 2
    said = " ".join(wrong.output.split())
    assert "did you mean 'hover'" in said
    assert "there is all, arming, cruise, ground contact, hover, landing or take-off" in said
