"""The declared layout: fields never overlap, cover every column, and have units."""

import inspect
from types import ModuleType

import pytest

from volery.simulation.autopilots.flight_stack import flight_state
from volery.simulation.autopilots.flight_stack.flight import Setpoint
from volery.simulation.world import state_layout
from volery.simulation.world.state_layout import ColumnLayout

LAYOUTS = [(state_layout, state_layout.WORLD_LAYOUT), (flight_state, flight_state.FLIGHT_LAYOUT)]
PREFIXES = ("S_", "U_", "M_", "P_", "W_", "C_", "K_")
UNITS = "1 m s kg rad N J V A W ohm gauss"


@pytest.fixture
def with_one_sensor_more():
    """The world's layout as a module, with a ninth sensor declared in the midst."""
    source = inspect.getsource(state_layout)
    before = "P_GPS_PERIOD = _add("
    assert before in source
    added = 'P_AIRSPEED_ERROR = _add("P_AIRSPEED_ERROR", "m/s", "airspeed sensor", 4, ERROR)\n'
    module = ModuleType("extended_layout")
    exec(compile(source.replace(before, added + before), "extended_layout", "exec"), module.__dict__)
    return module


@pytest.mark.parametrize(("module", "layout"), LAYOUTS)
def test_fields_cover_every_column_once(module, layout):
    owner = {}
    for field in layout.fields:
        for column in range(field.column, field.column + field.width):
            assert owner.setdefault(column, field.name) == field.name
    assert sorted(owner) == list(range(layout.start, layout.end))


@pytest.mark.parametrize(("module", "layout"), LAYOUTS)
def test_constants_and_declarations_are_the_same(module, layout):
    imported = vars(state_layout) if module is flight_state else {}
    declared = {field.name: field.column for field in layout.fields}
    constants = {
        name: value
        for name, value in vars(module).items()
        if name.startswith(PREFIXES) and isinstance(value, int) and name not in imported
    }
    assert constants == declared


@pytest.mark.parametrize(("module", "layout"), LAYOUTS)
def test_every_field_has_a_unit_a_meaning_and_axes(module, layout):
    for field in layout.fields:
        assert field.meaning, field
        assert bool(field.axes) == (field.width > 1), field
        for factor in field.unit.replace("mixed", "1").replace(",", "").replace("/", " ").split():
            assert factor.partition("^")[0] in UNITS.split(), field


def test_the_flight_stack_continues_the_worlds_layout():
    assert flight_state.FLIGHT_LAYOUT.start == state_layout.WORLD == state_layout.WORLD_LAYOUT.end
    names = [field.name for _, layout in LAYOUTS for field in layout.fields]
    assert len(names) == len(set(names))


def test_a_sensor_more_shifts_the_later_fields_and_overlaps_none(with_one_sensor_more):
    before, after = state_layout.WORLD_LAYOUT, with_one_sensor_more.WORLD_LAYOUT
    assert after.end == before.end + 4
    assert with_one_sensor_more.P_GPS_PERIOD == state_layout.P_GPS_PERIOD + 4
    assert with_one_sensor_more.P_AIRSPEED_ERROR == state_layout.P_GPS_PERIOD
    test_fields_cover_every_column_once(with_one_sensor_more, after)
    test_constants_and_declarations_are_the_same(with_one_sensor_more, after)


def test_a_set_point_fills_the_command_columns_in_their_order():
    commands = [
        field
        for field in flight_state.FLIGHT_LAYOUT.fields
        if flight_state.C_CONTROL <= field.column < flight_state.C_AIDED
    ]
    row = Setpoint(
        flight_state.Control.POSITION,
        position=(1.0, 2.0, 3.0),
        velocity=(4.0, 5.0, 6.0),
        roll=7.0,
        pitch=8.0,
        yaw=9.0,
        throttle=10.0,
        steering=11.0,
        climb=12.0,
        speed=13.0,
        speed_up=14.0,
        speed_down=15.0,
        accel=16.0,
        accel_z=17.0,
        tilt=18.0,
        jerk=19.0,
    ).row()
    assert len(row) == sum(field.width for field in commands)
    by_name = {field.name: row[field.column - flight_state.C_CONTROL] for field in commands}
    assert by_name["C_POSITION"] == 1.0
    assert by_name["C_YAW"] == 9.0
    assert by_name["C_YAW_MODE"] == flight_state.YAW_ANGLE
    assert by_name["C_THROTTLE"] == 10.0
    assert by_name["C_SPEED_DOWN"] == 15.0
    assert by_name["C_JERK"] == 19.0


def test_a_layout_allots_columns_in_the_order_of_declaration():
    first = ColumnLayout()
    assert [first.add("A", "m", "a"), first.add("B", "m", "b", 3, "x, y, z"), first.add("C", "m", "c")] == [
        0,
        1,
        4,
    ]
    assert ColumnLayout(after=first).add("D", "m", "d") == 5
