"""``volery model draw`` and ``volery model diff``: what they write, and what they refuse."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from volery.cli.main import application

DELIVERY = Path(__file__).parents[4] / "examples" / "delivery"


def volery(*arguments):
    return CliRunner().invoke(application(), ["model", *map(str, arguments)])


def test_all_views_and_the_page_are_written(tmp_path):
    done = volery("draw", DELIVERY, "--to", tmp_path, "--page")
    assert done.exit_code == 0, done.output
    views = ("functional", "deployment", "verification", "topics")
    names = {f"hospital-delivery-{view}.svg" for view in views} | {"hospital-delivery.md"}
    assert {one.name for one in tmp_path.iterdir()} == names
    page = (tmp_path / "hospital-delivery.md").read_text()
    assert all(f"(hospital-delivery-{view}.svg)" in page for view in views)


def test_mermaid_and_one_view(tmp_path):
    done = volery("draw", DELIVERY, "--to", tmp_path, "--format", "mermaid", "--view", "deployment")
    assert done.exit_code == 0, done.output
    assert [one.name for one in tmp_path.iterdir()] == ["hospital-delivery-deployment.mmd"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--view", "inside"), "--view inside: there is all, deployment, functional, topics or verification"),
        (("--format", "png"), "--format png: there is mermaid or svg"),
        (("--format", "mermaid", "--view", "topics"), "--view topics: as Mermaid text there is deployment"),
        (("--to", "/dev/null/x"), "cannot write /dev/null/x"),
    ],
)
def test_what_is_refused(options, message):
    done = volery("draw", DELIVERY, *options)
    assert done.exit_code == 2
    assert message in done.stderr


def test_the_name_of_a_model_is_no_path(tmp_path):
    model = "volery: 1\nname: ../../up\ncomponents: {A: {language: python}}\n"
    model += "application: {a: {is: A}}\nallocations: {x: {a: pc}}\n"
    model += "platform: {processors: {pc: {is: rpi4-cortex-a72, frequency: 1 GHz}}}\n"
    (tmp_path / "model.yaml").write_text(model)
    out = tmp_path / "out"
    assert volery("draw", tmp_path, "--to", out).exit_code == 0
    assert {one.name for one in out.iterdir()} == {
        f"up-{one}.svg" for one in ("functional", "deployment", "verification")
    }
    assert "states no topics" in volery("draw", tmp_path, "--to", out, "--view", "topics").stderr


def test_differences_of_two_allocations():
    done = volery("diff", DELIVERY, DELIVERY, "--allocation-after", "slow", "--json")
    assert done.exit_code == 0, done.output
    assert {one["after"] for one in json.loads(done.stdout)} == {"600 MHz"}
    assert "no difference" in volery("diff", DELIVERY, DELIVERY).stdout
    assert volery("diff", DELIVERY, DELIVERY / "nothing").exit_code == 2
