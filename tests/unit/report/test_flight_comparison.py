"""Flights phase by phase: matched phases, figures, verdicts, answers and texts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from rigs.flown_records import Shape, write_run, write_tlog
from volery.report.flight_comparison import (
    FlightComparison,
    PhaseDifference,
    aligned,
    compare_flights,
    phase_grid,
    phases,
)
from volery.report.flights import Curve, FlightAnswer, State, VehicleFlight, read_flights

ASKED = (("takeoff", 1.0, 13.0), ("goto", 20.0, 30.0), ("land", 35.0, 50.0))
USUAL = Shape()
SLOW = (("takeoff", 1.0, 18.0), ("goto", 20.0, 30.0), ("land", 35.0, 50.0))


def flown(path: Path, shape: Shape = USUAL, operations=ASKED) -> VehicleFlight:
    (found,) = read_flights(write_run(path, shape, operations))
    return found


def compared(first: VehicleFlight, second: VehicleFlight, within_m: float = 2.0) -> FlightComparison:
    return compare_flights(first, second, ("one", "other"), within_m)


def phase(found: FlightComparison, name: str) -> PhaseDifference:
    return next(one for one in found.phases if one.name == name)


def test_a_flight_is_like_itself(tmp_path: Path) -> None:
    flight = flown(tmp_path / "run")
    found = compared(flight, flight)
    assert [one.name for one in found.phases] == ["before arming", "armed", "takeoff", "goto", "land"]
    assert all(one.alike and one.verdict == "alike" for one in found.phases)
    assert found.verdict == "other against one: 5 of 5 phases alike"
    assert found.texts == ()
    assert max(one.path_m for one in found.phases if one.path_m is not None) < 1e-9


def test_what_an_operation_waits_for_is_a_phase_of_its_own(tmp_path: Path) -> None:
    flight = flown(tmp_path / "run")
    found = compared(flight, flight)
    assert phase(found, "before arming").seconds[0] == pytest.approx(4.0)
    assert phase(found, "takeoff").seconds[0] == pytest.approx(8.0)
    assert phase(found, "takeoff").asked == "takeoff as asked"


def test_a_slower_climb_on_the_same_way(tmp_path: Path) -> None:
    found = compared(flown(tmp_path / "run"), flown(tmp_path / "slow", Shape(climb_m_s=1.0), SLOW))
    climb = phase(found, "takeoff")
    assert climb.longer_s == pytest.approx(5.0)
    assert climb.path_m == pytest.approx(0.0, abs=0.01)  # only time differs
    assert climb.apart_m == pytest.approx(5.0, abs=0.01)  # 10 m against 5 m after 8 s
    assert climb.verdict == "5.0 s longer (+62 %)"
    assert phase(found, "goto").alike
    assert found.verdict == (
        "other against one: 4 of 5 phases alike; most different is takeoff, 5.0 s longer (+62 %)"
    )


def test_another_way_in_the_same_time(tmp_path: Path) -> None:
    found = compared(flown(tmp_path / "run"), flown(tmp_path / "east", Shape(east_m=15.0)))
    leg = phase(found, "goto")
    assert leg.apart_m == pytest.approx(15.0, abs=0.01)
    assert leg.path_m == pytest.approx(15.0, abs=0.01)  # from (15, 20) to the end (0, 20) of the other way
    assert leg.ends_apart_m == pytest.approx(15.0, abs=0.01)
    assert leg.ends[1] == pytest.approx((15.0, 20.0, 10.0), abs=0.01)
    assert leg.verdict == "ways 15.0 m apart"
    assert phase(found, "land").alike, "it is judged from its own beginning"
    assert phase(found, "land").ends_apart_m == pytest.approx(15.0, abs=0.01)
    assert phase(compared(*two(tmp_path), within_m=16.0), "goto").alike


def two(folder: Path) -> tuple[VehicleFlight, VehicleFlight]:
    return read_flights(folder / "run")[0], read_flights(folder / "east")[0]


def test_angles_differ_the_short_way_round(tmp_path: Path) -> None:
    flight = flown(tmp_path / "run")
    yaw = flight.curves["yaw"]
    turned = replace(flight, curves={**flight.curves, "yaw": Curve(yaw.times, yaw.values + 350.0)})
    assert phase(compared(flight, turned), "goto").rms_deg == pytest.approx((0.0, 0.0, 10.0))


def test_what_is_not_known_is_not_alike_by_default(tmp_path: Path) -> None:
    flight = flown(tmp_path / "run")
    nothing = Curve(*(flight.curves["east"].times[:0],) * 2)
    blind = replace(flight, curves=dict.fromkeys(flight.curves, nothing))
    leg = phase(compared(flight, blind), "goto")
    assert (leg.path_m, leg.apart_m, leg.ends_apart_m, leg.rms_deg) == (None, None, None, (None, None, None))
    assert leg.alike, "its duration is known"


def test_phases_of_one_side(tmp_path: Path) -> None:
    whole, part = flown(tmp_path / "run"), flown(tmp_path / "part", operations=ASKED[:2])
    found = compared(whole, part)
    land = phase(found, "land")
    assert not land.alike
    assert land.seconds[1] is None
    assert land.verdict == "only one has it"
    assert "only one has land" in found.verdict
    assert "–" in [cell.text for cell in phase_grid(found).rows[-1]]


def test_a_run_beside_a_log_goes_by_states(tmp_path: Path) -> None:
    (log,) = read_flights(write_tlog(tmp_path / "1.tlog"))
    found = compared(flown(tmp_path / "run"), log)
    assert {one.name for one in found.phases} == {"armed", "mode GUIDED", "take-off", "mode LAND", "landing"}
    assert all(one.alike for one in found.phases), found.verdict


def test_a_log_that_begins_in_the_air_has_a_landing(tmp_path: Path) -> None:
    flight = flown(tmp_path / "run")
    later = {
        name: Curve(*(part[curve.times > 32.0] for part in curve)) for name, curve in flight.curves.items()
    }
    cut = replace(flight, curves=later, states=(State(32.0, True, "LAND"), *flight.states[-1:]))
    found = [one.name for one in phases(cut, by_operations=False)]
    assert found == ["armed", "mode LAND", "landing"]
    still = replace(flight, curves={**flight.curves, "height": flight.curves["roll"]})
    assert next(one.name for one in phases(still, by_operations=False)) == "armed on the ground"


def test_the_same_operation_several_times_is_numbered(tmp_path: Path) -> None:
    legs = (("goto", 20.0, 25.0), ("goto", 25.0, 30.0))
    flight = flown(tmp_path / "run", operations=legs)
    assert [one.name for one in compared(flight, flight).phases] == ["armed", "goto 1", "goto 2"]


def test_what_was_asked_the_same_is_matched_before_the_name_alone(tmp_path: Path) -> None:
    flight = flown(tmp_path / "run", operations=(("goto", 20.0, 25.0), ("goto", 25.0, 30.0)))
    first, second = flight.operations
    last_alone = replace(flight, operations=(second._replace(asked="go home"),))
    whole = replace(flight, operations=(first, second._replace(asked="go home")))
    one, two = (phase(compared(whole, last_alone), f"goto {number}") for number in (1, 2))
    assert (one.verdict, two.verdict) == ("only one has it", "alike")
    elsewhere = replace(flight, operations=(second._replace(asked="go elsewhere"),))
    assert phase(compared(whole, elsewhere), "goto 1").excess is not None, (
        "the name counts where nothing else does"
    )


def test_answers_stand_beside_each_other_in_order(tmp_path: Path) -> None:
    flight = flown(tmp_path / "run")
    first = replace(
        flight,
        answers=(FlightAnswer(1, "arm", "ok"), FlightAnswer(2, "goto", "ok"), FlightAnswer(3, "goto", "ok")),
    )
    second = replace(
        flight, answers=(FlightAnswer(1, "arm", "Refused", "no GPS"), FlightAnswer(2, "land", "ok"))
    )
    assert [tuple(row) for row in compared(first, second).answers] == [
        ("arm", "ok", "Refused: no GPS"),
        ("goto", "ok ×2", None),
        ("land", None, "ok"),
    ]


def test_texts_of_one_side_in_order_of_time(tmp_path: Path) -> None:
    first = flown(tmp_path / "run", Shape(also_said="Crash: Disarming: AngErr=80>30"))
    second = flown(tmp_path / "other", Shape(also_said="Mode change failed"))
    found = compared(first, second)
    assert [(one.side, one.after_arming_s, one.text) for one in found.texts] == [
        (0, 7.0, "Crash: Disarming: AngErr=80>30"),
        (1, 7.0, "Mode change failed"),
    ]
    assert found.said_by_both == 1
    numbers = flown(tmp_path / "third", Shape(also_said="Crash: Disarming: AngErr=77>30"))
    assert compared(first, numbers).texts == ()


def test_sequences_are_aligned_in_the_order_of_both() -> None:
    assert aligned("abcd", "acxd") == [(0, 0), (1, None), (2, 1), (None, 2), (3, 3)]
