from __future__ import annotations

from pathlib import Path

import pytest

from volery.base.errors import ModelError, UsageError
from volery.links.paparazzi_aircraft import read_aircraft, stock_aircraft
from volery.links.pprzlink_messages import entry_value, message_type

SETTINGS = """<!DOCTYPE settings SYSTEM "settings.dtd">
<settings target="ap">
  <dl_settings>
    <dl_settings NAME="Telemetry"><dl_setting VAR="telemetry_mode" MIN="0" MAX="3" STEP="1"/></dl_settings>
    <dl_settings NAME="System">
      <dl_setting var="autopilot.kill_throttle" shortname="kill_throttle" min="0" max="1"
        values="Resurrect|Kill"/>
      <dl_setting var="autopilot.mode_auto2" shortname="auto2" min="0" step="1" max="19"/>
    </dl_settings>
  </dl_settings>
</settings>
"""
PLAN = """<dump><flight_plan name="mine" lat0="43 33 50.83" lon0="1 28 52.61" max_dist_from_home="80">
  <waypoints><waypoint name="HOME" x="1.5" y="-2"/><waypoint name="_TD" lat="43.5" lon="1.4"/></waypoints>
  <blocks><block no="0" name="Wait"/><block no="1" name="Take off!"/></blocks>
</flight_plan></dump>
"""
CONF = '<conf><aircraft name="Bee" ac_id="202" airframe="bee.xml"/></conf>'


def folder(at: Path, **documents: str) -> Path:
    for name, text in documents.items():
        (at / f"{name}.xml").write_text(text)
    return at


def test_the_stock_rotorcraft() -> None:
    stock = stock_aircraft()
    assert len(stock.fingerprint) == 16
    names = [block.name for block in stock.blocks]
    assert names[3:5] == ["Start Engine", "Takeoff"]
    assert names[13:17] == ["land here", "land", "flare", "landed"]
    assert [block.number for block in stock.blocks] == list(range(len(names)))
    assert stock.setting("auto2").words[19] == "Guided"
    assert stock.setting("mode").variable == "autopilot.mode"
    assert stock.setting("kill_throttle").variable == "autopilot.kill_throttle"
    assert stock.setting("kill_throttle").words == ("Resurrect", "Kill")
    assert stock.waypoint("HOME").number == 1


def test_a_setting_has_a_word_for_each_mode() -> None:
    modes = message_type("ROTORCRAFT_STATUS").words("ap_mode")
    assert len(stock_aircraft().setting("auto2").words) == len(modes)
    assert entry_value("ROTORCRAFT_STATUS", "ap_mode", "GUIDED") == 19


def test_the_folder_of_an_aircraft(tmp_path: Path) -> None:
    aircraft = read_aircraft(folder(tmp_path, settings=SETTINGS, flight_plan=PLAN, conf_aircraft=CONF))
    assert (aircraft.name, aircraft.system, aircraft.farthest) == ("Bee", 202, 80.0)
    assert aircraft.setting("auto2").number == 2
    assert aircraft.setting("autopilot.mode_auto2").number == 2
    assert aircraft.setting("kill_throttle").number == 1
    assert aircraft.block("Take off!").number == 1
    assert (aircraft.waypoint("HOME").east, aircraft.waypoint("HOME").number) == (1.5, 1)
    assert aircraft.waypoint("_TD").number == 2


def test_what_the_files_do_not_say_is_never_assumed(tmp_path: Path) -> None:
    folder(tmp_path, settings=SETTINGS)
    with pytest.raises(UsageError, match="no flight plan there; give a folder"):
        read_aircraft(tmp_path / "settings.xml")
    (tmp_path / "settings.xml").unlink()
    folder(tmp_path, flight_plan=PLAN)
    with pytest.raises(UsageError, match="no settings there; give a folder"):
        read_aircraft(tmp_path)


def test_the_configuration_lies_one_folder_deeper(tmp_path: Path) -> None:
    folder(tmp_path, settings=SETTINGS, flight_plan=PLAN)
    (tmp_path / "conf").mkdir()
    (tmp_path / "conf" / "conf_aircraft.xml").write_text(CONF)
    (tmp_path / "conf" / "other.xml").write_text("not read")
    assert read_aircraft(tmp_path).system == 202


def test_a_configuration_with_c_code_as_the_generator_writes_it(tmp_path: Path) -> None:
    call = '<call fun="run(flying(), &stabilization.rc_sp, &thrust_sp)"/>'
    conf = f'<aircraft ac_id="202" name="Bee"><airframe>{call}</airframe></aircraft>'
    aircraft = read_aircraft(folder(tmp_path, settings=SETTINGS, flight_plan=PLAN, conf_aircraft=conf))
    assert (aircraft.name, aircraft.system) == ("Bee", 202)
    assert aircraft.setting("kill_throttle").number == 1


