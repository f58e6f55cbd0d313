"""What a valid model lacks for a fidelity."""

import pytest

from volery.base.errors import ModelError
from volery.model.system_loader import check_code, gaps


def missing(workshop):
    return [str(gap) for gap in gaps(workshop.load(), "code")]


def test_times_needs_a_figure_at_each_kind_of_processor(workshop):
    found = [str(gap) for gap in gaps(workshop.load(), "times")]
    assert len(found) == 2  # control's operation and its activation
    assert "components.drone_control.operations.deliver: no time is stated at rpi4-cortex-a72" in found[0]
    assert "components.drone_control.activation" in found[1]


def test_a_figure_at_another_processor_is_named(workshop):
    system = workshop.load(None, None, "allocations.fast.central=onboard")
    found = [str(gap) for gap in gaps(system, "times")]
    assert "where central runs (there is one at intel-i5-3470); fidelity `times` needs one" in found[0]


def test_code_needs_files(workshop):
    assert missing(workshop) == []
    workshop.change("    path: code/planner.py\n", "")
    [said] = missing(workshop)
    assert "components.RouteGenerator: it has no code: fidelity `code` needs a `path`" in said
    check_code(workshop.load())  # a run has its stated times


def test_a_file_that_is_not_written_yet_keeps_a_model_from_running_only(workshop):
    workshop.change("code/planner.py", "code/planer.py")
    system = workshop.load()
    [warning] = [one for one in system.warnings if one.rule.code == "V705"]
    assert "there is no file 'code/planer.py' beside the model" in warning.what
    assert "planner.py" in warning.what
    assert warning.where.line == workshop.line_of("planer.py")
    with pytest.raises(ModelError, match=r"a run needs its code. Write it, or remove `path`"):
        check_code(system)
    assert any("a run needs its code" in one for one in missing(workshop))


def test_components_without_instances_do_not_matter(workshop):
    workshop.change("  Requester:", "  Unused: {language: c++}\n  Requester:")
    assert missing(workshop) == []
