"""Parameters: names of other versions, values that do not fit, and answers that come late or not at all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from rigs.missions import carried_out
from volery.base.errors import NotArrived, Refused, UsageError, VehicleError
from volery.base.time import MS, S
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.vehicles.drivers.ardupilot.versions import (
    PARAMETER_RULES,
    RENAMED,
    performed_checks,
    skipped_checks,
)
from volery.vehicles.drivers.mavlink.services import MavlinkServices
from volery.vehicles.parameters import Parameters, read_parameter_file
from volery.vehicles.telemetry import Telemetry

UINT8, INT16, INT32, REAL = 1, 4, 6, 9


@dataclass
class Autopilot:
    """Answers after ``delay`` ns; what ``lost`` says of the nth answer or request is lost."""

    values: dict[str, float]
    types: dict[str, int] = field(default_factory=dict)
    errors: bool = False
    delay: int = 100 * MS
    delays: list[int] = field(default_factory=list)  # of the first answers
    lost: Callable[[str, int], bool] = lambda name, number: False
    accepts: Callable[[float], float] = lambda value: value

    def __post_init__(self) -> None:
        self.kernel = VirtualKernel()
        self.asked: list[str] = []
        seen = Telemetry(self.kernel, "craft")
        self.services = MavlinkServices(
            self.kernel,
            seen,
            lambda name, **fields: None,
            self.take,
            bytewise=False,
            home_first=True,
            parameter_rules=PARAMETER_RULES,
        )
        self.parameters = Parameters("craft", self.services)

    def run(self, action: Callable[[], Any]) -> Any:
        return carried_out(self.kernel, action, self.kernel.root.child("program"))

    def take(self, name: str, **fields: Any) -> None:
        self.asked.append(name)
        if self.lost(name, self.asked.count(name)):
            return
        if name == "PARAM_REQUEST_LIST":
            for one in self.values:
                self.tell(one)
            return
        wanted = fields["param_id"] or list(self.values)[fields["param_index"]]
        if wanted not in self.values:
            if self.errors:
                self.say("PARAM_ERROR", param_id=wanted, param_index=-1, error=1)
            return
        if name == "PARAM_SET":
            self.values[wanted] = self.accepts(fields["param_value"])
        self.tell(wanted)

    def tell(self, name: str) -> None:
        self.say(
            "PARAM_VALUE",
            param_id=name,
            param_value=self.values[name],
            param_type=self.types.get(name, REAL),
            param_count=len(self.values),
            param_index=list(self.values).index(name),
        )

    def say(self, name: str, **fields: Any) -> None:
        after = self.delays.pop(0) if self.delays else self.delay
        frame = Frame(name, fields, 1, 1)
        self.kernel.call_at(self.kernel.now() + after, lambda: self.services.receive(frame))


NEW = {"LAND_SPD_MS": 0.5, "RTL_ALT_M": 15.0, "ARMING_SKIPCHK": 0.0, "WP_SPD": 10.0, "MAV_GCS_SYSID": 255.0}
OLD = {
    "LAND_SPEED": 50.0,
    "RTL_ALT": 1500.0,
    "ARMING_CHECK": 1.0,
    "WPNAV_SPEED": 1000.0,
    "SYSID_MYGCS": 255.0,
}


def test_an_error_of_the_autopilot_is_the_answer_at_once() -> None:
    craft = Autopilot(dict(NEW), errors=True)
    with pytest.raises(
        Refused, match=r"has no parameter LAND_SPEED; since 4\.7 it is LAND_SPD_MS \(cm/s -> m/s\)"
    ):
        craft.run(lambda: craft.parameters.get("land_speed"))
    assert craft.kernel.now() < S // 2
    assert craft.asked == ["PARAM_REQUEST_READ"]


def test_without_one_the_complete_list_tells_and_is_kept() -> None:
    craft = Autopilot(dict(OLD))
    with pytest.raises(Refused, match=r"has no parameter LAND_SPD_MS; before 4\.7 it is LAND_SPEED"):
        craft.run(lambda: craft.parameters.get("LAND_SPD_MS"))
    assert craft.kernel.now() < 2 * S
    began, asked = craft.kernel.now(), len(craft.asked)
    with pytest.raises(Refused, match=r"has no parameter LAND_SPEDD \(did you mean 'LAND_SPEED'\?\)"):
        craft.run(lambda: craft.parameters.get("LAND_SPEDD"))
    assert craft.kernel.now() == began
    assert len(craft.asked) == asked
    craft.run(lambda: craft.parameters.set("RTL_ALT", 2000.0))
    craft.values["RTL_NEW"] = 3.0  # as the group of a parameter that enables one
    assert craft.run(lambda: craft.parameters.get("RTL_NEW")) == 3.0


def test_a_parameter_whose_answers_are_lost_is_not_called_missing() -> None:
    craft = Autopilot(dict(OLD), lost=lambda name, number: name == "PARAM_REQUEST_READ" and number < 3)
    assert craft.run(lambda: craft.parameters.get("RTL_ALT")) == 1500.0
    dead = Autopilot(dict(OLD), lost=lambda name, number: name == "PARAM_REQUEST_READ")
    with pytest.raises(NotArrived, match="read the parameter RTL_ALT: no answer"):
        dead.run(lambda: dead.parameters.get("RTL_ALT"))


@pytest.mark.parametrize("late", [[1600 * MS, 50 * MS, 50 * MS], [50 * MS, 50 * MS]])
def test_a_late_answer_to_the_read_is_no_answer_to_the_set(late: list[int]) -> None:
    """The first read is answered after it was sent again: the old value comes after the new one."""
    craft = Autopilot(dict(OLD), delays=late)
    craft.run(lambda: craft.parameters.set("RTL_ALT", 2000.0))
    assert craft.values["RTL_ALT"] == 2000.0


def test_a_set_that_is_lost_beside_a_late_answer_is_sent_again() -> None:
    craft = Autopilot(
        dict(OLD),
        delays=[1600 * MS, 50 * MS],
        lost=lambda name, number: name == "PARAM_SET" and number == 1,
    )
    craft.run(lambda: craft.parameters.set("RTL_ALT", 2000.0))
    assert craft.values["RTL_ALT"] == 2000.0


def test_what_the_autopilot_keeps_is_said() -> None:
    craft = Autopilot(dict(OLD), accepts=lambda value: 1500.0)
    with pytest.raises(Refused, match="the autopilot keeps 1500"):
        craft.run(lambda: craft.parameters.set("RTL_ALT", 2000.0))
    assert craft.kernel.now() < 2 * S
    craft = Autopilot(dict(OLD), accepts=lambda value: 1800.0)
    with pytest.raises(Refused, match="the autopilot keeps 1800"):
        craft.run(lambda: craft.parameters.set("RTL_ALT", 2000.0))


@pytest.mark.parametrize(
    ("kind", "value", "said"),
    [
        (INT32, 1e30, "whole numbers from -2147483648 to 2147483647"),
        (INT16, 32768.0, "whole numbers from -32768 to 32767"),
        (UINT8, -1.0, "whole numbers from 0 to 255"),
        (INT16, 1.5, "whole numbers only"),
        (REAL, 1e39, "numbers go up to 3.40282e"),
    ],
)
def test_what_does_not_fit_is_not_sent(kind: int, value: float, said: str) -> None:
    craft = Autopilot(dict(OLD), types={"RTL_ALT": kind})
    with pytest.raises(Refused, match=said):
        craft.run(lambda: craft.parameters.set("RTL_ALT", value))
    assert "PARAM_SET" not in craft.asked


def test_a_file_of_an_older_version_is_converted_and_so_is_one_of_a_newer(tmp_path: Path) -> None:
    older, newer = tmp_path / "4.5.parm", tmp_path / "4.8.parm"
    older.write_text("LAND_SPEED,80\nRTL_ALT,2500\nARMING_CHECK,0\nWPNAV_SPEED,1000\nSYSID_MYGCS,254\n")
    craft = Autopilot(dict(NEW))
    changed = craft.run(lambda: craft.parameters.load(older))
    stated = craft.parameters.converted
    assert {one.name: (one.there, stated[one.name]) for one in changed} == {
        "LAND_SPD_MS": (pytest.approx(0.8), "LAND_SPEED=80"),
        "RTL_ALT_M": (pytest.approx(25.0), "RTL_ALT=2500"),
        "ARMING_SKIPCHK": (-1.0, "ARMING_CHECK=0"),
        "MAV_GCS_SYSID": (254.0, "SYSID_MYGCS=254"),
    }
    newer.write_text("LAND_SPD_MS,0.8\nARMING_SKIPCHK,8\nWP_SPD,5\n")
    craft = Autopilot(dict(OLD))
    craft.run(lambda: craft.parameters.load(newer))
    assert craft.values["LAND_SPEED"] == pytest.approx(80.0)
    assert craft.values["WPNAV_SPEED"] == pytest.approx(500.0)
    assert int(craft.values["ARMING_CHECK"]) & (1 << 3 | 1 << 4) == 1 << 4


def test_a_newer_name_in_the_file_counts_more_than_an_older_one(tmp_path: Path) -> None:
    both = tmp_path / "both.parm"
    both.write_text("LAND_SPEED,80\nLAND_SPD_MS,0.6\nNO_SUCH,1\n")
    craft = Autopilot(dict(NEW))
    with pytest.raises(VehicleError, match=r"1 parameters were set, 1 were not: NO_SUCH"):
        craft.run(lambda: craft.parameters.load(both))
    assert craft.values["LAND_SPD_MS"] == pytest.approx(0.6)


@pytest.mark.parametrize(("before", "after"), [(1, 0), (0, -1), (0b1110, 0x1FFFF0), (0x1FFFFE, 0)])
def test_the_meaning_of_the_arming_checks_is_inverted(before: int, after: int) -> None:
    assert skipped_checks(before) == after
    back = int(performed_checks(after))
    assert back == before or (before == 0x1FFFFE and back == 1)


def test_no_name_is_renamed_twice() -> None:
    older = [one.before for one in RENAMED.values()]
    newer = [one.after for one in RENAMED.values()]
    assert not set(older) & set(newer)
    for name, one in RENAMED.items():
        assert one.converted(one.other(name), one.converted(name, 37.0)) == pytest.approx(37.0) or one.change
        assert len(name) <= 16


def test_rows_of_another_component_are_not_the_autopilots(tmp_path: Path) -> None:
    file = tmp_path / "two.params"
    file.write_text(
        "# Vehicle-Id Component-Id Name Value Type\n1\t1\tRTL_ALT\t1500\t9\n1\t154\tSYSID_THISMAV\t9\t6\n"
    )
    assert read_parameter_file(file) == {"RTL_ALT": 1500.0}


def test_what_the_autopilot_writes_itself_is_no_setting(tmp_path: Path) -> None:
    """ArduCopter 4.8 refuses to set its ground pressure and number of items; STAT_RUNTIME counts."""
    own = {"BARO1_GND_PRESS": 94502.5, "MIS_TOTAL": 5.0, "STAT_RUNTIME": 60.0}
    file = tmp_path / "saved.parm"
    file.write_text("BARO1_GND_PRESS,94511\nMIS_TOTAL,0\nSTAT_RUNTIME,30\nSTAT_FLTCNT,2\nWP_SPD,10\n")
    craft = Autopilot(NEW | own)
    assert craft.run(lambda: craft.parameters.compare(file)) == []
    assert craft.run(lambda: craft.parameters.load(file)) == []
    assert [one.name for one in craft.parameters.left_alone] == list(own)
    assert "PARAM_SET" not in craft.asked
    file.write_text("MIS_TOTAL,0\nWP_SPD,5\n")
    assert [one.name for one in craft.run(lambda: craft.parameters.load(file))] == ["WP_SPD"]
    assert craft.values["MIS_TOTAL"] == 5.0


def test_a_file_of_ardupilots_own_has_equal_signs_and_masks(tmp_path: Path) -> None:
    file = tmp_path / "defaults.parm"
    file.write_text(
        "# board\nSERVO1_FUNCTION = 33\nBATT_MONITOR=8\nCAN_D1_UC_ESC_BM 0x0F\nRTL_ALT 1500 @READONLY\n"
    )
    assert read_parameter_file(file) == {
        "SERVO1_FUNCTION": 33.0,
        "BATT_MONITOR": 8.0,
        "CAN_D1_UC_ESC_BM": 15.0,
        "RTL_ALT": 1500.0,
    }
    for text, said in (
        ("@include ../other.parm\n", "'@include ../other.parm' is for ArduPilot's build"),
        ("A 0xG\n", "'0xG' is no value of 'A'"),
        ("A = \n", "'' is no value of 'A'"),
        ("A 1e400\n", "is no parameter and its value"),
        ("A " + "9" * 400 + "\n", "is no parameter and its value"),
        ("\0\0\0", "is no value"),
    ):
        file.write_text(text)
        with pytest.raises(UsageError) as caught:
            read_parameter_file(file)
        assert str(caught.value).startswith(f"{file}:1: ")
        assert said in str(caught.value)


def test_a_missing_answer_says_what_it_is_due_to() -> None:
    silent = Autopilot({"A": 1.0}, lost=lambda name, number: True)
    silent.services.cause = lambda: "it signs its messages"
    with pytest.raises(NotArrived, match="no answer; it signs its messages"):
        silent.run(lambda: silent.parameters.get("A"))
