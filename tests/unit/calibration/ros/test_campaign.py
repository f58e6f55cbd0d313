from pathlib import Path
from typing import Any

import pytest

from volery.base.errors import UsageError
from volery.calibration.ros.campaign import CampaignLog, Conditions, RoundPlan, RoundProgress, run_campaign
from volery.calibration.ros.probe_environment import Pace

from .ros_rounds import Probe

HERE = Conditions("roscpp", "a processor", 2600.0)


class Stage:
    """Probes that need no ROS. Breaks off after so many rounds, as Ctrl-C does."""

    def __init__(self, noise: float = 0.0, breaks_after: int | None = None) -> None:
        self.noise, self.breaks_after = noise, breaks_after
        self.paces: list[Pace] = []

    def probe(self, pace: Pace) -> Any:
        if len(self.paces) == self.breaks_after:
            raise KeyboardInterrupt
        self.paces.append(pace)
        return Probe(len(self.paces), self.noise).round(pace.counts)


def pursued(stage: Stage, plan: RoundPlan, notebook: CampaignLog) -> list[RoundProgress]:
    shown: list[RoundProgress] = []
    run_campaign(stage, plan, notebook, shown.append)  # type: ignore[arg-type]
    return shown


def test_a_campaign_stops_when_all_figures_are_precise(tmp_path: Path) -> None:
    notebook = CampaignLog(tmp_path / "rounds", HERE)
    shown = pursued(Stage(), RoundPlan(least=4, most=9), notebook)
    assert len(notebook.rounds) == 4
    assert [one.rounds for one in shown] == [0, 1, 2, 3, 4]
    assert shown[-1].loose == ()


def test_a_campaign_ends_after_the_most_rounds_and_names_uncertain_figures(tmp_path: Path) -> None:
    notebook = CampaignLog(tmp_path / "rounds", HERE)
    shown = pursued(Stage(noise=0.5), RoundPlan(least=3, most=5, within=0.01), notebook)
    assert len(notebook.rounds) == 5
    assert "publish" in {cost.call for cost in shown[-1].loose}


def test_rounds_of_an_interrupted_campaign_are_kept(tmp_path: Path) -> None:
    file = tmp_path / "deeper" / "rounds"
    with pytest.raises(KeyboardInterrupt):
        pursued(Stage(breaks_after=2), RoundPlan(least=4), CampaignLog(file, HERE))
    again = CampaignLog(file, HERE)
    assert len(again.rounds) == 2
    stage = Stage()
    pursued(stage, RoundPlan(least=4), again)
    assert len(stage.paces) == 2
    assert CampaignLog(file, HERE).rounds == again.rounds
    again.forget()
    assert not file.exists()


def test_an_incomplete_line_is_dropped(tmp_path: Path) -> None:
    file = tmp_path / "rounds"
    pursued(Stage(), RoundPlan(least=3), CampaignLog(file, HERE))
    file.write_text(file.read_text()[:-20])
    assert len(CampaignLog(file, HERE).rounds) == 2


def test_rounds_of_another_machine_do_not_mix(tmp_path: Path) -> None:
    CampaignLog(tmp_path / "rounds", HERE)
    with pytest.raises(UsageError, match=r"2600.*not of.*1300.*remove it or move it away"):
        CampaignLog(tmp_path / "rounds", Conditions("roscpp", "a processor", 1300.0))
    (tmp_path / "other").write_text("a letter\n")
    with pytest.raises(UsageError, match="no rounds of a campaign"):
        CampaignLog(tmp_path / "other", HERE)


def test_each_round_measures_the_ends_and_others_in_turn() -> None:
    plan = RoundPlan(pace=Pace(counts=(1, 2, 3, 4, 5, 6, 7, 8)))
    chosen = [plan.pace_of(number).counts for number in range(12)]
    assert all({1, 8} < set(counts) for counts in chosen)
    assert set().union(*chosen) == set(range(1, 9))
    assert len({counts[0] for counts in chosen}) > 2  # in an order that is drawn
    assert plan.pace_of(3) == plan.pace_of(3)
