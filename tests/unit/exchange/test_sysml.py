"""SysML v2: names, structure, and the list of what has no place there."""

from rigs.watch_model import write_watch_model
from volery.cli.commands.first_steps import example
from volery.exchange.sysml import name_text, sysml_text
from volery.model.assembly import read_tree


def exported(file):
    return sysml_text(read_tree(file).plain())


def test_names_are_quoted_where_they_must_be():
    assert [name_text(one) for one in ("plain", "a-b", "part", "it's")] == [
        "plain",
        "'a-b'",
        "'part'",
        "'it\\'s'",
    ]


def test_components_connections_and_allocations():
    text, _ = exported(example("delivery") / "model.yaml")
    assert "port drones : ~AirTransport[0..*];" in text
    assert "connect central.routes to planner.paths;" in text
    assert "allocate landing_1 to onboard_1;" in text
    assert "requirement battery_1 { doc /* drone_1.battery_min >= 0.2 */ }" in text
    assert text.count("{") == text.count("}")


def test_types_topics_and_what_has_no_place(tmp_path):
    text, notes = exported(write_watch_model(tmp_path / "watch"))
    assert "attribute def Image { attribute width : Integer; attribute height : Integer; }" in text
    assert "enum def Mode { enum day; enum night; }" in text
    assert "out item '/filtered' : 'sensor_msgs/Image';" in text
    listed = [str(note) for note in notes]
    assert "section `chains`: seen" in listed
    assert "allocations to memory spaces and operating systems: camera, detector, vision, debian" in listed