def test_a_configuration_that_is_no_xml_is_an_error(tmp_path: Path) -> None:
    made = folder(tmp_path, settings=SETTINGS, flight_plan=PLAN, conf_aircraft="\x01 nothing")
    with pytest.raises(ModelError, match=r"conf_aircraft\.xml.*not XML"):
        read_aircraft(made)


@pytest.mark.parametrize(
    "attributes",
    [
        'var="x" shortname="kill_throttle"',
        'var="kill_throttle"',
        'var="autopilot.kill_throttle"',
        'var="pilot->kill_throttle"',
        'var="autopilot_kill_throttle"',
    ],
)
def test_a_setting_is_found_as_a_ground_station_finds_it(tmp_path: Path, attributes: str) -> None:
    text = f'<settings><dl_setting var="gps.mode"/><dl_setting {attributes}/></settings>'
    aircraft = read_aircraft(folder(tmp_path, settings=text, flight_plan=PLAN))
    assert aircraft.setting("kill_throttle").number == 1


def test_a_name_in_several_modules_is_that_of_the_autopilot_or_an_error(tmp_path: Path) -> None:
    def read(*variables: str) -> int:
        text = "".join(f'<dl_setting var="{variable}"/>' for variable in variables)
        plain = folder(tmp_path, settings=f"<settings>{text}</settings>", flight_plan=PLAN)
        return read_aircraft(plain).setting("mode").number

    assert read("gps.mode", "autopilot.mode") == 1
    with pytest.raises(UsageError, match=r"'mode' may be setting 0 \(gps.mode\) or 1 \(imu.mode\)"):
        read("gps.mode", "imu.mode")


def test_a_variable_listed_twice_is_set_by_its_first_number(tmp_path: Path) -> None:
    twice = '<dl_setting var="autopilot.kill_throttle" min="0" max="1"/>' * 2
    text = f'<settings><dl_setting var="x"/>{twice}</settings>'
    aircraft = read_aircraft(folder(tmp_path, settings=text, flight_plan=PLAN))
    assert aircraft.setting("kill_throttle").number == 1


def test_modes_of_a_generated_autopilot(tmp_path: Path) -> None:
    text = (
        '<settings><dl_setting var="x" header="x"/>'
        '<dl_setting var="autopilot_mode_ap" values="NAV|HOME|KILL" header="autopilot_generated"/></settings>'
    )
    aircraft = read_aircraft(folder(tmp_path, settings=text, flight_plan=PLAN))
    assert aircraft.generated_modes == ("NAV", "HOME", "KILL")
    assert stock_aircraft().generated_modes == ()


def test_an_unknown_name_is_reported_with_the_known_ones(tmp_path: Path) -> None:
    aircraft = read_aircraft(folder(tmp_path, settings=SETTINGS, flight_plan=PLAN))
    with pytest.raises(UsageError) as raised:
        aircraft.block("Take off")
    assert "no block 'Take off' (did you mean 'Take off!'?); it has Take off! or Wait" in str(raised.value)
    with pytest.raises(UsageError, match="no setting 'mode'"):
        aircraft.setting("mode")
    with pytest.raises(UsageError, match="no waypoint 'home'"):
        aircraft.waypoint("home")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("<settings>\n<dl_setting", "mine.xml:2: not XML"),
        ("", "mine.xml"),
        (
            "<settings>\n<dl_setting var='a' max='x'/></settings>",
            "mine.xml:2: dl_setting: max='x' is not a number",
        ),
        ("<flight_plan><blocks><block/></blocks></flight_plan>", "mine.xml:1: a block without a name"),
        (
            "<flight_plan><blocks><block no='1' name='a'/><block no='1' name='b'/></blocks></flight_plan>",
            "'b' and 'a' both have number 1",
        ),
        ("<flight_plan><blocks><block no='256' name='a'/></blocks></flight_plan>", "has room for 0 to 255"),
        (
            "<!DOCTYPE settings [<!ENTITY a 'x'>]><settings><dl_setting var='&a;'/></settings>",
            "entities are not read",
        ),
    ],
)
def test_errors_name_file_and_line(tmp_path: Path, text: str, expected: str) -> None:
    with pytest.raises(ModelError) as raised:
        read_aircraft(folder(tmp_path, mine=text))
    assert expected in str(raised.value)


def test_no_file_outside_is_read(tmp_path: Path) -> None:
    secret = tmp_path / "secret.txt"
    secret.write_text("secret")
    inside = "<settings><dl_setting var='v'>&x;</dl_setting></settings>"
    text = f"<!DOCTYPE s [<!ENTITY x SYSTEM '{secret}'>]>{inside}"
    with pytest.raises(ModelError, match="entities are not read"):
        read_aircraft(folder(tmp_path, mine=text))


def test_nothing_to_read(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no XML of an aircraft there"):
        read_aircraft(tmp_path)
    with pytest.raises(UsageError, match="no XML of an aircraft there"):
        read_aircraft(tmp_path / "missing")
    with pytest.raises(UsageError, match="no settings and flight plan there"):
        read_aircraft(folder(tmp_path, conf=CONF))
