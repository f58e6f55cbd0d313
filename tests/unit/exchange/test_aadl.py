"""AADL: names, structure, bindings, and the list of what has no place there."""

import re

from rigs.watch_model import write_watch_model
from volery.cli.commands.first_steps import example
from volery.exchange.aadl import aadl_text, identifier, time_text
from volery.model.assembly import read_tree


def exported(file):
    return aadl_text(read_tree(file).plain())


def test_names_are_identifiers():
    assert identifier("hospital-delivery") == "hospital_delivery"
    assert identifier("/camera/image__raw") == "camera_image_raw"
    assert identifier("2nd") == "x_2nd"
    assert identifier("end") == "x_end"
    assert identifier("--") == "unnamed"


def test_times_are_exact():
    assert [time_text(one) for one in (0, 1, 1_500, 2_000_000, 10**9)] == [
        "0 sec",
        "1 ns",
        "1500 ns",
        "2 ms",
        "1 sec",
    ]


def test_every_part_ends_under_its_own_name():
    text, _ = exported(example("delivery") / "model.yaml")
    opened = []
    kinds = "package|data|subprogram group|subprogram|process implementation|process|thread|bus|processor"
    heads = rf"^ *({kinds}|device|system implementation|system) (\S+)$"
    for line in text.splitlines():
        head, end = re.match(heads, line), re.match(r"^ *end (\S+);$", line)
        if head:
            opened.append(head.group(2))
        elif end:
            assert end.group(1) == opened.pop()
    assert opened == []
    assert len(re.findall(r"^ *process implementation", text, re.MULTILINE)) == 8


def test_timing_bindings_and_connections():
    text, _ = exported(example("delivery") / "model.yaml")
    thread = text[text.index("thread DroneControl_main") : text.index("end DroneControl_main")]
    assert "Period => 100 ms;" in thread
    assert "Deadline => 100 ms;" in thread
    assert "Compute_Execution_Time => 200 us .. 200 us;" in thread
    assert "Actual_Processor_Binding => (reference (onboard_1)) applies to landing_1;" in text
    assert "subprogram group access central.routes <-> planner.paths;" in text
    assert "subprogram group access landing_1.drone <-> drone_1.commands;" in text
    assert "bus access radio <-> ground.radio;" in text
    assert "Clock_Period => 667 ps;" in text


def test_best_and_worst_times_are_a_range(tmp_path):
    file = write_watch_model(tmp_path / "watch")
    file.write_text(
        file.read_text().replace(
            "activation: {time: 12 ms}", "activation: {time: 12 ms, best: 9 ms, worst: 20 ms}"
        )
    )
    assert "Compute_Execution_Time => 9 ms .. 20 ms;" in exported(file)[0]


def test_what_has_no_place_is_listed(tmp_path):
    _, notes = exported(write_watch_model(tmp_path / "watch"))
    listed = [str(note) for note in notes]
    assert "section `requirements`: fast, in_time, charge, chain" in listed
    assert "section `memory_spaces`: vision" in listed
    assert "times of operations: Camera" in listed
    assert any(
        line.startswith("provenance of quantities: platform.processors.onboard.frequency") for line in listed
    )
    assert any("drone_1.battery" in line for line in listed)


def test_a_name_stays_in_its_comment():
    text, _ = aadl_text({"name": "x\nend x; system mark end mark;\u2028y", "components": {}})
    assert text.splitlines()[0] == "-- x end x; system mark end mark; y"
    assert not any(line.startswith(("end x;", "system mark")) for line in text.splitlines())
