from __future__ import annotations

from importlib.metadata import EntryPoint

import pytest

from volery.base.errors import UsageError
from volery.base.installed import Registry


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> list[EntryPoint]:
    """What packages have registered, for this test."""
    points: list[EntryPoint] = []
    monkeypatch.setattr(
        "volery.base.installed.entry_points", lambda group: [each for each in points if each.group == group]
    )
    return points


def test_names_are_listed_without_importing_anything(installed: list[EntryPoint]) -> None:
    installed.append(EntryPoint("zeppelin", "no.such.module:thing", "things"))
    things: Registry[object] = Registry("things", "thing")
    things.add("aeroplane", 1)
    assert things.names() == ["aeroplane", "zeppelin"]
    assert things.load("aeroplane") == 1


def test_an_entry_point_is_loaded_when_asked_for(installed: list[EntryPoint]) -> None:
    installed.append(EntryPoint("square_root", "math:sqrt", "things"))
    installed.append(EntryPoint("other", "math:sin", "other things"))
    things: Registry[object] = Registry("things", "thing")
    assert things.names() == ["square_root"]
    assert things.load("square_root")(16.0) == 4.0


def test_what_a_script_adds_comes_before_what_is_installed(installed: list[EntryPoint]) -> None:
    installed.append(EntryPoint("thing", "math:sqrt", "things"))
    things: Registry[object] = Registry("things", "thing")
    things.add("thing", "mine")
    assert things.load("thing") == "mine"


def test_a_wrong_name_gets_the_valid_ones(installed: list[EntryPoint]) -> None:
    things: Registry[object] = Registry("things", "driver")
    for name in ("px4", "ardupilot"):
        things.add(name, name)
    with pytest.raises(UsageError) as caught:
        things.load("ardupilto")
    assert (
        str(caught.value)
        == "no driver named 'ardupilto' (did you mean 'ardupilot'?); there is ardupilot or px4"
    )
    with pytest.raises(UsageError, match="no driver named 'x'; there is nothing"):
        Registry[object]("nothing", "driver").load("x")


def test_one_that_cannot_be_imported_says_what_is_missing(installed: list[EntryPoint]) -> None:
    installed.append(EntryPoint("dji", "no_such_library.driver:open", "things"))
    installed.append(EntryPoint("half", "math:no_such_thing", "things"))
    things: Registry[object] = Registry("things", "driver")
    with pytest.raises(
        UsageError, match="the driver 'dji' cannot be loaded: No module named 'no_such_library'"
    ):
        things.load("dji")
    with pytest.raises(UsageError, match=r"the driver 'half' cannot be loaded: .*no_such_thing"):
        things.load("half")


def test_two_packages_with_the_same_name_are_not_chosen_between(installed: list[EntryPoint]) -> None:
    installed.append(EntryPoint("dji", "math:sin", "things"))
    installed.append(EntryPoint("dji", "math:cos", "things"))
    things: Registry[object] = Registry("things", "driver")
    with pytest.raises(UsageError, match="two packages provide the driver 'dji': math:cos and math:sin"):
        things.load("dji")
