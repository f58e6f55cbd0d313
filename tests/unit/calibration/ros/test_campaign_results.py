from dataclasses import replace
from pathlib import Path

import pytest

from volery.base.errors import EstimateError, ModelError
from volery.base.warmth import Warmth
from volery.calibration.host_machine import Machine
from volery.calibration.ros.call_costs import call_costs
from volery.calibration.ros.campaign import Conditions, format_line, plot_svg, ros_law, write_entry
from volery.cost import RosLaw, Tariff, load_catalogue

from .ros_rounds import AGAIN, PER_SUBSCRIBER, PER_US, PUBLISH, RECEIVE, RECEIVE_NEXT, SLEEP, WARMER, Probe

MACHINE = Machine("my-computer", "A Processor of Mine", 2, 2600.0)


def law(client: str = "roscpp", mhz: float = 2600.0, spins: bool = True) -> RosLaw:
    rounds = [Probe(spins=spins).round() for _ in range(3)]
    return ros_law(call_costs(rounds), Conditions(client, MACHINE.description, mhz))


def test_an_entry_prices_as_was_measured(tmp_path: Path) -> None:
    file = tmp_path / "deeper" / "catalogue.yaml"
    write_entry(file, MACHINE, law())
    entry = load_catalogue(file).processor("my-computer")
    assert (entry.cores, entry.least_mhz, entry.greatest_mhz) == (2, 2600, 2600)
    prices = Tariff(entry.ros_law("roscpp"), 2600)
    publish = prices("publish", 3)
    assert publish.caller + publish.background == pytest.approx(PUBLISH + 3 * PER_SUBSCRIBER, rel=1e-3)
    assert publish.caller == pytest.approx((PUBLISH + 3 * PER_SUBSCRIBER) / 2, rel=1e-3)
    again = prices("publish", 3, Warmth(follows=True))
    assert again.caller + again.background == pytest.approx(AGAIN + 3 * PER_SUBSCRIBER, rel=1e-3)
    sleep = prices("sleep", 100_000)
    assert (sleep.caller, sleep.background) == (0, pytest.approx(SLEEP + PER_US * 100_000, rel=1e-3))
    assert prices("receive").background == pytest.approx(RECEIVE, rel=1e-3)
    assert publish.flags == ()


def test_rounds_of_one_period_price_all_publications() -> None:
    for period_us in (20_000.0, 50_000.0):
        rounds = [Probe(period_us=period_us).round() for _ in range(3)]
        prices = Tariff(ros_law(call_costs(rounds), Conditions("rospy", MACHINE.description, 2600.0)), 2600)
        for follows in (False, True):
            assert prices("publish", 3, Warmth(follows)) == prices("publish", 3, Warmth(follows, often=True))


def test_it_holds_at_its_frequency_only(tmp_path: Path) -> None:
    write_entry(tmp_path / "one.yaml", MACHINE, law())
    entry = load_catalogue(tmp_path / "one.yaml").processor("my-computer")
    with pytest.raises(EstimateError, match="1300 MHz is outside"):
        entry.check_frequency(1300)


def test_a_second_frequency_makes_lines_of_points(tmp_path: Path) -> None:
    file = tmp_path / "two.yaml"
    write_entry(file, MACHINE, law())
    slower = law(mhz=1300.0)
    doubled = {
        call: one.model_copy(update={"constant": one.constant.model_copy(update={"offset": 2e5})})
        for call, one in slower.calls.items()
        if one.constant is not None
    }
    made = write_entry(
        file, replace(MACHINE, frequency_mhz=1300.0), slower.model_copy(update={"calls": doubled})
    )
    assert (made.least_mhz, made.greatest_mhz) == (1300, 2600)
    entry = load_catalogue(file).processor("my-computer")
    assert (entry.least_mhz, entry.greatest_mhz) == (1300, 2600)
    halfway = Tariff(entry.ros_law("roscpp"), 1950)("receive", 0)
    assert halfway.background == pytest.approx((2e5 + RECEIVE) / 2, rel=1e-3)
    assert "1300 to 2600 MHz" in entry.ros["roscpp"].validity


def test_callbacks_of_rospy_are_priced_where_their_message_arrives(tmp_path: Path) -> None:
    write_entry(tmp_path / "all.yaml", MACHINE, law("rospy", spins=False))
    prices = Tariff(load_catalogue(tmp_path / "all.yaml").processor("my-computer").ros_law("rospy"), 2600)
    assert prices("spin_once", 1.0)[:2] == prices("spin_once", 0.0)[:2] == (0, 0)
    assert prices("receive").background == pytest.approx(RECEIVE, rel=1e-3)
    assert prices("receive", 0.0, Warmth(follows=True, often=True)).background == pytest.approx(
        WARMER * RECEIVE_NEXT, rel=1e-3
    )


def test_other_entries_of_the_file_are_kept(tmp_path: Path) -> None:
    file = tmp_path / "all.yaml"
    write_entry(file, MACHINE, law("roscpp"))
    file.write_text("# mine\n" + file.read_text())
    write_entry(file, MACHINE, law("rospy", spins=False))
    assert file.read_text().startswith("# mine\n")
    assert sorted(load_catalogue(file).processor("my-computer").ros) == ["roscpp", "rospy"]


def test_a_file_that_is_no_catalogue_is_not_touched(tmp_path: Path) -> None:
    file = tmp_path / "letter.yaml"
    file.write_text("dear: reader\n")
    with pytest.raises(ModelError, match=r"letter\.yaml"):
        write_entry(file, MACHINE, law())
    assert file.read_text() == "dear: reader\n"


def test_formatted_costs_and_plot() -> None:
    found = call_costs([Probe().round() for _ in range(3)])
    assert format_line(found["publish"].whole, "publish") == "75.0 + 18.0 n"
    assert format_line(found["sleep"].whole, "sleep") == "14.0 + 1.050 ms"
    assert format_line(found["wait"].whole, "wait") == "2.000 ms"
    assert format_line(found["receive"].whole, "receive") == "90.0"
    drawn = plot_svg(found, "roscpp <here>")
    assert drawn.startswith("<svg")
    assert "roscpp &lt;here&gt;" in drawn
    assert drawn.count('class="point"') == sum(
        len(values) for call in ("publish", "sleep") for values in found[call].points.values()
    )
