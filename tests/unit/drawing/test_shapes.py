"""Pictures of the delivery example and of odd models: everything is in them and nothing overlaps."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import pytest
from lxml import etree

from volery.analysis.system_analysis import analyse
from volery.drawing.deployment import deployment_svg
from volery.drawing.layers import place
from volery.drawing.mermaid import deployment_mermaid, functional_mermaid, verification_mermaid
from volery.drawing.shapes import functional_svg, verification_svg
from volery.drawing.views import SYSTEM, functional, verification
from volery.model.system_loader import load
from volery.report.graph_picture import graph_of_model, graph_svg
from volery.run.assembly.model_checks import vocabulary

DELIVERY = Path(__file__).parents[3] / "examples" / "delivery"
SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def delivery():
    return load(DELIVERY, vocabulary())


def words(svg):
    return [one.text for one in etree.fromstring(svg.encode()).iter(f"{SVG}text")]


def test_the_functional_architecture_shows_components_ports_and_interfaces(delivery):
    svg = functional_svg(delivery)
    shown = words(svg)
    for one in delivery.instances:
        assert f"{one.name}: {one.component.name}" in shown
    assert {"drone_1", "rover_north", "GroundTransport", "Landing", "«RtUnit»", "«PpUnit»", "routes"} <= set(
        shown
    )
    root = etree.fromstring(svg.encode())
    balls = [one for one in root.iter(f"{SVG}circle") if one.get("class") == "ball"]
    provided = sum(len(one.component.provides) for one in delivery.instances) + len(delivery.vehicles)
    assert len(balls) == provided
    links = [one for one in root.iter(f"{SVG}path") if one.get("class") == "link"]
    targets = sum(
        len(connection.targets)
        for one in delivery.instances
        for connection in one.connections.values()
        if connection.interface != "Environment"
    )
    assert len(links) == targets


def test_no_two_boxes_overlap_and_callers_stand_left_of_those_that_they_call(delivery):
    for diagram in (functional(delivery), verification(delivery)):
        placed = place(diagram)
        for one, other in combinations(placed.places.values(), 2):
            apart_x = one.x + one.width <= other.x or other.x + other.width <= one.x
            assert apart_x or one.y + one.height <= other.y or other.y + other.height <= one.y
        for route in placed.routes:
            assert route.places[0].x < route.places[-1].x


def test_the_verification_environment_has_the_system_as_one_box(delivery):
    diagram = verification(delivery)
    assert {one.key for one in diagram.boxes} == {
        SYSTEM, "requesters", "provider", "beacon_1", "beacon_2", *(one.name for one in delivery.vehicles),
    }  # fmt: skip
    assert "central.orders" in words(verification_svg(delivery))


def test_the_deployment_shows_the_allocation(delivery):
    shown = words(deployment_svg(delivery))
    assert "on drone_1 (multirotor, ardupilot)" in shown
    assert "4 × 1500 MHz · fixed-priority" in shown
    assert "radio: 250 kbit/s · 15 ms · 0.5 % lost" in shown
    assert shown.count("node of drone_1") == 1


def test_topics_are_those_of_the_vehicles(delivery):
    graph = graph_of_model(delivery)
    state = next(one for one in graph.topics if one.name == "/drone_1/… (state)")
    assert set(state.subscribers) == {"/drone_control_1", "/landing_1"}
    etree.fromstring(graph_svg(graph).encode())


def test_mermaid_has_a_node_for_each_component(delivery):
    text = functional_mermaid(delivery)
    assert text.startswith("flowchart LR\n")
    assert text.count(":::active") == sum(
        1 for one in delivery.instances if one.activity and not one.is_environment
    )
    assert 'n_central -->|"Routing"| n_planner' in text
    assert "subgraph n_onboard_5f_1" in deployment_mermaid(delivery)
    assert "n_system" in verification_mermaid(delivery)


HOSTILE = """
volery: 1
name: "<script>&\\"end\\""
components: {A: {language: python}}
application: {end: {is: A}, subgraph: {is: A}}
platform: {processors: {pc: {is: rpi4-cortex-a72, frequency: 1500 MHz}}}
allocations: {one: {end: pc, subgraph: pc}}
"""


def test_names_cannot_break_the_picture(tmp_path):
    (tmp_path / "model.yaml").write_text(HOSTILE)
    system = load(tmp_path, vocabulary())
    for svg in (functional_svg(system), verification_svg(system), deployment_svg(system)):
        assert any("<script>" in one for one in words(svg))
    assert "<script>" not in functional_mermaid(system)
    assert "n_end[" in functional_mermaid(system)


def large(instances):
    """A model of computers with a controller that calls a driver each."""
    lines = ["volery: 1", "name: large", "interfaces: {Drive: {go: }}", "components:"]
    at = "at: {processor: rpi4-cortex-a72, frequency: 1500 MHz}"
    operations = "operations: {go: {time: 1 ms}}"
    lines.append(f"  Driver: {{language: python, {at}, provides: {{drive: Drive}}, {operations}}}")
    lines.append(
        f"  Control: {{language: python, {at}, active: {{period: 50 ms}}, activation: {{time: 2 ms}}, "
        "requires: {drive: Drive}, calls: {activation: {drive.go: 1}}}"
    )
    pairs = range(instances // 2)
    lines.append("application:")
    lines += [
        f"  driver_{one}: {{is: Driver}}\n  control_{one}: {{is: Control, drive: driver_{one}.drive}}"
        for one in pairs
    ]
    lines.append("platform: {processors: {")
    lines += [f"  pc_{one}: {{is: rpi4-cortex-a72, frequency: 1500 MHz}}," for one in pairs]
    lines.append("}}\nallocations: {one: {")
    lines += [f"  driver_{one}: pc_{one}, control_{one}: pc_{one}," for one in pairs]
    return "\n".join([*lines, "}}"]) + "\n"


def test_a_hundred_computers_are_drawn_and_analysed(tmp_path):
    (tmp_path / "model.yaml").write_text(large(200))
    system = load(tmp_path, vocabulary())
    assert words(functional_svg(system)).count("«RtUnit»") == 100
    assert words(deployment_svg(system)).count("«HwProcessor»") == 100
    found = analyse(system)
    assert all(bound.bound == 3_000_000 for bounds in found.responses.values() for bound in bounds)
